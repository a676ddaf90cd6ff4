"""Update a signature database: recompute only the cells in range of a changed object."""

from __future__ import annotations

import os
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
    place_locked,
    split_ids,
)
from semsig_gis.database.cells import build_cells, cell_reach
from semsig_gis.database.city import open_city
from semsig_gis.database.database import (
    ENTRY_ARRAYS,
    entry_values,
    join_databases,
    require_same,
)
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
from semsig_gis.database.store import lacking_ground, save_with_store, stored_inputs
from semsig_gis.database.tile_inputs import working_folder
from semsig_gis.database.tiles import (
    TileSpec,
    build_parts,
    plan_tiles,
    publish_tiles,
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
    from collections.abc import Callable, Mapping

    import geopandas as gpd
    from numpy.typing import NDArray

    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.database.file import PartFile
    from semsig_gis.database.store import ObjectStore
    from semsig_gis.database.tiles import Tile, TilePlan
    from semsig_gis.objects import ClassChange, StreetObjects


MOST_PAIRS = 1 << 24  # of cells and changed objects at a time


@dataclass(frozen=True, repr=False, slots=True, kw_only=True)
class UpdateReport(Displayed):
    """Counts of the changes by an update.

    `replaced` and `kept` are the names of the layers that were loaded again and of the others.
    `recomputed` counts the cells in range of a changed object, visible or not. `changed` cells have
    another signature, `appeared` cells had no visible object before, and `vanished` cells have none
    now.
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
        """Share of cells that changed, appeared or vanished, of all cells in either database."""
        drifted = self.changed + self.appeared + self.vanished
        return drifted / (self.cells_before + self.appeared)

    def to_dict(self) -> dict[str, Any]:
        """Return the fields and ``share`` as plain values, ready for JSON."""
        return {**asdict(self), "share": self.share}


@dataclass(frozen=True, eq=False, kw_only=True)
class CellChanges:
    """Cells of two databases of one city with equal and with different signatures.

    `same` and `changed`, shape (n, 2), are pairs of rows in the old and in the new database; the
    changed ones differ in classes, bearings or distances. `vanished` and `appeared`, shape (n,),
    are the other rows of the old and of the new database.
    """

    same: NDArray[np.int64]
    changed: NDArray[np.int64]
    vanished: NDArray[np.int64]
    appeared: NDArray[np.int64]


def compare_cells(before: SignatureDatabase, after: SignatureDatabase) -> CellChanges:
    """Compare the cells of two databases of one city; each group of rows is ascending.

    Raise DatabaseError if the databases were not built in the same way.
    """
    require_same(before, after, classes=False)
    _, old_rows, new_rows = np.intersect1d(
        before.cell_ids, after.cell_ids, assume_unique=True, return_indices=True
    )
    differs = before.lengths[old_rows] != after.lengths[new_rows]
    # Only signatures of equal length can be compared entry by entry.
    comparable = np.flatnonzero(~differs)
    old, new = before.select(old_rows[comparable]), after.select(new_rows[comparable])
    entry_differs = np.zeros(len(old.codes), bool)
    for name in ENTRY_ARRAYS:
        entry_differs |= entry_values(old, name) != entry_values(new, name)
    differs[np.repeat(comparable, old.lengths)[entry_differs]] = True
    common = np.stack([old_rows, new_rows], axis=1)
    return CellChanges(
        same=common[~differs],
        changed=common[differs],
        vanished=np.setdiff1d(np.arange(len(before)), old_rows, assume_unique=True),
        appeared=np.setdiff1d(np.arange(len(after)), new_rows, assume_unique=True),
    )


def update_file(
    path: str | Path,
    objects: StreetObjects,
    *,
    out: str | Path | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> UpdateReport:
    """Update the file of a database and its object store.

    Parameters
    ----------
    path : str or Path
        File of the database.
    objects : StreetObjects
        The layers to replace, complete.
    out : str or Path, optional
        Another file to write; `path` by default.
    progress : callable, optional
        Called with the number of finished cells and of all cells.

    Returns
    -------
    UpdateReport
        What changed.

    Raises
    ------
    DatabaseError, InputError, CrsError, EmptyResultError
        As in `update_database`, or if the files cannot be read or written; then nothing is
        changed.

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
    target = path if out is None else out
    with place_locked(Path(os.path.realpath(target))):
        city = open_city(path)
        updated = update_database(city.database, city.store, objects, progress=progress)
        database, store, report = updated
        save_with_store(database, store, target)
    return report


def update_database(
    database: SignatureDatabase,
    store: ObjectStore,
    objects: StreetObjects,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[SignatureDatabase, ObjectStore, UpdateReport]:
    """Replace layers of a database, and recompute the cells in range of a change.

    Parameters
    ----------
    database, store : SignatureDatabase, ObjectStore
        The database and its object store.
    objects : StreetObjects
        The layers to replace, complete; other layers are kept.
    progress : callable, optional
        Called with the number of finished cells and of all cells.

    Returns
    -------
    database, store : SignatureDatabase, ObjectStore
        The database that `build_database` would make of all objects, and its object store.
    report : UpdateReport
        What changed.

    Raises
    ------
    InputError
        If the new objects use a class code for another class, or one of their classes has a
        larger visibility range than all classes of the database.
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
    lacking = lacking_ground(
        houses=store.footprints is not None or database.occlusion is None,
        lines=store.streets is not None or database.viewpoints.mode != "streets",
    )
    if lacking:
        raise DatabaseError(f"the object store {lacking}")
    merged, other_layers, notes = replace_layers(store.objects, objects)
    streets = store.streets if database.viewpoints.mode == "streets" else None
    new = replace(
        database,
        taxonomy=merged.taxonomy,
        licenses=(*map(str, merged.licenses), *licenses_of(_hiding(database, store), streets)),
        version=__version__,
        notes=merged.notes,
    )
    if new.reach > database.reach:  # the unit of all stored distances
        furthest = max(new.taxonomy.classes, key=lambda item: item.range_m or 0.0)
        raise InputError(
            f"class {furthest.name!r} is seen from {new.reach:g} m, further than any class of the "
            f"database ({database.reach:g} m), which affects every cell; build the database again."
        )
    change = _find_change(new, store.objects, merged, other_layers=other_layers, notes=notes)
    _require_same_scale(database, new)
    after = replace(store, objects=merged)
    stale = np.isin(database.cell_ids, change.cell_ids)
    recomputed = _recompute(new, after, change, progress=progress)
    updated = join_databases([new.select(~stale), recomputed])
    if len(updated) == 0:
        raise EmptyResultError(
            f"no cell would see any of the {len(merged):,} objects; check the new objects."
        )
    report = change.report(
        len(database), len(updated), _count_drift(database.select(stale), recomputed)
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
    """Update a database in tiles: recompute the cells in range of a change.

    Parameters
    ----------
    path : str or Path
        Folder of the database.
    objects : str or Path
        The layers to replace, complete, as `save_objects` wrote them.
    out : str or Path, optional
        Another folder to write; `path` by default.
    workers, scheduler : optional
        As in `build_tiles`.
    progress : callable, optional
        Called with the number of finished tiles and of all tiles.

    Returns
    -------
    UpdateReport
        What changed. The files are byte for byte equal to the result of `build_tiles` with the new
        objects.

    Raises
    ------
    InputError
        If the new objects use a class code for another class or have another largest visibility
        range.
    CrsError
        If the new objects are in another CRS.
    DatabaseError, EmptyResultError
        As in `build_tiles`, or if the database has no street objects; then nothing is changed.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis import save_objects
    >>> from semsig_gis.database import build_tiles
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
    target = Path(path if out is None else out)
    with place_locked(Path(os.path.realpath(target))):
        run = partial(build_parts, workers=workers, scheduler=scheduler, progress=progress)
        return _update_tiles(Path(path), objects, target, run)


def _update_tiles(
    folder: Path, objects: str | Path, target: Path, run: Callable[..., list[PartFile]]
) -> UpdateReport:
    """Update a database in tiles; `run` is `build_parts` with its options."""
    path, manifest = folder, read_manifest(folder)
    files = dict(zip((part.tile for part in manifest.parts), part_files(path), strict=True))
    before = open_database(next(iter(files.values()))).select(slice(0))
    inputs = stored_inputs(folder)
    old, new = open_objects(inputs.pop("objects")), open_objects(objects)
    merged, other_layers, notes = replace_layers(old, new)
    result = merged if other_layers else new
    facts: dict[str, Any] = {
        "taxonomy": result.taxonomy,
        "licenses": (*map(str, result.licenses), *before.licenses[len(old.licenses) :]),
        "version": __version__,
        "notes": result.notes,
    }
    after = replace(before, **facts)
    if after.reach != before.reach:  # the unit of all stored distances
        raise InputError(
            f"the longest visibility range of {objects} is {after.reach:g} m and that of {path} "
            f"{before.reach:g} m, which affects every cell; build the database again."
        )
    _require_same_scale(before, after)
    ranged = replace(after, taxonomy=merged.taxonomy)
    change = _find_change(ranged, old, merged, other_layers=other_layers, notes=notes)
    side = int(manifest.recipe["tile"]["cells"])
    tiles = np.unique(np.stack(split_ids(change.cell_ids), axis=1) // side, axis=0)
    stale: set[Tile] = {(column, row) for column, row in tiles.tolist()}
    with working_folder(target) as work:
        source = Path(objects)
        if other_layers:
            source = work / "objects.parquet"
            save_objects(merged, source)
        plan = plan_tiles(
            source,
            target,
            tile=TileSpec(min(max(side * before.grid.step, 1.0), MOST_METRES)),
            grid=before.grid,
            spec=before.spec,
            viewpoints=before.viewpoints,
            buildings=inputs.get("buildings"),
            streets=inputs.get("streets"),
            digests={name: manifest.recipe["inputs"][name] for name in inputs},
        )
        # If the facts of all parts stay the same, the tiles without a change are copied.
        copies: dict[Tile, PartFile] = {}
        if database_specs(after) == database_specs(before) and not open_city(path).has_columns:
            copies = {part.tile: part for part in manifest.parts if part.tile not in stale}
        for tile, part in copies.items():
            shutil.copyfile(files[tile], plan.folder / part.file)
        old_tiles = _OldTiles(folder, plan.folder / INPUTS / "stale.npy", facts)
        np.save(old_tiles.stale, change.cell_ids)
        parts = run(
            plan,
            source,
            build=partial(update_tile, plan, old_tiles),
            copies=copies,
            share=len(change.cell_ids) / manifest.cells,
            remark=None,
        )
        drift = _total_drift(plan, old_tiles, stale)
        old_tiles.stale.unlink()
        publish_tiles(plan.folder, parts)
    return change.report(manifest.cells, sum(part.cells for part in parts), drift)


def _require_same_scale(before: SignatureDatabase, after: SignatureDatabase) -> None:
    """Raise InputError if the first landmarks come, or the last go, which changes all distances."""
    if before.scale.logarithmic != after.scale.logarithmic:
        change = "are the first landmarks" if after.scale.logarithmic else "leave no landmarks"
        raise InputError(
            f"the new objects {change} of the database, which affects the distances of every cell; "
            "build the database again."
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class _Change:
    """The difference between the objects of a database and the new objects.

    `places`, shape (c, 2) in metres, are the positions of removed and added objects that are not
    landmarks; `cell_ids`, ascending, are the cells in range of one or of a changed landmark. The
    other fields are as in `UpdateReport`.
    """

    places: NDArray[np.float64]
    cell_ids: NDArray[np.int64]
    classes: tuple[ClassChange, ...]
    replaced: tuple[str, ...]
    kept: tuple[str, ...]
    notes: tuple[str, ...]

    def report(self, cells_before: int, cells: int, drift: Mapping[str, int]) -> UpdateReport:
        """Return the report of an update, from the counts of cells."""
        return UpdateReport(
            classes=self.classes,
            replaced=self.replaced,
            kept=self.kept,
            cells_before=cells_before,
            cells=cells,
            recomputed=len(self.cell_ids),
            changed=drift["changed"],
            appeared=drift["appeared"],
            vanished=drift["vanished"],
            notes=self.notes,
        )


def _find_change(
    database: SignatureDatabase,
    old: StreetObjects,
    new: StreetObjects,
    *,
    other_layers: tuple[str, ...],
    notes: tuple[str, ...],
) -> _Change:
    """Compare objects, and find the cells in range of a change; ranges are of the `database`."""
    changes = compare_objects(old, new)
    old_rows, new_rows = changes.obsolete_rows, changes.new_rows
    places = np.concatenate([old.xy[old_rows], new.xy[new_rows]])
    codes = np.concatenate([old.codes[old_rows], new.codes[new_rows]])
    tall = np.isin(codes, database.taxonomy.tall_codes)
    # A new object may bring cells that see only landmarks.
    ids = np.union1d(
        _ids_in_range(database, places[~tall], codes[~tall]),
        _ids_in_range(database, places[tall], codes[tall]),
    )
    layers = {*old.table[SOURCE].unique(), *new.table[SOURCE].unique()}
    return _Change(
        places=places[~tall],
        cell_ids=ids,
        classes=changes.classes,
        replaced=tuple(sorted(layers - {*other_layers})),
        kept=other_layers,
        notes=notes,
    )


def _ids_in_range(
    database: SignatureDatabase, places: NDArray[np.float64], codes: NDArray[np.uint8]
) -> NDArray[np.int64]:
    """Return the ids of the cells in range of objects, ascending."""
    if not len(places):
        return np.empty(0, np.int64)
    taxonomy, radius = database.taxonomy, database.spec.radius
    ranges = taxonomy.ranges(radius)[codes]
    if len(taxonomy.tall_codes):
        ranges = np.maximum(ranges, cell_reach(taxonomy, radius))
    reach = float(ranges.max())
    columns, rows = cells_near(places, grid=database.grid, radius=reach)
    index, near = PackedIndex(places), []
    size = max(MOST_PAIRS // len(places), 1)
    for start in range(0, len(columns), size):  # to bound the memory
        block = slice(start, start + size)
        viewpoints = database.grid.viewpoints(columns[block], rows[block])
        pairs = index.pairs_within(viewpoints, radius=reach)
        sightings = measure_sightings(*pairs, viewpoints, places, ranges=ranges)
        near.append(start + np.unique(sightings.viewpoint))
    cells = np.concatenate(near)
    return cell_ids(columns[cells], rows[cells])


def _hiding(database: SignatureDatabase, store: ObjectStore) -> gpd.GeoDataFrame | None:
    """Return the buildings that hide objects of a database."""
    return None if database.occlusion is None else store.footprints


def _recompute(
    database: SignatureDatabase,
    store: ObjectStore,
    change: _Change,
    *,
    progress: Callable[[int, int], None] | None,
) -> SignatureDatabase:
    """Return the cells in range of a change, computed from the objects of a store."""
    if not len(change.cell_ids):
        return database.select(slice(0))
    objects, footprints = store.objects, _hiding(database, store)
    if not len(database.taxonomy.tall_codes):
        # A viewpoint is at most the reach from a change, and its objects are that far from it
        # again. Landmarks are seen from too many cells to look around each.
        around = 2.0 * database.reach + TOUCHING_M
        near = np.unique(store.index.pairs_within(change.places, radius=around)[1])
        if len(near) == 0:
            return database.select(slice(0))
        objects = replace(objects, table=objects.table.iloc[near])
        if footprints is not None:
            polygons = footprints.geometry.to_numpy()
            footprints = footprints.iloc[buildings_near(polygons, change.places, distance=around)]
    return build_cells(
        objects,
        *split_ids(change.cell_ids),
        grid=database.grid,
        spec=database.spec,
        viewpoints=database.viewpoints,
        footprints=footprints,
        streets=store.streets,
        partial=True,
        progress=progress,
    )


@dataclass(frozen=True, slots=True)
class _OldTiles:
    """The tiles before an update.

    `stale` is a file with the ids of the cells in range of a change, ascending; `facts` are the new
    values of the attributes of the whole database.
    """

    folder: Path
    stale: Path
    facts: dict[str, Any]

    def database(self, tile: Tile) -> SignatureDatabase | None:
        """Return the cells of a tile, None if it had none."""
        path = self.folder / part_name(tile)
        return open_database(path) if path.exists() else None

    def stale_in(self, tile: Tile, side: int) -> NDArray[np.int64]:
        """Return the ids of the cells of a tile in range of a change."""
        ids = np.load(self.stale, mmap_mode="r")
        # The ids are ordered by column, so the columns of the tile are one slice.
        ends = cell_ids(np.array([tile[0], tile[0] + 1]) * side, np.full(2, -ROW_SPAN // 2))
        first, last = np.searchsorted(ids, ends)
        in_columns: NDArray[np.int64] = np.array(ids[first:last])
        inside: NDArray[np.bool_] = split_ids(in_columns)[1] // side == tile[1]
        return in_columns[inside]


def update_tile(plan: TilePlan, old: _OldTiles, tile: Tile) -> PartFile | None:
    """Build the part of a tile from its old cells and the recomputed ones."""
    stale, before = old.stale_in(tile, plan.side), old.database(tile)
    recomputed = tile_cells(plan, tile, only=stale) if len(stale) else None
    parts = [] if recomputed is None else [recomputed]
    replaced = None
    if before is not None:
        mask = np.isin(before.cell_ids, stale)
        replaced = before.select(mask)
        parts.append(replace(before.select(~mask), **old.facts))
    if len(stale):
        write_json(_drift_path(plan, tile), _count_drift(replaced, recomputed))
    joined = replace(join_databases(parts), **old.facts) if parts else None
    return save_tile(plan, tile, joined)


def _drift_path(plan: TilePlan, tile: Tile) -> Path:
    return (plan.folder / part_name(tile)).with_suffix(".drift")


def _count_drift(
    before: SignatureDatabase | None, after: SignatureDatabase | None
) -> dict[str, int]:
    """Return the number of cells that changed, appeared and vanished; None is no cells."""
    if before is None or after is None:
        return {
            "changed": 0,
            "appeared": 0 if after is None else len(after),
            "vanished": 0 if before is None else len(before),
        }
    cells = compare_cells(before, after)
    return {
        "changed": len(cells.changed),
        "appeared": len(cells.appeared),
        "vanished": len(cells.vanished),
    }


def _total_drift(plan: TilePlan, old: _OldTiles, stale: set[Tile]) -> Counter[str]:
    """Return the number of cells that changed, appeared and vanished in all stale tiles.

    Tiles without counts (built by an interrupted run, or without objects now) are compared here.
    """
    total: Counter[str] = Counter()
    for tile in stale:
        counts, part = _drift_path(plan, tile), plan.folder / part_name(tile)
        if counts.exists():
            total.update(read_json(counts))
        else:
            after = open_database(part) if part.exists() else None
            total.update(_count_drift(old.database(tile), after))
    return total
