"""What answers queries, and what it answers: the best cells listed, or all cells ranked."""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core.display import Displayed
from semsig_gis.core.errors import InputError
from semsig_gis.core.geometry import LICENSES, to_degrees
from semsig_gis.core.presentation import plot_with
from semsig_gis.observation.north import GRID_NORTH
from semsig_gis.observation.view import View

if TYPE_CHECKING:
    from collections.abc import Mapping

    import geopandas as gpd
    import pandas as pd
    from numpy.typing import ArrayLike, NDArray
    from pyproj import CRS

    from semsig_gis.core.display import Axes
    from semsig_gis.core.signature import Signature
    from semsig_gis.core.taxonomy import Taxonomy
    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.observation.north import North


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
