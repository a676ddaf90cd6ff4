"""Locate a query by distance: the best cells, with their ties."""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core import EmptyResultError, map_with
from semsig_gis.database import (
    PartitionedDatabase,
    rows_of_result,
    whole_database,
)
from semsig_gis.localization.answers import (
    Answer,
    AnswerRecord,
    BestPlaceRecord,  # noqa: TC001 - pydantic reads it
    CandidateRecord,
    Ranking,
    answer_licenses,
    candidate_columns,
    check_top,
    query_notes,
)
from semsig_gis.localization.distance.method import FUSION
from semsig_gis.localization.distance.scores import score_cells, score_parts
from semsig_gis.localization.distance.ties import top_candidates
from semsig_gis.observation import GRID_NORTH, View

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from semsig_gis.core import MapFrame, Signature
    from semsig_gis.database import City, ObjectStore, SignatureDatabase
    from semsig_gis.localization.distance.memo import DistanceMemo
    from semsig_gis.localization.distance.method import Method
    from semsig_gis.localization.requirement import Requirement
    from semsig_gis.observation import North


class RankedRecord(CandidateRecord):
    """A candidate with its distance; tied cells share their ranks."""

    rank_low: int
    rank_high: int
    tied: int
    distance: float


class LocalizationRecord(AnswerRecord):
    """An answer by distance as plain values."""

    method: str
    used: str
    place: BestPlaceRecord
    tied_beyond: int
    candidates: list[RankedRecord]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Localization(Answer):
    """The best cells for a query, by distance.

    Parameters
    ----------
    query, cells, crs, taxonomy, licenses
        The query, the number of cells searched, and the CRS, classes and licences of the database.
    method : Method
        How the cells were ranked.
    used : str
        The compared parts of the query: ``"types"``, ``"angles"`` or ``"types+angles"``.
    columns : mapping of str to ndarray
        The best cells, which are the rows of `candidates`: best first, equal distances in the
        order of the database. ``rank_low`` and ``rank_high`` (first and last possible rank, from 1,
        among its ties), ``tied`` (number of cells with the same distance), ``cell`` (row in the
        database), ``cell_id``, ``x`` and ``y`` (viewpoint, CRS of the database), ``types``
        (symbols), ``length`` (objects), ``distance``.
    tied_beyond : int
        Number of cells that tie with the last candidate but are not listed.

    Examples
    --------
    >>> from semsig_gis import Method, localize
    >>> query = demo_database.signature(0)
    >>> localization = localize(demo_database, query, method=Method.parse("edit+edit"), top=3)
    >>> len(localization.candidates)
    3
    """

    method: Method
    used: str

    def _facts(self) -> dict[str, object]:
        columns = self.columns
        best: dict[str, object] = {}
        if len(columns["cell"]):
            best = {
                "best cell": columns["cell_id"][0],
                "place": f"{self.latlon[0]:.5f}, {self.latlon[1]:.5f}",
                **({"which is": self.place} if self.place else {}),
                "distance": f"{columns['distance'][0]:.3f}",
                "as good": columns["tied"][0],
            }
        return {
            **best,
            "candidates": len(columns["cell"]),
            "cells": self.cells,
            "method": self.method,
        }

    @property
    def xy(self) -> tuple[float, float]:
        """The viewpoint of the first candidate in metres."""
        return float(self.columns["x"][0]), float(self.columns["y"][0])

    def region_cells(self, database: SignatureDatabase, share: float) -> NDArray[np.int64]:  # noqa: ARG002
        """Return the rows of the candidates in the database that was searched."""
        ids, types = self.columns["cell_id"], self.columns["types"]
        return rows_of_result(database, ids, types, what="localization")

    def explore(self, database: SignatureDatabase | City) -> MapFrame:
        """Return a map of the candidates for a notebook (see `localization_map`)."""
        return map_with("localization_map", self, whole_database(database))

    def to_dict(self) -> LocalizationRecord:
        """Return plain values for JSON; ``candidates`` is a list of records.

        These have the names of `columns` and ``lon``, ``lat`` (degrees, WGS 84). ``place`` is the
        first of them, with its name in words and links.
        """
        candidates = self.candidate_rows()
        return {
            "query": self.query.to_dict(self.taxonomy),
            "north": self.north.to_dict(),
            "method": str(self.method),
            "used": self.used,
            "place": {
                "name": self.place,
                "lat": candidates[0]["lat"],
                "lon": candidates[0]["lon"],
                "links": self.links,
            },
            "cells": self.cells,
            "tied_beyond": self.tied_beyond,
            "notes": list(self.notes),
            "crs": self.crs.to_string(),
            "licenses": list(self.licenses),
            "candidates": candidates,
        }


