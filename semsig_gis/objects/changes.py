"""Compare two tables of street objects of a city, and replace layers of one by the other."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated

import numpy as np
import pandas as pd

from semsig_gis.core import (
    CLASS_CODE,
    MERGED,
    MOST_METRES,
    SOURCE,
    SOURCE_ID,
    CatalogError,
    CrsError,
    InputError,
    number,
)
from semsig_gis.objects.table import (
    Licence,
    StreetObjects,
    join_licences,
    joined_tables,
    layer_note,
)

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from semsig_gis.core import ObjectClass, Taxonomy

IDENTIFIER = [SOURCE, SOURCE_ID]
CLASS_AND_PLACE = [CLASS_CODE, "x", "y"]
_Count = Annotated[int, number("a whole number, 0 or more", 0, whole=True)]


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassChange:
    """Changes of one class; ``after = before + added - removed + gained - lost``.

    `added` and `removed` objects are only in one table; `gained` objects had another class before,
    `lost` objects have another class now. `moved_m` is the median distance in metres, None if none
    moved.
    """

    class_name: str
    before: _Count
    after: _Count = 0
    added: _Count = 0
    removed: _Count = 0
    moved: _Count = 0
    moved_m: (
        Annotated[float, number(f"metres from 0 to {MOST_METRES:,}", 0, MOST_METRES)] | None
    ) = None
    gained: _Count = 0
    lost: _Count = 0


@dataclass(frozen=True, eq=False, kw_only=True)
class ObjectChanges:
    """Rows of two tables of street objects that are the same object.

    `same` (class and place), `moved` (same source, id and class) and `changed` (same source and id,
    other class) are pairs of rows of the old and the new table, shape (n, 2). `removed` and
    `added`, shape (n,), are the other rows. `altered` are the pairs of `same` that have another
    height, or belong to other things. `classes` are the changes by class.
    """

    same: NDArray[np.int64]
    moved: NDArray[np.int64]
    changed: NDArray[np.int64]
    removed: NDArray[np.int64]
    added: NDArray[np.int64]
    altered: NDArray[np.int64]
    classes: tuple[ClassChange, ...]

    @property
    def obsolete_rows(self) -> NDArray[np.int64]:
        """Rows of the old table that were removed, moved, altered or reclassified, shape (g,)."""
        pairs = (self.moved, self.changed, self.altered)
        return np.concatenate([self.removed, *(rows[:, 0] for rows in pairs)])

    @property
    def new_rows(self) -> NDArray[np.int64]:
        """Rows of the new table that were added, moved, altered or reclassified, shape (n,)."""
        pairs = (self.moved, self.changed, self.altered)
        return np.concatenate([self.added, *(rows[:, 1] for rows in pairs)])


def compare_objects(old: StreetObjects, new: StreetObjects) -> ObjectChanges:
    """Return which objects were added, removed, moved, or have another class now.

    Both tables have the same CRS and class codes. Objects of the same class at exactly the same
    place are the same object, whatever their ids, because some portals renumber rows at each
    export. The remaining objects are matched by source and id, if the id is unique in both tables.
    """
    tables = _keys(old), _keys(new)
    same = _pairs_at_same_place(*tables)
    remaining = [_without(table, same[:, side]) for side, table in enumerate(tables)]
    candidates = [_unique_ids(*pair) for pair in zip(remaining, tables, strict=True)]
    linked = _equal_rows(*candidates)
    equal_class = old.codes[linked[:, 0]] == new.codes[linked[:, 1]]
    same_class, other_class = linked[equal_class], linked[~equal_class]
    removed, added = (
        _without(table, linked[:, side]).index.to_numpy() for side, table in enumerate(remaining)
    )
    changes = ObjectChanges(
        same=same,
        moved=same_class,
        changed=other_class,
        removed=removed,
        added=added,
        altered=same[_is_altered(old, new, same)],
        classes=(),
    )
    return replace(changes, classes=tuple(_by_class(old, new, changes)))


def _is_altered(
    old: StreetObjects, new: StreetObjects, same: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Return which pairs of rows have another height, or belong to other extended things."""
    altered = np.zeros(len(same), bool)
    sides = list(zip((old, new), same.T, strict=True))
    if old.heights is not None or new.heights is not None:
        first, second = (
            np.full(len(rows), np.nan) if item.heights is None else item.heights[rows]
            for item, rows in sides
        )
        altered |= (first != second) & ~(np.isnan(first) & np.isnan(second))
    if old.groups is not None or new.groups is not None:
        # Equal things have equal numbers if the first of their points numbers them.
        numbers = []
        for item, rows in sides:
            groups = np.full(len(rows), -1) if item.groups is None else item.groups[rows]
            _, first_row, thing = np.unique(groups, return_index=True, return_inverse=True)
            numbers.append(np.where(groups < 0, -1, first_row[thing]))
        changed = numbers[0] != numbers[1]
        for number in numbers:
            altered |= np.isin(number, number[changed & (number >= 0)])
        altered |= changed
    return altered


