"""Answers to queries: a list of the best cells, or a ranking of all cells."""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NotRequired

import numpy as np
from typing_extensions import TypedDict

from semsig_gis.core import (
    LICENSES,
    Displayed,
    InputError,
    SignatureRecord,
    percent,
    place_links,
    plot_with,
    to_degrees,
)
from semsig_gis.observation import GRID_NORTH, NorthRecord, View, ViewRecord

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    import geopandas as gpd
    import pandas as pd
    from numpy.typing import ArrayLike, NDArray
    from pyproj import CRS

    from semsig_gis.core import Axes, Signature, Taxonomy
    from semsig_gis.database import City, ObjectStore, SignatureDatabase
    from semsig_gis.observation import North


REGION_SHARE = 0.9
"""Share of the probability in the region of an answer."""
LEAST_ELSEWHERE = 0.1
"""Least chance of being from elsewhere that an answer states."""
LEAST_FIT = 0.01
"""Goodness of fit below which a view fits badly."""


class CandidateRecord(TypedDict):
    """A candidate as plain values: the cell with its viewpoint, in metres and in degrees."""

    cell: int
    cell_id: int
    x: float
    y: float
    lon: float
    lat: float
    types: str
    length: int


class PositionRecord(TypedDict):
    """A known position as plain values, with the form in which it was read."""

    x: float
    y: float
    lat: float
    lon: float
    sigma: float
    read_as: str


class BestPlaceRecord(TypedDict):
    """The best place of an answer: its name in words, in degrees, and links by title."""

    name: str
    lat: float
    lon: float
    links: dict[str, str]


