"""Rank the cells of a signature database for a query.

Scores are distances: lower is better. Cells that tie are told as such, never ranked by accident.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pandas as pd
from pyproj import Transformer

from semsig_gis.errors import InputError
from semsig_gis.method import ANGLES, BOTH, DEFAULT_METHOD, TYPES, Method
from semsig_gis.metrics import metric
from semsig_gis.scoring import top_candidates

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray
    from pyproj import CRS

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.sequences import SequenceTable
    from semsig_gis.signatures import Signature
    from semsig_gis.taxonomy import Taxonomy

__all__ = ["DEFAULT_METHOD", "Localization", "Method", "localize", "score_cells"]

# Equal scores must come out equal, however they were added up, or ties are broken by rounding.
# Real differences between scores are far larger than this step, and float32 holds its multiples
# exactly up to 256.
_SCORE_STEP = 2.0**-16
_BATCH_BYTES = 128 << 20  # distances to distinct sequences held at once
# For fewer queries, measuring what the first stage kept beats measuring all sequences at once.
_MANY_QUERIES = 8
_BATCH_QUERIES = 128  # RapidFuzz compares queries of like length together, so it wants many


@dataclass(frozen=True, eq=False, kw_only=True)
class Localization:
    """The best cells for a query.

    Parameters
    ----------
    query : Signature
        What was searched for.
    method : Method
        How the cells were ranked.
    used : str
        Which parts of the query were compared: ``"types"``, ``"angles"`` or ``"types+angles"``.
    candidates : DataFrame
        One row a cell, best first, equal distances in the order of the database: ``rank_low``
        and ``rank_high`` (the first and last rank, from 1, that the cell can have when ties are
        broken either way), ``tied`` (how many cells share its distance), ``cell`` (row in the
        database), ``cell_id``, ``x`` and ``y`` (viewpoint, CRS of the database), ``types``
        (symbols), ``length`` (objects), ``distance``.
    cells : int
        How many cells were searched.
    tied_beyond : int
        How many cells are as good as the last candidate but are not listed.
    crs : pyproj.CRS
        CRS of ``x`` and ``y``.
    taxonomy : Taxonomy
        The classes behind the symbols.
    licenses : tuple of str
        Where the street objects of the database come from.
    """

    query: Signature
    method: Method
    used: str
    candidates: pd.DataFrame
    cells: int
    tied_beyond: int
    crs: CRS
    taxonomy: Taxonomy
    licenses: tuple[str, ...]

    def to_geodataframe(self) -> gpd.GeoDataFrame:
        """Return the candidates with their viewpoints as points in the CRS of the database.

        Returns
        -------
        GeoDataFrame
            The columns of `candidates` and ``geometry``.
        """
        points = gpd.points_from_xy(self.candidates["x"], self.candidates["y"])
        return gpd.GeoDataFrame(self.candidates.copy(), geometry=points, crs=self.crs)

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values that JSON can hold.

        Returns
        -------
        dict
            ``query``, ``method``, ``used``, ``cells``, ``tied_beyond``, ``crs``, ``licenses``
            and ``candidates``, a list with the columns of `candidates` and ``lon``, ``lat``
            (degrees, WGS 84).
        """
        codes, bearings = self.query.codes, self.query.bearings
        to_degrees = Transformer.from_crs(self.crs, "EPSG:4326", always_xy=True)
        lon, lat = to_degrees.transform(
            self.candidates["x"].to_numpy(), self.candidates["y"].to_numpy()
        )
        listed = self.candidates.assign(lon=np.round(lon, 7), lat=np.round(lat, 7))
        return {
            "query": {
                "types": None if codes is None else self.taxonomy.decode(codes),
                "bearings": None if bearings is None else bearings.tolist(),
                "length": len(self.query),
            },
            "method": str(self.method),
            "used": self.used,
            "cells": self.cells,
            "tied_beyond": self.tied_beyond,
            "crs": self.crs.to_string(),
            "licenses": list(self.licenses),
            "candidates": listed.to_dict(orient="records"),
        }