def _keys(objects: StreetObjects) -> pd.DataFrame:
    """Return source, id, class and coordinates of objects, with the row number as index."""
    keys = pd.DataFrame(objects.table[IDENTIFIER]).reset_index(drop=True)
    keys[CLASS_CODE] = objects.codes
    keys[["x", "y"]] = objects.xy
    return keys


def _pairs_at_same_place(old: pd.DataFrame, new: pd.DataFrame) -> NDArray[np.int64]:
    """Return pairs of rows with the same class and place; if several have, first by equal id."""
    pairs = _pairs_with_unique_x(old, new)
    rest = [_without(table, pairs[:, side]) for side, table in enumerate((old, new))]
    # Where several objects share class and place, pair those of the same id first.
    shared_x = pd.concat([table.loc[table.duplicated(CLASS_AND_PLACE), "x"] for table in rest])
    by_id = _equal_rows(*(table[table["x"].isin(shared_x)] for table in rest))
    others = _equal_rows(
        *(_without(t, by_id[:, side])[CLASS_AND_PLACE] for side, t in enumerate(rest))
    )
    return np.concatenate([pairs, by_id, others])


def _pairs_with_unique_x(old: pd.DataFrame, new: pd.DataFrame) -> NDArray[np.int64]:
    """Return pairs of equal class and place with an x coordinate unique in both tables.

    Nearly all pairs are found in this way, which is much faster than the general one.
    """
    unique = []
    for table in (old, new):
        x, row, count = np.unique(table["x"], return_index=True, return_counts=True)
        unique.append((x[count == 1], row[count == 1]))
    (old_x, old_row), (new_x, new_row) = unique
    _, old_at, new_at = np.intersect1d(old_x, new_x, assume_unique=True, return_indices=True)
    pairs: NDArray[np.int64] = np.stack([old_row[old_at], new_row[new_at]], axis=1)
    old_keys, new_keys = (
        table[CLASS_AND_PLACE].to_numpy(float)[pairs[:, side]]
        for side, table in enumerate((old, new))
    )
    equal: NDArray[np.bool_] = (old_keys == new_keys).all(axis=1)
    return pairs[equal]


def _unique_ids(rows: pd.DataFrame, table: pd.DataFrame) -> pd.DataFrame:
    """Return source and id of those rows that no other row of the table has the id of."""
    has_id = table[SOURCE_ID].isin(rows[SOURCE_ID]) & table[SOURCE_ID].ne("")
    ids = table.loc[has_id, IDENTIFIER]
    unique = ids[~ids.duplicated(keep=False)]
    return unique[unique.index.isin(rows.index)]


def _without(table: pd.DataFrame, rows: NDArray[np.int64]) -> pd.DataFrame:
    return table[~table.index.isin(rows)]


def _equal_rows(old: pd.DataFrame, new: pd.DataFrame) -> NDArray[np.int64]:
    """Return pairs of index labels of equal rows; each row is used once, in order."""
    both = pd.concat([old, new], ignore_index=True)
    group = both.groupby(list(both.columns), sort=False).ngroup()
    # Number equal rows within each table, and pair those of the same group and number.
    old_keys, new_keys = (
        groups.to_numpy(np.int64) * (len(both) + 1) + groups.groupby(groups).cumcount().to_numpy()
        for groups in (group[: len(old)], group[len(old) :])
    )
    _, old_at, new_at = np.intersect1d(old_keys, new_keys, assume_unique=True, return_indices=True)
    return np.stack([old.index.to_numpy()[old_at], new.index.to_numpy()[new_at]], axis=1)


def _by_class(
    old: StreetObjects, new: StreetObjects, changes: ObjectChanges
) -> Iterable[ClassChange]:
    """Yield the changes of every class that occurs in one of the tables."""
    counts_of = {
        name: np.bincount(codes, minlength=256)
        for name, codes in {
            "before": old.codes,
            "after": new.codes,
            "added": new.codes[changes.added],
            "removed": old.codes[changes.removed],
            "gained": new.codes[changes.changed[:, 1]],
            "lost": old.codes[changes.changed[:, 0]],
        }.items()
    }
    moved_codes = new.codes[changes.moved[:, 1]]
    metres = np.hypot(*(new.xy[changes.moved[:, 1]] - old.xy[changes.moved[:, 0]]).T)
    for item in new.taxonomy.classes:
        numbers = {name: int(counts[item.code]) for name, counts in counts_of.items()}
        if numbers["before"] or numbers["after"]:
            distances = metres[moved_codes == item.code]
            yield ClassChange(
                class_name=item.name,
                moved=len(distances),
                moved_m=float(np.median(distances)) if len(distances) else None,
                **numbers,
            )


