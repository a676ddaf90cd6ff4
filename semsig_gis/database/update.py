"""Updating a signature database: only the cells that see a changed object are computed again."""

from __future__ import annotations

import shutil
from collections import Counter
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis import __version__
from semsig_gis.core import (
    MOST_METRES,
    ROW_SPAN,
    SOURCE,
    DatabaseError,
    Displayed,
    EmptyResultError,
    InputError,
    PackedIndex,
    cell_ids,
    cells_near,
    check_workers,
    percent,
    split_ids,
)
from semsig_gis.database.build import build_cells
from semsig_gis.database.city import open_city
from semsig_gis.database.database import ENTRY_ARRAYS, join_databases, require_same
from semsig_gis.database.file import (
    INPUTS,
    database_specs,
    open_database,
    part_files,
    part_name,
    read_manifest,
)
from semsig_gis.database.occlusion import TOUCHING_M, buildings_near
from semsig_gis.database.sightings import measure_sightings
from semsig_gis.database.store import save_with_store, stored_inputs
from semsig_gis.database.tile_inputs import folder_beside
from semsig_gis.database.tiles import (
    TileSpec,
    build_parts,
    plan_tiles,
    publish,
    save_tile,
    tile_cells,
)
from semsig_gis.objects import (
    compare_objects,
    licenses_of,
    open_objects,
    replace_layers,
    save_objects,
)
from semsig_gis.storage import read_json, write_json

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.database.file import Part
    from semsig_gis.database.store import ObjectStore
    from semsig_gis.database.tiles import Tile, TilePlan
    from semsig_gis.objects import ClassChange, ObjectChanges, StreetObjects

    _Cells = tuple[NDArray[np.int64], NDArray[np.int64]]  # columns and rows


@dataclass(frozen=True, repr=False, slots=True, kw_only=True)
class UpdateReport(Displayed):
    """How far a city has drifted.

    `replaced` layers were loaded anew, `kept` ones were not. Of the cells, `recomputed` ones lie
    within range of a change, seen or not; `changed` ones have another signature; `appeared` ones
    see something for the first time, and `vanished` ones nothing any more.
    """

    classes: tuple[ClassChange, ...]
    replaced: tuple[str, ...]
    kept: tuple[str, ...]
    cells_before: int
    cells: int
    recomputed: int
    changed: int
    appeared: int
    vanished: int
    notes: tuple[str, ...] = ()

    def _facts(self) -> dict[str, object]:
        return {
            "cells": self.cells,
            "before": self.cells_before,
            "changed": self.changed,
            "appeared": self.appeared,
            "vanished": self.vanished,
            "share": percent(self.share, 2),
        }

    @property
    def share(self) -> float:
        """Share of all cells, before or after, that are not what they were."""
        drifted = self.changed + self.appeared + self.vanished
        return drifted / (self.cells_before + self.appeared)

    def to_dict(self) -> dict[str, Any]:
        """Return the fields and ``share`` as plain values, ready for JSON."""
        return {**asdict(self), "share": self.share}


@dataclass(frozen=True, eq=False, kw_only=True)
class CellChanges:
    """Which cells of two databases of one city see what they saw.

    `same` and `changed`, shape (n, 2), are rows in the old and in the new database of cells whose
    signatures are equal, or differ in classes, bearings or distances. `vanished` and `appeared`,
    shape (n,), are the other rows of the old and of the new database.
    """

    same: NDArray[np.int64]
    changed: NDArray[np.int64]
    vanished: NDArray[np.int64]
    appeared: NDArray[np.int64]


def compare_cells(before: SignatureDatabase, after: SignatureDatabase) -> CellChanges:
    """Compare the cells of two databases of one city, those of each kind in their order.

    Raise DatabaseError if the databases were not made in the same way.
    """
    require_same(before, after, classes=False)
    _, first, second = np.intersect1d(
        before.cell_ids, after.cell_ids, assume_unique=True, return_indices=True
    )
    differs = before.lengths[first] != after.lengths[second]
    alike = np.flatnonzero(~differs)
    one, other = before.select(first[alike]), after.select(second[alike])
    entry_differs = np.zeros(len(one.codes), bool)
    for name in ENTRY_ARRAYS:
        entry_differs |= getattr(one, name) != getattr(other, name)
    differs[np.repeat(alike, one.lengths)[entry_differs]] = True
    common = np.stack([first, second], axis=1)
    return CellChanges(
        same=common[~differs],
        changed=common[differs],
        vanished=np.setdiff1d(np.arange(len(before)), first, assume_unique=True),
        appeared=np.setdiff1d(np.arange(len(after)), second, assume_unique=True),
    )


