"""One object in two sources is one object: merge by class within a radius, and say what was done.

Objects of one source are never merged with each other; `objects.load.build_objects` has
dealt with rows that stand twice in a source.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pandas as pd

from semsig_gis.core import (
    COUNT,
    GEOMETRY,
    MERGED,
    SOURCE,
    SOURCE_ID,
    Displayed,
    InputError,
    ObjectIndex,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from semsig_gis.objects.table import StreetObjects

# A catalogue accepts the same: beyond that, two objects of a class are two objects.
RADIUS_LIMIT_M = 100.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ConflatedPair:
    """What was merged of one class between two sources.

    `count` objects of the source `merged` lay within `radius` metres of objects of `kept`, whose
    positions stay; `median_m` and `largest_m` are the distances between the two.
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
    """What was merged, for every class and pair of sources with something in common.

    Classes stand in the order in which their radii were given, sources in that of the objects.
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
    """Merge objects that stand in several sources.

    Source after source is compared with what remains of those before it. Of all pairs of a
    remaining and a new object within the radius, the nearest is merged first, and each object takes
    part once. Pairs of equal distance go by source, position and identifier, so that the order of
    the rows in a source does not matter.

    Parameters
    ----------
    objects : StreetObjects
        The objects; the column ``source`` tells the sources apart, and one whose rows begin
        earlier is trusted more. InputError if they were conflated before.
    radii : mapping of str to float
        Classes, and the metres (above 0, below 100) within which two objects of different sources
        are the same. Other classes are left as they are. UnknownNameError if there is no such
        class.

    Returns
    -------
    objects : StreetObjects
        The remaining objects in their order. An object that others were merged into keeps its
        source and position, its ``count`` is the sum of theirs, and its column ``merged`` lists
        them as ``"source:id; source:id"``. The licences of all sources still hold.
    report : ConflationReport
        How many were merged, a class and pair of sources.

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
    table = objects.table
    if MERGED in table.columns:
        raise InputError(
            "the objects are conflated already; conflate all sources at once, before saving."
        )
    codes = {name: objects.taxonomy.by_name(name).code for name in radii}
    for name, radius in radii.items():
        if not 0 < radius < RADIUS_LIMIT_M:
            raise InputError(
                f"class {name!r} has the radius {radius!r}; give metres above 0 and below 100."
            )
    view = _view(objects)
    matches = [
        _Match(name, kept, merged, metres)
        for name, radius in radii.items()
        for kept, merged, metres in _matches(
            view, np.flatnonzero(objects.codes == codes[name]), radius
        )
    ]
    return _merged(objects, view, matches), _report(view, matches, radii)


class _View(NamedTuple):
    """What decides about merging, an entry an object."""

    xy: NDArray[np.float64]
    source: NDArray[np.int64]  # number of the source, the first one 0
    names: list[str]  # of the sources
    rank: NDArray[np.int64]  # place in an order that does not depend on that of the rows


class _Match(NamedTuple):
    class_name: str
    kept: int  # row
    merged: int  # row
    metres: float


def _view(objects: StreetObjects) -> _View:
    table = objects.table
    source, names = pd.factorize(table[SOURCE])
    x, y = objects.xy.T
    keys = pd.DataFrame(
        {"source": source, "x": x, "y": y, "id": table[SOURCE_ID], "count": table[COUNT]}
    )
    rank = np.empty(len(keys), np.int64)
    rank[keys.sort_values(list(keys.columns)).index] = np.arange(len(keys))
    return _View(objects.xy, source, names.tolist(), rank)


def _matches(
    view: _View, members: NDArray[np.int64], radius: float
) -> Iterator[tuple[int, int, float]]:
    """Yield row kept, row merged and metres between them, for the objects of one class."""
    remaining = members[:0]
    for number in np.unique(view.source[members]):
        new = members[view.source[members] == number]
        pairs = _nearest_first(view, remaining, new, radius) if len(remaining) else []
        yield from pairs
        merged = [row for _, row, _ in pairs]
        remaining = np.concatenate([remaining, np.setdiff1d(new, merged)])


def _nearest_first(
    view: _View, old: NDArray[np.int64], new: NDArray[np.int64], radius: float
) -> list[tuple[int, int, float]]:
    """Pair old and new objects one to one, the nearest first."""
    new_at, old_at = ObjectIndex(view.xy[old]).pairs_within(view.xy[new], radius=radius)
    new_row, old_row = new[new_at], old[old_at]
    metres = np.hypot(*(view.xy[old_row] - view.xy[new_row]).T)
    order = np.lexsort((view.rank[new_row], view.rank[old_row], metres))
    taken: set[int] = set()
    pairs = []
    for left, right, distance in zip(
        old_row[order].tolist(), new_row[order].tolist(), metres[order].tolist(), strict=True
    ):
        if left not in taken and right not in taken:
            taken.update((left, right))
            pairs.append((left, right, distance))
    return pairs


def _merged(objects: StreetObjects, view: _View, matches: Sequence[_Match]) -> StreetObjects:
    """Return the objects that remain, with what was merged into them."""
    table = objects.table
    source, source_id = table[SOURCE].tolist(), table[SOURCE_ID].tolist()
    counts = table[COUNT].to_numpy(np.int64).copy()
    entries: dict[int, list[str]] = {}
    for match in sorted(matches, key=lambda match: view.rank[match.merged]):  # by source
        counts[match.kept] += counts[match.merged]
        entry = f"{source[match.merged]}:{source_id[match.merged]}"
        entries.setdefault(match.kept, []).append(entry)
    result = table.drop(columns=GEOMETRY)
    result[COUNT] = counts.astype(np.int32)
    result[MERGED] = ["; ".join(entries.get(row, [])) for row in range(len(table))]
    result = result.set_geometry(table.geometry)
    gone = [match.merged for match in matches]
    return replace(objects, table=result.drop(index=gone).reset_index(drop=True))


def _report(view: _View, matches: Sequence[_Match], radii: Mapping[str, float]) -> ConflationReport:
    classes = list(radii)
    metres_of: dict[tuple[int, int, int], list[float]] = {}
    for match in matches:
        sources = int(view.source[match.kept]), int(view.source[match.merged])
        metres_of.setdefault((classes.index(match.class_name), *sources), []).append(match.metres)
    return ConflationReport(
        tuple(
            ConflatedPair(
                class_name=classes[number],
                radius=float(radii[classes[number]]),
                kept=view.names[kept],
                merged=view.names[merged],
                count=len(metres),
                median_m=float(np.median(metres)),
                largest_m=max(metres),
            )
            for (number, kept, merged), metres in sorted(metres_of.items())
        )
    )
