"""Merge objects of the same class from different sources that are within a radius.

Objects of one source are never merged with each other; `objects.layers.build_objects` has already
collapsed duplicates within a source.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pyarrow as pa

from semsig_gis.core import (
    COUNT,
    HEIGHT,
    MERGED,
    SOURCE,
    SOURCE_ID,
    TEXTS,
    Displayed,
    InputError,
)
from semsig_gis.objects.table import arrow_objects

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from semsig_gis.objects.table import StreetObjects

# Catalogues have the same limit; objects farther apart are different objects.
RADIUS_LIMIT_M = 100.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ConflatedPair:
    """Objects of one class that were merged between two sources.

    `count` objects of the source `merged` were merged into objects of the source `kept` within
    `radius` metres, which keep their positions; `median_m` and `largest_m` are the distances.
    """

    class_name: str
    radius: float
    kept: str
    merged: str
    count: int
    median_m: float
    largest_m: float


@dataclass(frozen=True, repr=False, slots=True)
class ConflationReport(Displayed):
    """Merged objects for every class and pair of sources.

    Classes are in the order of the radii, sources in the order of the objects.
    """

    pairs: tuple[ConflatedPair, ...]

    def _facts(self) -> dict[str, object]:
        return {"merged": self.count, "pairs of sources": len(self.pairs)}

    @property
    def count(self) -> int:
        """Number of objects that were merged into others."""
        return sum(pair.count for pair in self.pairs)


def conflate(
    objects: StreetObjects, radii: Mapping[str, float]
) -> tuple[StreetObjects, ConflationReport]:
    """Merge objects that occur in several sources.

    Each source is compared with the remaining objects of all sources before it. Of the pairs of a
    remaining and a new object within the radius, the nearest is merged first, and each object is
    merged at most once. Pairs at equal distance are ordered by source, position and identifier, so
    the result does not depend on the order of rows in a source.

    Parameters
    ----------
    objects : StreetObjects
        The objects; their source is in the column ``source``. The source that occurs first has
        priority. InputError if they are conflated already.
    radii : mapping of str to float
        Distance in metres (above 0, below 100) by class, within which two objects of different
        sources are the same. Other classes, and points of extended things, are unchanged.
        UnknownNameError for an unknown class.

    Returns
    -------
    objects : StreetObjects
        The remaining objects in their order. Each has its source and position, its texts and height
        (or those of an object merged into it, where it has none), the sum of the ``count`` of the
        objects merged into it, and their list ``"source:id; source:id"`` in the column ``merged``.
        The licences of all sources are included.
    report : ConflationReport
        Number of merged objects by class and pair of sources.

    Examples
    --------
    >>> from dataclasses import replace
    >>> import pandas as pd
    >>> from semsig_gis import conflate
    >>> town = demo_objects.table
    >>> other = town.assign(source="osm", geometry=town.translate(1.0))
    >>> twice = replace(demo_objects, table=pd.concat([town, other], ignore_index=True))
    >>> merged, report = conflate(twice, {"street_light": 1.5})
    >>> report.count == len(twice) - len(merged) > 100
    True
    """
    if MERGED in objects.arrow.column_names:
        raise InputError(
            "the objects are conflated already; conflate all sources at once, before saving."
        )
    codes = {name: objects.taxonomy.by_name(name).code for name in radii}
    for name, radius in radii.items():
        if not 0 < radius < RADIUS_LIMIT_M:
            raise InputError(
                f"class {name!r} has the radius {radius!r}; give metres above 0 and below 100."
            )
    keys = _merge_keys(objects)
    grouped = np.zeros(len(objects), bool) if objects.groups is None else objects.groups >= 0
    matches = [
        _Match(name, first, second, metres)
        for name, radius in radii.items()
        for first, second, metres in _matches(
            keys, np.flatnonzero((objects.codes == codes[name]) & ~grouped), radius
        )
    ]
    return _merged(objects, keys, matches), _report(keys, matches, radii)


class _MergeKeys(NamedTuple):
    """Columns that decide about merging, shape (n,) but for `xy`, (n, 2), and `names`."""

    xy: NDArray[np.float64]
    source: NDArray[np.int64]  # number of the source, from 0
    names: list[str]  # of the sources
    rank: NDArray[np.int64]  # in an order that does not depend on the order of rows


class _Match(NamedTuple):
    class_name: str
    first: int  # row that remains
    second: int  # row merged into it
    metres: float


def _merge_keys(objects: StreetObjects) -> _MergeKeys:
    table = objects.arrow
    source = table[SOURCE].combine_chunks().dictionary_encode()
    codes = source.indices.to_numpy().astype(np.int64)
    ids = np.unique(np.array(table[SOURCE_ID].to_pylist(), object), return_inverse=True)[1]
    x, y = objects.xy.T
    rank = np.empty(len(codes), np.int64)
    rank[np.lexsort([table[COUNT].to_numpy(), ids, y, x, codes])] = np.arange(len(codes))
    return _MergeKeys(objects.xy, codes, source.dictionary.to_pylist(), rank)


def _matches(
    keys: _MergeKeys, members: NDArray[np.int64], radius: float
) -> Iterator[tuple[int, int, float]]:
    """Yield remaining row, merged row and metres between them, for the objects of one class."""
    remaining = members[:0]
    # Sources in order of priority: each is matched with the rows that remain of those before.
    for number in np.unique(keys.source[members]):
        new = members[keys.source[members] == number]
        pairs = _nearest_first(keys, remaining, new, radius) if len(remaining) else []
        yield from pairs
        merged = [row for _, row, _ in pairs]
        remaining = np.concatenate([remaining, np.setdiff1d(new, merged)])


def _nearest_first(
    keys: _MergeKeys, old: NDArray[np.int64], new: NDArray[np.int64], radius: float
) -> list[tuple[int, int, float]]:
    """Match old and new rows one to one, the nearest pairs first."""
    from semsig_gis.core import ObjectIndex  # noqa: PLC0415 - 0.1 s

    new_at, old_at = ObjectIndex(keys.xy[old]).pairs_within(keys.xy[new], radius=radius)
    new_row, old_row = new[new_at], old[old_at]
    metres = np.hypot(*(keys.xy[old_row] - keys.xy[new_row]).T)
    order = np.lexsort((keys.rank[new_row], keys.rank[old_row], metres))
    matched: set[int] = set()
    pairs = []
    for pair in zip(
        old_row[order].tolist(), new_row[order].tolist(), metres[order].tolist(), strict=True
    ):
        if matched.isdisjoint(pair[:2]):
            matched.update(pair[:2])
            pairs.append(pair)
    return pairs


def _merged(objects: StreetObjects, keys: _MergeKeys, matches: Sequence[_Match]) -> StreetObjects:
    """Return the remaining objects with their new counts and lists of merged objects."""
    table = objects.arrow
    source, source_id = table[SOURCE].to_pylist(), table[SOURCE_ID].to_pylist()
    counts = table[COUNT].to_numpy().astype(np.int64)
    entries: dict[int, list[str]] = {}
    for match in sorted(matches, key=lambda match: keys.rank[match.second]):  # by source
        counts[match.first] += counts[match.second]
        entry = f"{source[match.second]}:{source_id[match.second]}"
        entries.setdefault(match.first, []).append(entry)
    for name in (HEIGHT, *TEXTS):
        if name in table.column_names:
            table = table.set_column(
                table.column_names.index(name), name, _completed(table[name], matches)
            )
    merged = pa.array(["; ".join(entries.get(row, [])) for row in range(len(table))], pa.string())
    number = table.column_names.index(COUNT)
    table = table.set_column(number, COUNT, pa.array(counts.astype(np.int32)))
    table = table.add_column(number + 1, MERGED, merged)
    remains = np.ones(len(table), bool)
    remains[[match.second for match in matches]] = False
    return arrow_objects(
        table.filter(pa.array(remains)),
        xy=objects.xy[remains],
        crs=objects.crs,
        taxonomy=objects.taxonomy,
        licenses=objects.licenses,
        notes=objects.notes,
    )


def _completed(column: pa.ChunkedArray, matches: Sequence[_Match]) -> pa.Array:
    """Return a column in which objects without a value have that of an object merged into them."""
    values = column.to_pylist()
    for match in matches:
        if values[match.first] in {"", None} or values[match.first] != values[match.first]:
            values[match.first] = values[match.second]
    return pa.array(values, column.type)


def _report(
    keys: _MergeKeys, matches: Sequence[_Match], radii: Mapping[str, float]
) -> ConflationReport:
    classes = list(radii)
    metres_of: dict[tuple[int, int, int], list[float]] = {}
    for match in matches:
        sources = int(keys.source[match.first]), int(keys.source[match.second])
        metres_of.setdefault((classes.index(match.class_name), *sources), []).append(match.metres)
    return ConflationReport(
        tuple(
            ConflatedPair(
                class_name=classes[number],
                radius=float(radii[classes[number]]),
                kept=keys.names[first],
                merged=keys.names[second],
                count=len(metres),
                median_m=float(np.median(metres)),
                largest_m=max(metres),
            )
            for (number, first, second), metres in sorted(metres_of.items())
        )
    )