def update_file(
    path: str | Path,
    objects: StreetObjects,
    *,
    out: str | Path | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> UpdateReport:
    """Update the file of a database, and the object store beside it.

    Parameters
    ----------
    path : str or Path
        File of the database.
    objects : StreetObjects
        The layers that were loaded anew, whole.
    out : str or Path, optional
        Another file to write to; `path` itself by default.
    progress : callable, optional
        Called with the number of cells done and in all.

    Returns
    -------
    UpdateReport
        What changed.

    Raises
    ------
    DatabaseError, InputError, CrsError, EmptyResultError
        As `update_database` does, or if the files cannot be read or written; nothing has changed
        then.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis import ObjectStore
    >>> fewer = replace(demo_objects, table=demo_objects.table[1:])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = f"{folder}/city.parquet"
    ...     save_with_store(demo_database, ObjectStore.of(demo_objects), file)
    ...     report = update_file(file, fewer)
    >>> sum(item.removed for item in report.classes), 0 < report.share < 0.5
    (1, True)
    """
    city = open_city(path)
    database, store, report = update_database(city.database, city.store, objects, progress=progress)
    save_with_store(database, store, path if out is None else out)
    return report


def update_database(
    database: SignatureDatabase,
    store: ObjectStore,
    objects: StreetObjects,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[SignatureDatabase, ObjectStore, UpdateReport]:
    """Replace layers of a database, and compute again what the changes are seen from.

    Parameters
    ----------
    database, store : SignatureDatabase, ObjectStore
        The database, and what it was built from.
    objects : StreetObjects
        The layers that were loaded anew, whole; other layers stay as they are.
    progress : callable, optional
        Called with the number of cells done and in all.

    Returns
    -------
    database, store : SignatureDatabase, ObjectStore
        All objects as they are now, and what `build_database` would make of them.
    report : UpdateReport
        What changed.

    Raises
    ------
    InputError
        If the new objects use a class code for something else, or one of their classes is seen
        from further away than all classes before.
    CrsError
        If the new objects are in another CRS.
    DatabaseError
        If the store lacks the buildings or streets that the database was built with.
    EmptyResultError
        If no cell would see an object any more.

    Examples
    --------
    >>> from semsig_gis import ObjectStore
    >>> store = ObjectStore.of(demo_objects)
    >>> _, _, report = update_database(demo_database, store, demo_objects)
    >>> report.recomputed
    0
    """
    lacking = []
    if store.footprints is None and database.occlusion is not None:
        lacking.append("buildings")
    if store.streets is None and database.viewpoints.mode == "streets":
        lacking.append("streets")
    if lacking:
        raise DatabaseError(
            f"the object store lacks the {' and '.join(lacking)} that the database was built with; "
            "build the database again."
        )
    merged, kept, notes = replace_layers(store.objects, objects)
    along = store.streets if database.viewpoints.mode == "streets" else None
    licenses = (*map(str, merged.licenses), *licenses_of(store.footprints, along))
    new = replace(
        database,
        taxonomy=merged.taxonomy,
        licenses=licenses,
        version=__version__,
        notes=merged.notes,
    )
    if new.reach > database.reach:  # the unit in which all distances are stored
        furthest = max(new.taxonomy.classes, key=lambda item: item.range_m or 0.0)
        raise InputError(
            f"class {furthest.name!r} is seen from {new.reach:g} m, further than any class of the "
            f"database ({database.reach:g} m), which affects every cell; build the database again."
        )
    changes = compare_objects(store.objects, merged)
    places, codes = _changed_places(store.objects, merged, changes)
    cells = _cells_in_range(new, places, codes)
    after = replace(store, objects=merged)
    stale = np.isin(database.cell_ids, cell_ids(*cells))
    fresh = _recomputed(new, after, places, cells, progress=progress)
    updated = join_databases([new.select(~stale), fresh])
    if len(updated) == 0:
        raise EmptyResultError(
            f"no cell would see any of the {len(merged):,} objects; check the new objects."
        )
    layers = _layers(store.objects) | _layers(merged)
    drifted = compare_cells(database.select(stale), fresh)
    report = UpdateReport(
        classes=changes.classes,
        replaced=tuple(sorted(layers - set(kept))),
        kept=kept,
        cells_before=len(database),
        cells=len(updated),
        recomputed=len(cells[0]),
        changed=len(drifted.changed),
        appeared=len(drifted.appeared),
        vanished=len(drifted.vanished),
        notes=notes,
    )
    return updated, after, report


def update_tiles(
    path: str | Path,
    objects: str | Path,
    *,
    out: str | Path | None = None,
    workers: int = 0,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> UpdateReport:
    """Update a database in tiles: in each, the cells that a change is seen from.

    Parameters
    ----------
    path : str or Path
        Folder of the database.
    objects : str or Path
        The layers that were loaded anew, whole, as `save_objects` wrote them.
    out : str or Path, optional
        Another folder to write to; `path` itself by default.
    workers, scheduler : optional
        As in `build_tiles`.
    progress : callable, optional
        Called with the number of tiles done and in all.

    Returns
    -------
    UpdateReport
        What changed. The folder holds what `build_tiles` would make of the new objects, byte for
        byte.

    Raises
    ------
    InputError
        If the new objects use a class code for something else or are seen from another longest
        distance.
    CrsError
        If the new objects are in another CRS.
    DatabaseError, EmptyResultError
        As `build_tiles` does, or if the database holds no street objects; it is as it was then.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis import build_tiles, save_objects
    >>> fewer = replace(demo_objects, table=demo_objects.table[1:])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     old, new, town = f"{folder}/old.parquet", f"{folder}/new.parquet", f"{folder}/town"
    ...     save_objects(demo_objects, old)
    ...     save_objects(fewer, new)
    ...     tiles = build_tiles(old, town)
    ...     report = update_tiles(town, new)
    >>> sum(item.removed for item in report.classes), 0 < report.share < 0.5
    (1, True)
    """
    check_workers(workers, scheduler)
    folder, manifest = Path(path), read_manifest(path)
    files = dict(zip((part.tile for part in manifest.parts), part_files(path), strict=True))
    first = open_database(next(iter(files.values()))).select(slice(0))
    inputs = stored_inputs(folder)
    old, new = open_objects(inputs.pop("objects")), open_objects(objects)
    joined, kept, notes = replace_layers(old, new)
    now = joined if kept else new
    facts: dict[str, Any] = {
        "taxonomy": now.taxonomy,
        "licenses": (*map(str, now.licenses), *first.licenses[len(old.licenses) :]),
        "version": __version__,
        "notes": now.notes,
    }
    after = replace(first, **facts)
    if after.reach != first.reach:  # the unit in which all distances are stored
        raise InputError(
            f"the longest visibility range of {objects} is {after.reach:g} m and that of {path} "
            f"{first.reach:g} m, which affects every cell; build the database again."
        )
    changes = compare_objects(old, joined)
    places, codes = _changed_places(old, joined, changes)
    cells = _cells_in_range(replace(after, taxonomy=joined.taxonomy), places, codes)
    side = int(manifest.recipe["tile"]["cells"])
    numbers = np.unique(np.stack([cells[0] // side, cells[1] // side], axis=1), axis=0)
    stale: set[Tile] = {(column, row) for column, row in numbers.tolist()}
    target = Path(path if out is None else out)
    with folder_beside(target) as beside:
        source = Path(objects)
        if kept:
            source = beside / "objects.parquet"
            save_objects(joined, source)
        plan = plan_tiles(
            source,
            target,
            tile=TileSpec(min(max(side * first.grid.step, 1.0), MOST_METRES)),
            grid=first.grid,
            spec=first.spec,
            viewpoints=first.viewpoints,
            buildings=inputs.get("buildings"),
            streets=inputs.get("streets"),
            digests={name: manifest.recipe["inputs"][name] for name in inputs},
        )
        old_parts: dict[Tile, Part] = {}
        if database_specs(after) == database_specs(first) and not open_city(path).has_columns:
            old_parts = {part.tile: part for part in manifest.parts if part.tile not in stale}
        for tile, part in old_parts.items():
            shutil.copyfile(files[tile], plan.folder / part.file)
        old_tiles = _OldTiles(folder, plan.folder / INPUTS / "stale.npy", facts)
        np.save(old_tiles.stale, cell_ids(*cells))
        parts = build_parts(
            plan,
            source,
            work=partial(update_tile, plan, old_tiles),
            old_parts=old_parts,
            share=len(cells[0]) / manifest.cells,
            workers=workers,
            scheduler=scheduler,
            progress=progress,
            tell=None,
        )
        drift = _drift(plan, old_tiles, stale)
        old_tiles.stale.unlink()
        publish(plan.folder, parts)
    return UpdateReport(
        classes=changes.classes,
        replaced=tuple(sorted((_layers(old) | _layers(new)) - set(kept))),
        kept=kept,
        cells_before=manifest.cells,
        cells=sum(part.cells for part in parts),
        recomputed=len(cells[0]),
        changed=drift["changed"],
        appeared=drift["appeared"],
        vanished=drift["vanished"],
        notes=notes,
    )


@dataclass(frozen=True, slots=True)
class _OldTiles:
    """The tiles that an update begins with.

    `stale` is the file of the numbers of the cells that a change is seen from, in their order, and
    `facts` are what is said of the whole database from now on.
    """

    folder: Path
    stale: Path
    facts: dict[str, Any]

    def database(self, tile: Tile) -> SignatureDatabase | None:
        """Return the cells of a tile, None if it had none."""
        path = self.folder / part_name(tile)
        return open_database(path) if path.exists() else None

    def stale_in(self, tile: Tile, side: int) -> NDArray[np.int64]:
        """Return the numbers of the cells of a tile that a change is seen from."""
        ids = np.load(self.stale, mmap_mode="r")
        ends = cell_ids(np.array([tile[0], tile[0] + 1]) * side, np.full(2, -ROW_SPAN // 2))
        first, last = np.searchsorted(ids, ends)
        inside: NDArray[np.int64] = np.array(ids[first:last])
        rows = split_ids(inside)[1]
        mine: NDArray[np.int64] = inside[rows // side == tile[1]]
        return mine


def update_tile(plan: TilePlan, old: _OldTiles, tile: Tile) -> Part | None:
    """Build the part of a tile from that of before and the cells that a change is seen from."""
    stale, before = old.stale_in(tile, plan.side), old.database(tile)
    fresh = tile_cells(plan, tile, only=stale) if len(stale) else None
    parts = [] if fresh is None else [fresh]
    was = None
    if before is not None:
        changes = np.isin(before.cell_ids, stale)
        was = before.select(changes)
        parts.append(replace(before.select(~changes), **old.facts))
    if len(stale):
        write_json(_drift_path(plan, tile), _cell_drift(was, fresh))
    joined = replace(join_databases(parts), **old.facts) if parts else None
    return save_tile(plan, tile, joined)


def _drift_path(plan: TilePlan, tile: Tile) -> Path:
    return (plan.folder / part_name(tile)).with_suffix(".drift")


def _cell_drift(
    before: SignatureDatabase | None, after: SignatureDatabase | None
) -> dict[str, int]:
    """Count the cells that changed, appeared and vanished."""
    if before is None or after is None:
        return {
            "appeared": 0 if after is None else len(after),
            "vanished": 0 if before is None else len(before),
        }
    cells = compare_cells(before, after)
    return {
        "changed": len(cells.changed),
        "appeared": len(cells.appeared),
        "vanished": len(cells.vanished),
    }


def _drift(plan: TilePlan, old: _OldTiles, stale: set[Tile]) -> Counter[str]:
    """Count the cells that changed, appeared and vanished in all tiles.

    Those that an interrupted build has left, and those without any object now, are compared here.
    """
    drift: Counter[str] = Counter()
    for tile in stale:
        noted, part = _drift_path(plan, tile), plan.folder / part_name(tile)
        if noted.exists():
            drift.update(read_json(noted))
        else:
            now = open_database(part) if part.exists() else None
            drift.update(_cell_drift(old.database(tile), now))
    return drift


def _layers(objects: StreetObjects) -> set[str]:
    return set(objects.table[SOURCE].unique())


def _changed_places(
    old: StreetObjects, new: StreetObjects, changes: ObjectChanges
) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """Return where an object is gone or has come, shape (c, 2) in metres, and its class codes."""
    places = np.concatenate([old.xy[changes.obsolete_rows], new.xy[changes.new_rows]])
    return places, np.concatenate([old.codes[changes.obsolete_rows], new.codes[changes.new_rows]])


def _cells_in_range(
    database: SignatureDatabase, places: NDArray[np.float64], codes: NDArray[np.uint8]
) -> _Cells:
    """Return the cells that objects of some classes at some places may be seen from."""
    if len(places) == 0:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    ranges = database.taxonomy.ranges(database.spec.radius)[codes]
    reach = float(ranges.max())
    columns, rows = cells_near(places, grid=database.grid, radius=reach)
    viewpoints = database.grid.viewpoints(columns, rows)
    pairs = PackedIndex(places).pairs_within(viewpoints, radius=reach)
    near = np.unique(measure_sightings(*pairs, viewpoints, places, ranges=ranges).viewpoint)
    return columns[near], rows[near]


def _recomputed(
    database: SignatureDatabase,
    store: ObjectStore,
    places: NDArray[np.float64],
    cells: _Cells,
    *,
    progress: Callable[[int, int], None] | None,
) -> SignatureDatabase:
    """Return some cells around some places as they are now."""
    # A viewpoint is at most the reach from a place, and all it looks at as far from it again.
    around = 2.0 * database.reach + TOUCHING_M
    near = np.unique(store.index.pairs_within(places, radius=around)[1])
    if len(near) == 0:
        return database.select(slice(0))
    footprints = store.footprints
    if footprints is not None:
        polygons = footprints.geometry.to_numpy()
        footprints = footprints.iloc[buildings_near(polygons, places, distance=around)]
    return build_cells(
        replace(store.objects, table=store.objects.table.iloc[near]),
        *cells,
        grid=database.grid,
        spec=database.spec,
        viewpoints=database.viewpoints,
        footprints=footprints,
        streets=store.streets,
        partial=True,
        progress=progress,
    )