def replace_layers(
    old: StreetObjects, new: StreetObjects
) -> tuple[StreetObjects, tuple[str, ...], tuple[str, ...]]:
    """Return the new objects and, before them, the old objects of layers that were not reloaded.

    Also return the names of the layers that were not reloaded, and notes for the user. A layer was
    reloaded if a new object is from it or a new licence is for it; it may be empty now. CrsError
    for a different CRS, InputError for classes that do not match.
    """
    if new.crs != old.crs:
        crs = old.crs.to_string()
        raise CrsError(
            f"the new objects are in {new.crs.to_string()} and those of the database in {crs}; "
            f"load the new ones with --metric-crs {crs}."
        )
    taxonomy = joined_taxonomy(old.taxonomy, new.taxonomy)
    reloaded = set(new.table[SOURCE].unique()).union(*(licence.layers for licence in new.licenses))
    remains = ~old.table[SOURCE].isin(reloaded).to_numpy()
    if not remains.any():
        return replace(new, taxonomy=taxonomy), (), ()
    remaining = old.table[remains]
    old_licences = (
        Licence(licence.terms, tuple(name for name in licence.layers if name not in reloaded))
        for licence in old.licenses
        if not licence.layers or not reloaded.issuperset(licence.layers)
    )
    licenses = join_licences([*old_licences, *new.licenses])
    prefixes = tuple(layer_note(name, "") for name in reloaded)
    warnings = (note for note in old.notes if not note.startswith(prefixes))
    objects = StreetObjects(
        joined_tables(remaining, new.table),
        taxonomy,
        licenses,
        tuple(dict.fromkeys([*warnings, *new.notes])),
    )
    notes = [*_possible_duplicates(objects, len(remaining), reloaded)]
    notes += [
        f"the new objects do not say which layers the licence {licence.terms!r} is for, so a layer "
        "that is empty now keeps its old objects; load the new objects again"
        for licence in new.licenses
        if not licence.layers  # as in files of earlier versions
    ]
    return objects, tuple(sorted(remaining[SOURCE].unique())), tuple(notes)


def joined_taxonomy(old: Taxonomy, new: Taxonomy) -> Taxonomy:
    """Return the classes of both taxonomies, with the titles of the new one.

    InputError if a code or symbol has different classes, or a class has different ranges.
    """
    new_classes = {item.code: item for item in new.classes}
    for item in old.classes:
        other = new_classes.get(item.code)
        if other is not None and other != item:
            raise InputError(
                f"class code {item.code} means {_brief(item)} before and {_brief(other)} after; "
                "load both with the same catalogue, or build the database again."
            )
    codes = {item.code for item in old.classes}
    if codes <= set(new_classes):
        return new
    try:
        return old.extended(item for item in new.classes if item.code not in codes)
    except CatalogError as error:
        raise InputError(
            f"the new classes do not match the old ones ({str(error)[:-1]}); load both with the "
            "same catalogue, or build the database again."
        ) from error


def _brief(item: ObjectClass) -> str:
    reach = "" if item.range_m is None else f", seen from {item.range_m:g} m"
    return f"{item.name!r} (symbol {item.symbol}{reach})"


def _possible_duplicates(
    objects: StreetObjects, old_count: int, reloaded: set[str]
) -> Iterable[str]:
    """Yield notes on objects that may be listed twice; the first `old_count` are old ones."""
    table = objects.table
    if MERGED in table:
        merged: Counter[str] = Counter()
        for text in table[MERGED][:old_count]:
            merged.update({part.partition(":")[0] for part in text.split("; ")} & reloaded)
        for name, number in sorted(merged.items()):
            yield (
                f"{number:,} objects of layers that were not loaded again were merged with objects "
                f"of {name!r}, which may be there twice now; load merged layers together"
            )
    keys = _keys(objects)[CLASS_AND_PLACE]
    duplicates = keys[old_count:].merge(keys[:old_count].drop_duplicates(), on=CLASS_AND_PLACE)
    if len(duplicates):
        yield (
            f"{len(duplicates):,} new objects are at exactly the place of an object in a layer "
            "that was not loaded again; load overlapping layers together"
        )
