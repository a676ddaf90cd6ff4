"""What changed in the street objects of a city: two tables of them, compared and joined."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from semsig_gis.core import (
    CLASS_CODE,
    MERGED,
    SOURCE,
    SOURCE_ID,
    CatalogError,
    CrsError,
    InputError,
)
from semsig_gis.objects.table import Licence, StreetObjects, join_licences, layer_note

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from semsig_gis.core import ObjectClass, Taxonomy

NAME = [SOURCE, SOURCE_ID]
LOOKS = [CLASS_CODE, "x", "y"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassChange:
    """What changed in one class; ``after = before + added - removed + gained - lost``.

    `added` and `removed` objects are nowhere in the other table; `gained` were of another class
    before, `lost` are now. `moved_m` is the median distance in metres, None where none moved.
    """

    class_name: str
    before: int
    after: int
    added: int
    removed: int
    moved: int
    moved_m: float | None
    gained: int
    lost: int


@dataclass(frozen=True, eq=False, kw_only=True)
class ObjectChanges:
    """Which rows of two tables of street objects are the same object.

    `same` (class and place), `moved` (same source, id and class) and `changed` (same source and id,
    other class) have shape (n, 2): rows of the old and of the new table. `removed` and `added`,
    shape (n,), are the others. `classes` has the classes that are in one of the tables.
    """

    same: NDArray[np.int64]
    moved: NDArray[np.int64]
    changed: NDArray[np.int64]
    removed: NDArray[np.int64]
    added: NDArray[np.int64]
    classes: tuple[ClassChange, ...]

    @property
    def gone(self) -> NDArray[np.int64]:
        """Rows of the old table at whose place no such object stands any more, shape (g,)."""
        return np.concatenate([self.removed, self.moved[:, 0], self.changed[:, 0]])

    @property
    def come(self) -> NDArray[np.int64]:
        """Rows of the new table at whose place no such object stood before, shape (n,)."""
        return np.concatenate([self.added, self.moved[:, 1], self.changed[:, 1]])


def compare_objects(old: StreetObjects, new: StreetObjects) -> ObjectChanges:
    """Tell what was added, removed, moved, or is of another class now.

    Both tables are in the same CRS and use the same class codes. An object of the same class at
    exactly the same place is the same object, whatever its id, because some portals number rows
    anew at each export. What is left is matched by source and id, where an id stands once in either
    table.
    """
    tables = _keys(old), _keys(new)
    same = _twins(*tables)
    left = [_without(table, same[:, side]) for side, table in enumerate(tables)]
    candidates = [_with_own_id(*pair) for pair in zip(left, tables, strict=True)]
    linked = _pairs(*candidates)
    equal = old.codes[linked[:, 0]] == new.codes[linked[:, 1]]
    moved, changed = linked[equal], linked[~equal]
    removed, added = (
        _without(table, linked[:, side]).index.to_numpy() for side, table in enumerate(left)
    )
    changes = ObjectChanges(
        same=same, moved=moved, changed=changed, removed=removed, added=added, classes=()
    )
    return replace(changes, classes=tuple(_by_class(old, new, changes)))


def _keys(objects: StreetObjects) -> pd.DataFrame:
    """Return what objects are told apart by, numbered by row."""
    keys = pd.DataFrame(objects.table[NAME]).reset_index(drop=True)
    keys[CLASS_CODE] = objects.codes
    keys[["x", "y"]] = objects.xy
    return keys


def _twins(old: pd.DataFrame, new: pd.DataFrame) -> NDArray[np.int64]:
    """Return pairs of rows of one class at one place; of several there, those of one id first."""
    alone = _lone_twins(old, new)
    rest = [_without(table, alone[:, side]) for side, table in enumerate((old, new))]
    crowds = pd.concat([table.loc[table.duplicated(LOOKS), "x"] for table in rest])
    named = _pairs(*(table[table["x"].isin(crowds)] for table in rest))
    others = _pairs(*(_without(t, named[:, side])[LOOKS] for side, t in enumerate(rest)))
    return np.concatenate([alone, named, others])


def _lone_twins(old: pd.DataFrame, new: pd.DataFrame) -> NDArray[np.int64]:
    """Return those pairs that nothing else has the x coordinate of: nearly all, and quickly."""
    lone = []
    for table in (old, new):
        x, row, count = np.unique(table["x"], return_index=True, return_counts=True)
        lone.append((x[count == 1], row[count == 1]))
    (x, row), (other_x, other_row) = lone
    _, one, other = np.intersect1d(x, other_x, assume_unique=True, return_indices=True)
    pairs: NDArray[np.int64] = np.stack([row[one], other_row[other]], axis=1)
    looks = [table[LOOKS].to_numpy(float)[pairs[:, side]] for side, table in enumerate((old, new))]
    equal: NDArray[np.bool_] = (looks[0] == looks[1]).all(axis=1)
    return pairs[equal]


def _with_own_id(rows: pd.DataFrame, table: pd.DataFrame) -> pd.DataFrame:
    """Return source and id of the rows whose id no other row of the table has."""
    alike = table.loc[table[SOURCE_ID].isin(rows[SOURCE_ID]) & table[SOURCE_ID].ne(""), NAME]
    single = alike[~alike.duplicated(keep=False)]
    return single[single.index.isin(rows.index)]


def _without(table: pd.DataFrame, rows: NDArray[np.int64]) -> pd.DataFrame:
    return table[~table.index.isin(rows)]


def _pairs(old: pd.DataFrame, new: pd.DataFrame) -> NDArray[np.int64]:
    """Return the index labels of equal rows, each row once, first with first."""
    both = pd.concat([old, new], ignore_index=True)
    group = both.groupby(list(both.columns), sort=False).ngroup()
    first, second = (
        part.to_numpy(np.int64) * (len(both) + 1) + part.groupby(part).cumcount().to_numpy()
        for part in (group[: len(old)], group[len(old) :])
    )
    _, row, other = np.intersect1d(first, second, assume_unique=True, return_indices=True)
    return np.stack([old.index.to_numpy()[row], new.index.to_numpy()[other]], axis=1)


def _by_class(
    old: StreetObjects, new: StreetObjects, changes: ObjectChanges
) -> Iterable[ClassChange]:
    """Yield the numbers of every class that one of the tables has."""
    numbers = {
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
        own = {name: int(counts[item.code]) for name, counts in numbers.items()}
        if own["before"] or own["after"]:
            far = metres[moved_codes == item.code]
            yield ClassChange(
                class_name=item.name,
                moved=len(far),
                moved_m=float(np.median(far)) if len(far) else None,
                **own,
            )


def replace_layers(
    old: StreetObjects, new: StreetObjects
) -> tuple[StreetObjects, tuple[str, ...], tuple[str, ...]]:
    """Return the objects of layers that were not loaded anew, then the new ones.

    With them come the names of the layers that stay, and notes for the user. A layer was loaded
    anew if a new object comes from it or a new licence is about it: it may be empty now. CrsError
    for a different CRS, InputError for classes that do not fit.
    """
    if new.crs != old.crs:
        own = old.crs.to_string()
        raise CrsError(
            f"the new objects are in {new.crs.to_string()} and those of the database in {own}; "
            f"load the new ones with --metric-crs {own}."
        )
    taxonomy = joined_taxonomy(old.taxonomy, new.taxonomy)
    renewed = set(new.table[SOURCE].unique()).union(*(licence.layers for licence in new.licenses))
    stays = ~old.table[SOURCE].isin(renewed).to_numpy()
    if not stays.any():
        return replace(new, taxonomy=taxonomy), (), ()
    remaining = old.table[stays]
    table = pd.concat([remaining, new.table], ignore_index=True)
    if MERGED in table:
        table[MERGED] = table[MERGED].fillna("")
    staying = (
        Licence(licence.terms, tuple(name for name in licence.layers if name not in renewed))
        for licence in old.licenses
        if not licence.layers or not renewed.issuperset(licence.layers)
    )
    licenses = join_licences([*staying, *new.licenses])
    about_renewed = tuple(layer_note(name, "") for name in renewed)
    warnings = (note for note in old.notes if not note.startswith(about_renewed))
    objects = StreetObjects(
        table.astype({CLASS_CODE: np.uint8}),
        taxonomy,
        licenses,
        tuple(dict.fromkeys([*warnings, *new.notes])),
    )
    kept = tuple(sorted(remaining[SOURCE].unique()))
    notes = [*_doubts(objects, len(remaining), renewed)]
    notes += [
        f"the new objects do not say which layers the licence {licence.terms!r} is for, so a layer "
        "that is empty now keeps its old objects; load the new objects again"
        for licence in new.licenses
        if not licence.layers  # as in files of earlier versions
    ]
    return objects, kept, tuple(notes)


def joined_taxonomy(old: Taxonomy, new: Taxonomy) -> Taxonomy:
    """Return all classes of two dates of one city, with the titles of the new ones.

    InputError if a code or symbol means different classes, or a class is seen from another
    distance.
    """
    theirs = {item.code: item for item in new.classes}
    for item in old.classes:
        other = theirs.get(item.code)
        if other is not None and replace(other, title=item.title) != item:
            raise InputError(
                f"class code {item.code} means {_brief(item)} before and {_brief(other)} after; "
                "load both with the same catalogue, or build the database again."
            )
    codes = {item.code for item in old.classes}
    if codes <= set(theirs):
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


def _doubts(objects: StreetObjects, kept: int, renewed: set[str]) -> Iterable[str]:
    """Yield what may be twice, because the layers that stay were not loaded with the new ones."""
    table = objects.table
    if MERGED in table:
        merged: Counter[str] = Counter()
        for text in table[MERGED][:kept]:
            merged.update({part.partition(":")[0] for part in text.split("; ")} & renewed)
        for name, number in sorted(merged.items()):
            yield (
                f"{number:,} objects of layers that were not loaded again were merged with objects "
                f"of {name!r}, which may be there twice now; load merged layers together"
            )
    keys = _keys(objects)[LOOKS]
    twice = keys[kept:].merge(keys[:kept].drop_duplicates(), on=LOOKS)
    if len(twice):
        yield (
            f"{len(twice):,} new objects are at exactly the place of an object in a layer that was "
            "not loaded again; load overlapping layers together"
        )