def score_cells(
    database: SignatureDatabase, queries: Sequence[Signature], method: Method = DEFAULT_METHOD
) -> Iterator[NDArray[np.float32]]:
    """Give the distance of each query to every cell, one query after the other.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    queries : sequence of Signature
        What to search for. An empty query is compared like any other.
    method : Method
        How the cells are ranked.

    Yields
    ------
    ndarray of float32, shape (n,)
        Distances of one query to the cells, in the order of the database; lower is better.
        Equal scores are exactly equal: all are multiples of 2 ** -16.

    Raises
    ------
    InputError
        If a query has no part that the method compares.

    Notes
    -----
    Each distinct sequence is measured once. Memory stays bounded whatever the number of queries.

    Examples
    --------
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.building import build_database
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> database = build_database(objects)
    >>> queries = [database.signature(cell) for cell in (0, 10)]
    >>> for scores in score_cells(database, queries, Method.parse("edit+jaccard:5%")):
    ...     print(len(scores) == len(database), scores.min())
    True 0.0
    True 0.0
    """
    # Checked here, not when the first score is asked for. A run compares the same parts.
    runs = [(part, list(run)) for part, run in itertools.groupby(queries, key=method.used)]
    return itertools.chain.from_iterable(
        _score_run(database, run, method, part) for part, run in runs
    )


def localize(
    database: SignatureDatabase,
    query: Signature,
    *,
    method: Method = DEFAULT_METHOD,
    top: int = 100,
) -> Localization:
    """Find the cells whose signature is most like a query.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    query : Signature
        What a person or a detector saw; types or bearings may be unknown.
    method : Method
        How the cells are ranked. A fusion uses the part that the query has.
    top : int
        How many cells to list, at least 1.

    Returns
    -------
    Localization
        The best cells, with ties told.

    Raises
    ------
    InputError
        If the query is empty, has no part that the method compares, or has a class that no cell
        of the database sees, or `top` is below 1.

    Examples
    --------
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.building import build_database
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> database = build_database(objects)
    >>> found = localize(database, database.signature(10), top=3)
    >>> found.used, found.candidates["distance"][0]
    ('types+angles', np.float64(0.0))
    """
    if top < 1:
        msg = f"{top} candidates were asked for; give a whole number from 1."
        raise InputError(msg)
    if len(query) == 0:
        msg = "the query has no objects; give at least one type or bearing."
        raise InputError(msg)
    _require_present(query, database)
    (scores,) = score_cells(database, [query], method)
    better, level = top_candidates(scores, min(top, len(scores)))
    better = better[np.argsort(scores[better], kind="stable")]
    listed = np.concatenate([better, level])[:top]
    distances = scores[listed]
    ordered = np.concatenate([distances[: len(better)], scores[level]])
    rank_low = np.searchsorted(ordered, distances, side="left") + 1
    rank_high = np.searchsorted(ordered, distances, side="right")
    xy = database.xy[listed]
    candidates = pd.DataFrame(
        {
            "rank_low": rank_low,
            "rank_high": rank_high,
            "tied": rank_high - rank_low + 1,
            "cell": listed,
            "cell_id": database.cell_ids[listed],
            "x": xy[:, 0],
            "y": xy[:, 1],
            "types": [database.types(cell) for cell in listed.tolist()],
            "length": database.lengths[listed],
            "distance": distances.astype(np.float64),
        }
    )
    return Localization(
        query=query,
        method=method,
        used=method.used(query),
        candidates=candidates,
        cells=len(database),
        tied_beyond=len(better) + len(level) - len(listed),
        crs=database.crs,
        taxonomy=database.taxonomy,
        licenses=database.licenses,
    )


def _require_present(query: Signature, database: SignatureDatabase) -> None:
    """Refuse a class that no cell sees: it could only make every score worse."""
    if query.codes is None:
        return
    absent = np.setdiff1d(query.codes, database.present_codes)
    if len(absent):
        missing = database.taxonomy.by_code(int(absent[0]))
        seen = [database.taxonomy.by_code(int(code)) for code in database.present_codes]
        legend = ", ".join(f"{item.symbol} {item.title.lower()}" for item in seen)
        msg = (
            f"the query has symbol {missing.symbol!r} ({missing.title.lower()}), which no cell of "
            f"the database sees; leave it out, the symbols seen are {legend}."
        )
        raise InputError(msg)


