"""What answers queries, and what it answers: the best cells listed, or all cells ranked."""

from __future__ import annotations

import math
import re
import time
from abc import abstractmethod
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Protocol, Self, TypeVar

import numpy as np

from semsig_gis.core import LICENSES, WILDCARD, Displayed, InputError, plot_with, to_degrees
from semsig_gis.observation import GRID_NORTH, View

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence

    import geopandas as gpd
    import pandas as pd
    from numpy.typing import ArrayLike, NDArray
    from pyproj import CRS

    from semsig_gis.core import Axes, Signature, Taxonomy
    from semsig_gis.database import SequenceTable, SignatureDatabase
    from semsig_gis.observation import North


REGION_SHARE = 0.9
"""Of the chance, that the region of an answer holds."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Answer(Displayed):
    """The best cells for a query, whatever ranked them.

    `columns` tell of the cells by name, best first: the rank, ``cell`` (row in the database),
    ``cell_id``, ``x`` and ``y`` (viewpoint in `crs`), ``types`` (symbols), ``length`` (objects) and
    what the method tells of them; `candidates` is the table of them. `cells` counts the cells that
    were searched, and `notes` are sentences on what of the query could not be used as it was given.
    The bearings of `query` count from `north`.
    """

    query: Signature
    columns: Mapping[str, NDArray[Any]]
    cells: int
    crs: CRS
    taxonomy: Taxonomy
    licenses: tuple[str, ...]
    tied_beyond: int = 0
    notes: tuple[str, ...] = ()
    north: North = GRID_NORTH

    @cached_property
    def candidates(self) -> pd.DataFrame:
        """The cells of `columns`, a row each."""
        import pandas as pd  # noqa: PLC0415 - it loads slowly

        return pd.DataFrame(dict(self.columns))

    @property
    def grid_query(self) -> Signature:
        """The query with its bearings from grid north."""
        return self.north.to_grid(self.query)

    @property
    def chances(self) -> NDArray[np.float64] | None:
        """The chance of every cell; None where the method tells none."""
        return None

    @abstractmethod
    def region_cells(self, database: SignatureDatabase, share: float) -> NDArray[np.int64]:
        """Return the rows of the cells where to look, best first, in the database searched.

        They hold a share of the chance, or are the candidates where there are no chances. Raises
        InputError if the answer is from another database.
        """

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """Return what was found as plain values that JSON can hold."""

    def to_geodataframe(self) -> gpd.GeoDataFrame:
        """Return the candidates with their viewpoints as points in the CRS of the database."""
        import geopandas as gpd  # noqa: PLC0415 - it loads slowly

        points = gpd.points_from_xy(self.candidates["x"], self.candidates["y"])
        frame = gpd.GeoDataFrame(self.candidates.copy(), geometry=points, crs=self.crs)
        frame.attrs[LICENSES] = list(self.licenses)
        return frame

    def plot(self, *, ax: Axes | None = None, legend: bool = True) -> Axes:
        """Draw where the query may have been seen (see `plot_answer`)."""
        return plot_with("plot_answer", self, ax=ax, legend=legend)

    def _candidate_records(self) -> list[dict[str, Any]]:
        """Return the candidates as plain values, with ``lon`` and ``lat`` to a centimetre."""
        lon, lat = np.round(to_degrees(self.crs).transform(self.columns["x"], self.columns["y"]), 7)
        columns = {**self.columns, "lon": lon, "lat": lat}
        rows = zip(*(column.tolist() for column in columns.values()), strict=True)
        return [dict(zip(columns, row, strict=True)) for row in rows]


def candidate_columns(
    database: SignatureDatabase, cells: NDArray[np.int64]
) -> dict[str, NDArray[Any]]:
    """Return what `Answer.columns` tell of some cells, whatever ranked them."""
    listed = database.select(cells)
    symbols, ends = database.taxonomy.decode(listed.codes), listed.offsets.tolist()
    return {
        "cell": cells,
        "cell_id": listed.cell_ids,
        "x": listed.xy[:, 0],
        "y": listed.xy[:, 1],
        "types": np.array([symbols[start:end] for start, end in pairwise(ends)], dtype=object),
        "length": listed.lengths,
    }


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Ranking:
    """How all cells rank for a query.

    `scores` (n,) has one value a cell, lower is better: distances, or negative log-likelihoods,
    with the cells of the answer before all others; `best_score` is that of the answer. `place`
    (metres) and `heading` (degrees to add to the bearings of the query) are None where they were
    not looked for. `chance` is the method's own probability that the answer is within 50 m,
    `chances` (n,) that of every cell and `region` the rows that hold 90 % of it: NaN and None where
    it tells none. `seconds` is how long the answer took.
    """

    scores: NDArray[np.float32]
    best_score: float
    place: tuple[float, float] | None = None
    heading: float | None = None
    chance: float = math.nan
    chances: NDArray[np.float64] | None = None
    region: NDArray[np.int64] | None = None
    seconds: float


@dataclass(eq=False, slots=True)
class DistanceMemo:
    """Distances between one batch of queries and one database, and how long each took to measure.

    Most methods of an experiment differ only in how they join the same distances. Make another memo
    for the next batch.
    """

    _known: dict[Hashable, tuple[NDArray[Any], float]] = field(default_factory=dict)
    spared: float = field(default=0.0, init=False)
    """Seconds that it would have taken to measure again what was known."""

    def get(self, key: Hashable, measure: Callable[[], NDArray[Any]]) -> NDArray[Any]:
        """Return the distances under a key, calling `measure` only if they are not known yet.

        The key must name all that they depend on. Do not write to the result.
        """
        if key in self._known:
            distances, seconds = self._known[key]
            self.spared += seconds
            return distances
        start = time.perf_counter()
        distances = measure()
        self._known[key] = distances, time.perf_counter() - start
        return distances


_Answer_co = TypeVar("_Answer_co", bound=Answer, covariant=True)


class Locator(Protocol[_Answer_co]):
    """A method with the cells that it searches and all else that it needs."""

    def locate(self, query: Signature, *, top: int | None = None) -> _Answer_co:
        """Answer a query, with its own number of candidates or another one.

        Objects of a class that no cell sees count as false detections, and the answer says so.
        Raises InputError if the query lacks a part that the method needs.
        """

    def rankings(
        self, queries: Sequence[Signature], *, memo: DistanceMemo | None = None
    ) -> Iterator[Ranking]:
        """Rank all cells for each query, in order; each query has at least one object.

        `memo` keeps distances of these queries that other methods have needed; the time it took to
        measure them counts for each method.
        """


def check_top(top: int) -> None:
    """Refuse a list of no candidates."""
    if top < 1:
        raise InputError(f"{top} candidates were asked for; give a whole number from 1.")


def query_notes(query: Signature, present: ArrayLike, taxonomy: Taxonomy) -> tuple[str, ...]:
    """Return what to say of a query to a database that sees the classes `present` alone."""
    if not len(query):
        return ("nothing was seen, which says little about the place.",)
    notes = _outside_notes(query, taxonomy) if isinstance(query, View) else ()
    codes = [] if query.codes is None else query.codes[~query.among(present)].tolist()
    if not codes:
        return notes
    lacking = map(taxonomy.by_code, dict.fromkeys(codes))
    legend = ", ".join(f"{item.symbol} ({item.title.lower()})" for item in lacking)
    note = f"no cell of the database sees {legend}, so it counts as a false detection."
    return (note, *notes)


def _outside_notes(view: View, taxonomy: Taxonomy) -> tuple[str, ...]:
    """Return what to say of objects where their photo did not look."""
    outside = view.outside().tolist()
    if not outside or view.bearings is None:
        return ()
    symbols = "?" * len(view) if view.codes is None else taxonomy.decode(view.codes)
    listed = ", ".join(f"{symbols[row]} at {view.bearings[row]:.1f}°" for row in outside)
    verb = "stands" if len(outside) == 1 else "stand"
    note = (
        f"{listed} {verb} outside the sectors that were looked at; the heading, the field of view "
        "or the bearing may be wrong."
    )
    return (note,)


_COMPARISON = re.compile(r"(\S)\s*(>=|<=|=)\s*(\d+)")
_AMOUNT = re.compile(r"(\d*)\s*(\S)")


@dataclass(frozen=True, slots=True)
class Requirement:
    """How many objects of some classes a cell must see.

    Each limit is a class code, or `WILDCARD` for all objects together, the fewest and the most.

    Examples
    --------
    >>> from semsig_gis import paper_taxonomy
    >>> requirement = Requirement.parse("M,2B", paper_taxonomy())
    """

    limits: tuple[tuple[int, int, float], ...]

    @classmethod
    def parse(cls, text: str, taxonomy: Taxonomy) -> Self:
        """Read a requirement from text, such as ``M,2B,D=0,?<=10``.

        Parts stand between commas: ``M`` for at least one bus stop, ``2B`` for at least two trees,
        or ``B>=2``, ``B<=5``, ``B=3``. The symbol ``?`` counts all objects. A symbol may stand in
        several parts. Raise InputError if a part does not have that form or two parts exclude each
        other, and UnknownNameError if a symbol is not in the taxonomy.
        """
        limits: dict[int, tuple[int, float]] = {}
        for part in map(str.strip, text.split(",")):
            symbol, least, most = _read(part, text)
            code = WILDCARD if symbol == "?" else taxonomy.by_symbol(symbol).code
            low, high = limits.get(code, (0, math.inf))
            limits[code] = low, high = max(low, least), min(high, most)
            if low > high:
                raise InputError(
                    f"requirement {text!r} wants at least {low} and at most {high} of "
                    f"{symbol!r}; give numbers that a cell can meet."
                )
        return cls(tuple((code, low, high) for code, (low, high) in limits.items()))

    def met(self, sequences: SequenceTable) -> NDArray[np.bool_]:
        """Tell which cells meet it, shape (n,), by their distinct type sequences."""
        counts = sequences.histogram
        met = np.ones(len(sequences), np.bool_)
        for code, least, most in self.limits:
            seen = np.zeros(len(sequences), np.int64)
            if code == WILDCARD:
                seen = sequences.lengths
            elif code < counts.shape[1]:
                seen = counts[:, code].astype(np.int64)
            met &= (seen >= least) & (seen <= most)
        return np.asarray(met[sequences.inverse])


def _read(part: str, text: str) -> tuple[str, int, float]:
    """Return the symbol, the fewest and the most of one part of a requirement."""
    if found := _COMPARISON.fullmatch(part):
        symbol, sign, digits = found.groups()
        number = int(digits)
        return symbol, 0 if sign == "<=" else number, math.inf if sign == ">=" else number
    if found := _AMOUNT.fullmatch(part):
        digits, symbol = found.groups()
        return symbol, int(digits or 1), math.inf
    raise InputError(
        f"{part!r} in requirement {text!r} cannot be read; give parts such as 'M', '2B', 'B>=2', "
        "'B<=5' or 'B=3' with commas between them, '?' for all objects."
    )