class AnswerRecord(TypedDict):
    """The values that the answers of all methods have."""

    query: ViewRecord | SignatureRecord
    north: NorthRecord
    cells: int
    notes: list[str]
    crs: str
    licenses: list[str]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Answer(Displayed):
    """The best cells for a query, by any method.

    `columns` describe the cells, by likelihood those of distinct places, best first: the rank,
    ``cell`` (row in the database), ``cell_id``, ``x`` and ``y`` (viewpoint in `crs`), ``types``
    (symbols), ``length`` (objects) and columns of the method; `candidates` is a table of them.
    `cells` is the number of cells searched. `notes` are sentences on parts of the query that were
    not used or look wrong. The bearings of `query` are measured from `north`. `city`, if known,
    names places by their streets and is drawn below the answer; `licenses` include its own.
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
    city: City | ObjectStore | None = None

    @property
    @abstractmethod
    def xy(self) -> tuple[float, float]:
        """The best place in metres, in the CRS of the database."""

    @cached_property
    def place(self) -> str:
        """The best place in words: ``on High Street, near Town Hall``; empty if unknown."""
        return "" if self.city is None else self.city.place_name(*self.xy)

    @cached_property
    def latlon(self) -> tuple[float, float]:
        """Latitude and longitude of the best place in degrees (WGS 84), rounded to 1 cm."""
        lon, lat = to_degrees(self.crs).transform(*self.xy)
        return round(lat, 7), round(lon, 7)

    @property
    def chance(self) -> float | None:
        """The chance of the best place; None if the method gives no probabilities."""
        return None

    @property
    def links(self) -> dict[str, str]:
        """Addresses of public maps and street-level photographs of the best place, by title."""
        return place_links(*self.latlon)

    @cached_property
    def candidates(self) -> pd.DataFrame:
        """The cells of `columns`, one row per cell."""
        import pandas as pd  # noqa: PLC0415 - it takes 0.25 s

        return pd.DataFrame(dict(self.columns))

    @property
    def grid_query(self) -> Signature:
        """The query with its bearings from grid north."""
        return self.north.to_grid(self.query)

    @property
    def chances(self) -> NDArray[np.float64] | None:
        """The probability of every cell, shape (n,); None if the method gives no probabilities."""
        return None

    @abstractmethod
    def region_cells(self, database: SignatureDatabase, share: float) -> NDArray[np.int64]:
        """Return the rows of the cells to search in the field, best first.

        They have a share of the probability; without probabilities, they are the candidates. Raises
        InputError if the answer is from another database.
        """

    @abstractmethod
    def to_dict(self) -> AnswerRecord:
        """Return the answer as plain values for JSON."""

    def to_geodataframe(self) -> gpd.GeoDataFrame:
        """Return the candidates with their viewpoints as points in the CRS of the database."""
        import geopandas as gpd  # noqa: PLC0415 - it takes 0.3 s

        points = gpd.points_from_xy(self.candidates["x"], self.candidates["y"])
        frame = gpd.GeoDataFrame(self.candidates.copy(), geometry=points, crs=self.crs)
        frame.attrs[LICENSES] = list(self.licenses)
        return frame

    def plot(self, *, ax: Axes | None = None, legend: bool = True) -> Axes:
        """Draw the possible places of the query (see `plot_answer`)."""
        return plot_with("plot_answer", self, ax=ax, legend=legend)

    def candidate_rows(self) -> list[Any]:
        """Return the candidates as plain values, with ``lon`` and ``lat`` rounded to 1 cm."""
        lon, lat = np.round(to_degrees(self.crs).transform(self.columns["x"], self.columns["y"]), 7)
        columns = {**self.columns, "lon": lon, "lat": lat}
        rows = zip(*(column.tolist() for column in columns.values()), strict=True)
        return [dict(zip(columns, row, strict=True)) for row in rows]


def candidate_columns(
    database: SignatureDatabase, cells: NDArray[np.int64]
) -> dict[str, NDArray[Any]]:
    """Return the part of `Answer.columns` that all methods have."""
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
    """The scores of all cells for a query.

    `scores` (n,) are distances or negative log-likelihoods, lower is better, lowest for the cells
    of the answer; `best_score` is the score of the answer. `place` (metres) and `heading` (degrees
    to add to the bearings of the query) are None if they were not estimated. `chance` is the
    probability, by the method, that the answer is within 50 m, `chances` (n,) that of every cell
    and `region` the rows with 90 % of it: NaN and None without probabilities. `seconds` is the
    computing time.
    """

    scores: NDArray[np.float32]
    best_score: float
    place: tuple[float, float] | None = None
    heading: float | None = None
    chance: float = math.nan
    chances: NDArray[np.float64] | None = None
    region: NDArray[np.int64] | None = None
    seconds: float


def answer_licenses(
    database: SignatureDatabase, city: City | ObjectStore | None
) -> tuple[str, ...]:
    """Return the licences of a database and of the buildings and streets that name its places."""
    ground = () if city is None else city.ground_licenses
    return tuple(dict.fromkeys((*database.licenses, *ground)))


def check_top(top: int) -> None:
    """Raise InputError if the number of candidates is below 1."""
    if top < 1:
        raise InputError(f"{top} candidates were asked for; give a whole number from 1.")


def query_notes(
    query: Signature, present: ArrayLike, taxonomy: Taxonomy, *, texts: Collection[str] = ()
) -> tuple[str, ...]:
    """Return warnings about the objects of a query, such as classes that the database lacks.

    `present` are the class codes that occur in the database. Objects with one of the `texts`, which
    fit the map, are used whatever their class.
    """
    notes = query.notes if isinstance(query, View) else ()
    if not len(query):
        if texts:
            return notes
        return ("nothing was seen, which says little about the place.", *notes)
    words = [taxonomy.title_of(name).lower() for name in View.of(query).class_names(taxonomy)]
    if isinstance(query, View) and query.bearings is not None and len(outside := query.outside()):
        listed = ", ".join(
            f"{words[row]} at {query.bearings[row]:.1f}°" for row in outside.tolist()
        )
        note = (
            f"{listed} {'is' if len(outside) == 1 else 'are'} outside the sectors that were looked "
            "at; the heading, the field of view or the bearing may be wrong."
        )
        notes = (note, *notes)
    usable = query.among(present)
    if texts and isinstance(query, View):
        usable |= np.array([text in texts for text in query.text_rows], np.bool_)
    lacking = [words[row] for row in np.flatnonzero(~usable).tolist()]
    if not lacking:
        return notes
    names = " and no ".join(dict.fromkeys(lacking))
    used = "this object was" if len(lacking) == 1 else f"these {len(lacking)} objects were"
    return (f"the map has no {names}, so {used} not used.", *notes)


class DoubtRecord(TypedDict):
    """The numbers of `doubt_sentence`, without those that are unremarkable.

    ``elsewhere`` is the chance of being from elsewhere, ``worse_than`` how many of 1,000 simulated
    views from the best place fit it better.
    """

    elsewhere: NotRequired[float]
    worse_than: NotRequired[int]


def doubt_parts(elsewhere: float, fit: float | None) -> DoubtRecord:
    """Return the numbers of `doubt_sentence`."""
    parts = DoubtRecord()
    if elsewhere >= LEAST_ELSEWHERE:
        parts["elsewhere"] = elsewhere
    if fit is not None and fit < LEAST_FIT:
        parts["worse_than"] = round(1000.0 * (1.0 - fit))
    return parts


def doubt_sentence(elsewhere: float, fit: float | None) -> str:
    """Return a sentence on the chance that a view is from elsewhere and on how well it fits.

    It is empty if both are unremarkable; see `Location` for the numbers.
    """
    parts = doubt_parts(elsewhere, fit)
    fits = f"worse than {parts.get('worse_than', 0):,.0f} of 1,000 simulated views from there"
    if "elsewhere" not in parts:
        return f"The view fits the best place badly: {fits}." if parts else ""
    badly = f"; it fits the best place {fits}" if "worse_than" in parts else ""
    return f"The view may not be from this area: chance {percent(elsewhere)}{badly}."