def _score_run(
    database: SignatureDatabase, queries: Sequence[Signature], method: Method, used: str
) -> Iterator[NDArray[np.float32]]:
    """Score queries that use the same parts, batch by batch."""
    distinct = sum(len(_table(database, part)) for part in used.split("+"))
    size = min(_BATCH_QUERIES, max(1, _BATCH_BYTES // (4 * max(1, distinct))))
    for low in range(0, len(queries), size):
        batch = queries[low : low + size]
        codes = [query.codes for query in batch if query.codes is not None]
        levels = [query.levels(database.spec.levels) for query in batch if used != TYPES]
        if used == BOTH:
            yield from _score_both(database, codes, levels, method)
        else:
            table = _table(database, used)
            for row in _distances(method, used, codes if used == TYPES else levels, table):
                yield _on_steps(row)[table.inverse]


def _score_both(
    database: SignatureDatabase,
    codes: Sequence[NDArray[np.uint8]],
    levels: Sequence[NDArray[np.uint8]],
    method: Method,
) -> Iterator[NDArray[np.float32]]:
    """Score a batch of queries by types and angles, in one stage or two."""
    types, angles = database.type_sequences, database.angle_sequences
    by_types = _distances(method, TYPES, codes, types)
    if method.keep is not None and len(codes) < _MANY_QUERIES:
        for first, one in zip(by_types, levels, strict=True):
            yield _two_stage(
                method, first[types.inverse], angles, partial(_some, method, one, angles)
            )
        return
    for first, second in zip(by_types, _distances(method, ANGLES, levels, angles), strict=True):
        if method.keep is None:
            yield _fused(method, first[types.inverse], second[angles.inverse])
        else:
            yield _two_stage(method, first[types.inverse], angles, second.__getitem__)


def _table(database: SignatureDatabase, part: str) -> SequenceTable:
    """Return the distinct sequences of one part; the other part's are not looked for."""
    return database.type_sequences if part == TYPES else database.angle_sequences


def _two_stage(
    method: Method,
    by_types: NDArray[np.float32],
    angles: SequenceTable,
    second_stage: Callable[[NDArray[np.int64]], NDArray[np.float32]],
) -> NDArray[np.float32]:
    """Re-rank the cells that are best by type; the others follow in their order.

    The second stage gives the distances to the distinct angle sequences that it is asked for.
    """
    first = _on_steps(by_types)
    # Exact: 7 % of 100 cells are 7, though 100 * 0.07 is a little more.
    count = math.ceil(Fraction(str(method.keep)) * len(first) / 100)
    cut = np.partition(first, count - 1)[count - 1]
    kept = np.flatnonzero(first <= cut)
    fused = _fused(method, by_types[kept], second_stage(angles.inverse[kept]))
    worst = fused.max()
    # Behind every kept cell even where the gap is lost in rounding, as on a large raw scale.
    behind = np.nextafter(worst, np.float32(np.inf))
    scores: NDArray[np.float32] = np.maximum(worst + (first - cut), behind)
    scores[kept] = fused
    return scores


def _some(
    method: Method,
    query_levels: NDArray[np.uint8],
    angles: SequenceTable,
    wanted: NDArray[np.int64],
) -> NDArray[np.float32]:
    """Measure only the distinct angle sequences that are wanted, each once."""
    only, place = np.unique(wanted, return_inverse=True)
    distances = _distances(method, ANGLES, [query_levels], angles, only=only)[0]
    return np.asarray(distances[place])


def _distances(
    method: Method,
    part: str,
    sequences: Sequence[NDArray[np.uint8]],
    table: SequenceTable,
    *,
    only: NDArray[np.int64] | None = None,
) -> NDArray[np.float32]:
    """Measure one part of some queries against distinct sequences, as the method says."""
    measure = metric(method.measures[part], weights=method.weights)
    return measure.distances(sequences, table, normalized=method.normalized, only=only)


def _fused(
    method: Method, by_types: NDArray[np.float32], by_angles: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return the weighted sum of two distances."""
    return _on_steps(method.alpha * by_types.astype(np.float64) + (1 - method.alpha) * by_angles)


def _on_steps(scores: NDArray[np.floating]) -> NDArray[np.float32]:
    """Round to whole steps, so that equal scores come out equal however they were added up."""
    steps = np.rint(scores / _SCORE_STEP)
    return np.asarray(steps * _SCORE_STEP, dtype=np.float32)