@dataclass(eq=False, kw_only=True)
class DistanceLocator:
    """Locator that ranks the cells of a database by a distance method."""

    database: SignatureDatabase | PartitionedDatabase
    method: Method = FUSION
    requirement: Requirement | None = None
    top: int = 100
    north: North = GRID_NORTH
    city: City | ObjectStore | None = None
    _warm_parts: set[str] = field(default_factory=set)  # `rankings` has compared them before

    def __post_init__(self) -> None:  # noqa: D105
        check_top(self.top)

    def locate(self, query: Signature, *, top: int | None = None) -> Localization:
        """Return the cells with the signatures most similar to a query, over all parts."""
        count = top or self.top
        grid_query = self.north.to_grid(query)
        shortlist, part = self._search(grid_query, count)
        present = sorted(shortlist.present)
        occurring = grid_query.among(present)
        if not occurring.all():  # known only after the last part
            shortlist, part = self._search(grid_query.select(occurring), count)
        columns, tied_beyond = shortlist.ranked()
        if isinstance(self.database, PartitionedDatabase):
            columns["cell"] = self.database.row_numbers(columns["cell_id"])
        elif self.requirement is not None:
            mask = self.requirement.met(self.database.type_sequences)
            columns["cell"] = np.flatnonzero(mask)[columns["cell"]]
        return Localization(
            query=query,
            method=self.method,
            used=self.method.used(query),
            columns=columns,
            cells=shortlist.cells,
            tied_beyond=tied_beyond,
            crs=part.crs,
            taxonomy=part.taxonomy,
            licenses=answer_licenses(part, self.city),
            notes=(
                *query_notes(query, present, part.taxonomy),
                *_unused_notes(query, self.method),
                *self.north.notes,
            ),
            north=self.north,
            city=self.city,
        )

    def _search(self, query: Signature, top: int) -> tuple[Shortlist, SignatureDatabase]:
        """Return the best cells of all parts, and an empty database with their CRS and classes."""
        shortlist = Shortlist(top)
        for part, scores in score_parts(self.database, query, self.method):
            shortlist.present.update(part.present_codes.tolist())
            if self.requirement is None:
                shortlist.add(part, scores)
                continue
            mask = self.requirement.met(part.type_sequences)
            if mask.any():
                shortlist.add(part.select(mask), scores[mask])
        if shortlist.cells == 0:
            cells = len(self.database)
            raise EmptyResultError(
                f"none of the {cells:,} cells meets the requirement; require less."
            )
        return shortlist, part.select(slice(0))

    def rankings(
        self, queries: Sequence[Signature], *, memo: DistanceMemo | None = None
    ) -> Iterator[Ranking]:
        """Rank all cells for each query; see `Locator`."""
        if not queries:
            return
        database = self.database
        if isinstance(database, PartitionedDatabase):
            database = database.whole()
        # Cached arrays of the database are computed before the time is measured.
        parts = self.method.used(queries[0])
        if parts not in self._warm_parts:
            next(iter(score_cells(database, queries[:1], self.method)))
            self._warm_parts.add(parts)
        rows = iter(score_cells(database, queries, self.method, memo=memo))
        for _ in queries:
            start, spared = time.perf_counter(), memo.spared if memo else 0.0
            scores = next(rows)
            seconds = time.perf_counter() - start + (memo.spared - spared if memo else 0.0)
            yield Ranking(scores=scores, best_score=float(scores.min()), seconds=seconds)


def _unused_notes(query: Signature, method: Method) -> tuple[str, ...]:
    """Return a note on the parts of a view that a distance does not use."""
    if not isinstance(query, View):
        return ()
    parts = {
        "ranges": query.ranges is not None,
        "errors of bearings": query.bearing_errors is not None,
        "scores": query.scores is not None,
        "texts": query.texts is not None or bool(query.signs),
        "sectors": any(photo.sectors for photo in query.photos),
        "errors of north": any(photo.north_sigma for photo in query.photos),
    }
    unused = [name for name, present in parts.items() if present]
    if not unused:
        return ()
    return (f"{method} does not use {' and '.join(unused)}; the method likelihood does.",)


class Shortlist:
    """The best `top` cells of a search, collected over the parts of a database.

    `columns` are theirs, best first, equal distances in the order of the grid; `present` are the
    class codes that occur; `cells` is the number of cells searched.
    """

    def __init__(self, top: int) -> None:
        self.columns: dict[str, NDArray[Any]] = {}
        self.present: set[int] = set()
        self.cells = 0
        self._top = top
        # Number of cells by distance, at least up to the last listed distance.
        self._sizes: Counter[float] = Counter()

    def add(self, database: SignatureDatabase, scores: NDArray[np.float32]) -> None:
        """Add the best cells of a part, from the distances of all its cells."""
        better, level = top_candidates(scores, min(self._top, len(scores)))
        better = better[np.argsort(scores[better], kind="stable")]
        cells = np.concatenate([better, level])
        # All ties with the last are counted, also those that are not listed.
        values, sizes = np.unique(scores[cells], return_counts=True)
        self._sizes.update(dict(zip(values.tolist(), sizes.tolist(), strict=True)))
        cells = cells[: self._top]
        part = candidate_columns(database, cells)
        part["distance"] = scores[cells].astype(np.float64)
        if self.cells:
            both = {name: np.append(self.columns[name], part[name]) for name in part}
            best = np.lexsort((both["cell_id"], both["distance"]))[: self._top]
            part = {name: column[best] for name, column in both.items()}
        self.columns = part
        self.present.update(database.present_codes.tolist())
        self.cells += len(database)

    def ranked(self) -> tuple[dict[str, NDArray[Any]], int]:
        """Return the columns with ranks, and the number of ties beyond, as in `Localization`."""
        values = np.array(sorted(self._sizes))
        sizes = np.array([self._sizes[value] for value in values.tolist()])
        rows = np.searchsorted(values, self.columns["distance"])
        high, tied = np.cumsum(sizes)[rows], sizes[rows]
        ranks = {"rank_low": high - tied + 1, "rank_high": high, "tied": tied}
        return {**ranks, **self.columns}, int(high[-1]) - len(high)
