"""Tiles: building a signature database square by square, each from what lies near it alone.

The run works in ``OUT.partial``, where the same command finds the tiles that an interrupted run has
left; when all are there, the folder is renamed to ``OUT``.
"""

from __future__ import annotations

import os
import shutil
from collections import Counter
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow.parquet as pq
import shapely

from semsig_gis import __version__
from semsig_gis.core import (
    MOST_METRES,
    TEMPORARY_PREFIX,
    DatabaseError,
    EmptyResultError,
    GridSpec,
    InputError,
    SignatureSpec,
    announce,
    cell_ids,
    cells_near,
    check_workers,
    consecutive,
    finish_tasks,
    require_number,
    require_step,
    split_ids,
)
from semsig_gis.database.build import (
    HIDDEN_PAIR_S,
    PAIR_S,
    build_cells,
    expected_pairs,
    require_room,
)
from semsig_gis.database.file import (
    INPUTS,
    MANIFEST,
    Manifest,
    Part,
    digest,
    open_database,
    part_name,
    read_manifest,
    save_database,
)
from semsig_gis.database.occlusion import TOLERANCE_M
from semsig_gis.database.tile_inputs import copy_by_box, fingerprint, in_files, widest_street
from semsig_gis.database.viewpoints import ViewpointSpec, require_surroundings
from semsig_gis.objects import open_objects, read_surroundings
from semsig_gis.storage import (
    EMPTY_BOX,
    PARTIAL,
    RunKind,
    bounds_by_group,
    finish,
    partial_folder,
    read_json,
    write_json,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    import geopandas as gpd
    from numpy.typing import NDArray
    from pyproj import CRS

    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.database.tile_inputs import Input

    Tile = tuple[int, int]
    Box = tuple[float, float, float, float]

# Beyond the range: for rounding, and for walls as near as occlusion.GAP_M and TOLERANCE_M look.
MARGIN_M = 2.0
# Tiles that one object may touch in a row, and tiles in all.
MOST_REACHED = 16
MOST_TILES = 1_000_000
TILE_S = 0.05  # that a tile takes at least

RECIPE = "_recipe.json"
EMPTY = ".empty"
RUN = RunKind(
    content="unfinished run",
    another=(
        "{folder} contains an unfinished run that differs in {difference}; delete that folder "
        "to start anew, or finish it with the same command and inputs as before."
    ),
    read=lambda folder: read_json(folder / RECIPE),
    write=lambda folder, recipe: write_json(folder / RECIPE, recipe),
    names={RECIPE, INPUTS},
    results="tile_*",
)


@dataclass(frozen=True, slots=True)
class TileSpec:
    """How a database is cut into tiles.

    Parameters
    ----------
    side : float, default 2000
        Side of a tile in metres, from 1 to 1,000,000; it is rounded to whole cells, at least one.

    Raises
    ------
    InputError
        If the side is out of its range.

    Examples
    --------
    >>> TileSpec(side=104.0).cells(GridSpec(step=10.0))
    10
    """

    side: float = 2000.0

    def __post_init__(self) -> None:  # noqa: D105
        require_number("side of a tile", self.side, least=1, most=MOST_METRES, unit="metres")

    def cells(self, grid: GridSpec) -> int:
        """Return the side in cells of a grid, at least 1."""
        return max(1, round(self.side / grid.step))


def build_tiles(
    objects: str | Path,
    out: str | Path,
    *,
    tile: TileSpec | None = None,
    grid: GridSpec | None = None,
    spec: SignatureSpec | None = None,
    viewpoints: ViewpointSpec | None = None,
    buildings: str | Path | gpd.GeoDataFrame | None = None,
    streets: str | Path | gpd.GeoDataFrame | None = None,
    workers: int = 0,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] | None = None,
    tell: Callable[[str], None] | None = None,
) -> Manifest:
    """Build a signature database in tiles: a folder that is opened like a single file.

    Parameters
    ----------
    objects : str or Path
        Street objects that `save_objects` wrote.
    out : str or Path
        Folder to write. It appears whole, by rename; a database that is there is replaced.
    tile : TileSpec, optional
        Size of a tile; 2000 m by default.
    grid, spec, viewpoints : optional
        As in `build_database`.
    buildings, streets : str, Path or GeoDataFrame, optional
        Files that `read_surroundings` reads, or tables.
    workers : int, default 0
        How many processes of this machine build tiles; 0 builds them here, without dask.
    scheduler : str, optional
        Address of a dask scheduler, such as ``tcp://10.0.0.5:8786``, whose workers see the same
        files under the same paths; then `workers` stays 0.
    progress : callable, optional
        Called with the number of tiles done and in all.
    tell : callable, optional
        Called with a remark for the user, as about a run that is taken up again.

    Returns
    -------
    Manifest
        What the database consists of.

    Raises
    ------
    InputError
        If an option cannot be used, the scheduler cannot be reached, the memory does not hold
        the fullest tile, or `out` holds something else or an unfinished run with other inputs or
        specs.
    DatabaseError
        If the street objects cannot be read, or a tile cannot be built; the other tiles are kept
        for the next run.
    EmptyResultError
        If no cell sees an object.

    Notes
    -----
    The files are the same byte for byte whatever the number of workers. The folder keeps copies of
    the objects, buildings and streets, so that `update_tiles` knows what was there. An interrupted
    run leaves its tiles in ``OUT.partial``, and the same command goes on from there, if the specs
    are the same and the input files have the same content (by SHA-256). A script that gives
    `workers` needs the guard ``if __name__ == "__main__":``, because the workers import it.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis import save_objects
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_objects(demo_objects, f"{folder}/objects.parquet")
    ...     parts = build_tiles(f"{folder}/objects.parquet", f"{folder}/town")
    ...     len(open_database(f"{folder}/town")) == parts.cells
    True
    """
    check_workers(workers, scheduler)
    with in_files(objects, out, buildings=buildings, streets=streets) as surroundings:
        plan = plan_tiles(
            objects,
            out,
            tile=tile or TileSpec(),
            grid=grid or GridSpec(),
            spec=spec or SignatureSpec(),
            viewpoints=viewpoints or ViewpointSpec(),
            buildings=surroundings.get("buildings"),
            streets=surroundings.get("streets"),
            tell=tell,
        )
        parts = build_parts(
            plan,
            objects,
            work=partial(build_tile, plan),
            workers=workers,
            scheduler=scheduler,
            progress=progress,
            tell=tell,
        )
        return publish(plan.folder, parts)


def build_parts(
    plan: TilePlan,
    objects: str | Path,
    *,
    work: Callable[[Tile], Part | None],
    old_parts: Mapping[Tile, Part] | None = None,
    share: float = 1.0,
    workers: int,
    scheduler: str | None,
    progress: Callable[[int, int], None] | None,
    tell: Callable[[str], None] | None,
) -> list[Part]:
    """Build the tiles of a plan that are not there yet, and return all parts, ordered by tile.

    `work` builds one; `old_parts` lie in the folder already. About this `share` of the cells of the
    others is computed.
    """
    old_parts = old_parts or {}
    try:
        tiles = touched_tiles(plan.objects, grid=plan.grid, side=plan.side, reach=plan.reach)
        left = [tile for tile in tiles if tile not in old_parts]
        done: dict[Tile, Part | None] = {**old_parts, **finished_tiles(plan.folder, left)}
        left = [tile for tile in left if tile not in done]
        _look_ahead(plan, tiles, left=share * len(left), workers=workers, scheduler=scheduler)
        if done and tell is not None:
            tell(f"an unfinished run has left {len(done):,} of {len(tiles):,} tiles; resuming it")

        def note_part(tile: Tile, part: Part | None) -> None:
            done[tile] = part
            if progress is not None:
                progress(len(done), len(tiles))

        failed = finish_tasks(
            work,
            left,
            on_success=note_part,
            workers=workers,
            scheduler=scheduler,
            files=[*filter(None, (plan.folder, plan.objects, plan.buildings, plan.streets))],
        )
    finally:
        RUN.abandon(plan.folder)
    if failed:
        first = min(failed)
        others = f" and {len(failed) - 1} more" if len(failed) > 1 else ""
        raise DatabaseError(
            f"{part_name(first)}{others} could not be built ({failed[first]}); the {len(done):,} "
            f"tiles that are done are kept in {plan.folder}, so fix the cause and run the "
            "same command again."
        )
    parts = sorted(part for part in done.values() if part is not None)
    if not parts:
        shutil.rmtree(plan.folder, ignore_errors=True)
        raise EmptyResultError(
            f"no cell sees an object of {objects}; make the step ({plan.grid.step:g} m) smaller or "
            f"the visibility range ({plan.spec.radius:g} m) larger, or check the area, the "
            "streets and the buildings."
        )
    return parts


def _look_ahead(
    plan: TilePlan, tiles: Sequence[Tile], *, left: float, workers: int, scheduler: str | None
) -> None:
    """Refuse tiles that the memory does not hold, and tell when all will take long.

    The fullest comes first. Workers elsewhere look at their own memory when they begin a tile.
    """
    if not left:
        return
    objects = open_objects(plan.objects, box=plan.box(tiles[0], plan.reach + MARGIN_M))
    ranges = objects.taxonomy.ranges(plan.spec.radius)[objects.codes]
    cells = plan.side**2
    pairs = expected_pairs(ranges, grid=plan.grid, cells=cells)
    if scheduler is None:
        # Most of a large tile may be far from any object.
        near = min(cells, round(len(objects) * (2.0 * plan.reach / plan.grid.step + 2.0) ** 2))
        require_room(pairs, cells=near, objects=len(objects), processes=max(workers, 1))
    if len(objects):
        each = PAIR_S if plan.buildings is None else HIDDEN_PAIR_S
        count = pq.read_metadata(plan.objects).num_rows
        seconds = TILE_S * len(tiles) + each * pairs * count / len(objects)
        announce(seconds * left / len(tiles) / max(workers, 1), "building tiles")


@dataclass(frozen=True, slots=True, kw_only=True)
class TilePlan:
    """All that is needed to build any tile: paths and specs, so that it travels lightly.

    Part files are written to `folder`; all inputs can be read by box and are in one CRS. `side` is
    that of a tile in cells; `reach` is the largest visibility range of any class, and
    `street_reach` how far the widest street reaches from its centre line, both in metres.
    """

    folder: Path
    objects: Path
    buildings: Path | None = None
    streets: Path | None = None
    grid: GridSpec
    spec: SignatureSpec
    viewpoints: ViewpointSpec
    side: int
    reach: float
    street_reach: float = 0.0

    def box(self, tile: Tile, margin: float) -> Box:
        """Return ``xmin, ymin, xmax, ymax`` of a tile, widened by `margin` metres on each side."""
        side = self.side * self.grid.step
        west, south = self.grid.origin[0] + tile[0] * side, self.grid.origin[1] + tile[1] * side
        return west - margin, south - margin, west + side + margin, south + side + margin


def plan_tiles(
    objects: str | Path,
    out: str | Path,
    *,
    tile: TileSpec,
    grid: GridSpec,
    spec: SignatureSpec,
    viewpoints: ViewpointSpec,
    buildings: str | Path | None = None,
    streets: str | Path | None = None,
    digests: Mapping[str, str] | None = None,
    tell: Callable[[str], None] | None = None,
) -> TilePlan:
    """Check the inputs of a run, begin it or take it up again, and return the plan of its tiles.

    Streets are needed by the viewpoints ``"streets"`` and left aside by others. `digests` are those
    of inputs of which a copy is given. `tell` takes remarks on the files of buildings and streets.
    """
    along = streets if viewpoints.mode == "streets" else None
    places: dict[Input, str | Path | None]
    places = {"objects": objects, "buildings": buildings, "streets": along}
    paths = {name: Path(path).absolute() for name, path in places.items() if path is not None}
    nothing = open_objects(paths["objects"], box=EMPTY_BOX)
    reach = float(nothing.taxonomy.ranges(spec.radius).max())
    require_step(grid, reach)
    require_surroundings(viewpoints, paths.get("buildings"), paths.get("streets"))
    recipe: dict[str, Any] = {
        "version": __version__,
        "grid": asdict(grid),
        "signature": asdict(spec),
        "viewpoints": viewpoints.to_dict(),
        "occlusion": TOLERANCE_M if "buildings" in paths else None,
        "tile": {"cells": tile.cells(grid)},
        "inputs": {name: fingerprint(path) for name, path in paths.items()} | dict(digests or {}),
    }
    folder = begin(out, recipe)
    try:
        files = {
            name: copy_by_box(name, path, nothing.crs, folder, tell) for name, path in paths.items()
        }
        lines = files.get("streets")
        return TilePlan(
            folder=folder,
            objects=files["objects"],
            buildings=files.get("buildings"),
            streets=lines,
            grid=grid,
            spec=spec,
            viewpoints=viewpoints,
            side=tile.cells(grid),
            reach=reach,
            street_reach=0.0 if lines is None else max(viewpoints.width, widest_street(lines)),
        )
    except BaseException:
        RUN.abandon(folder)
        raise


def touched_tiles(path: str | Path, *, grid: GridSpec, side: int, reach: float) -> list[Tile]:
    """Return the tiles that may have a cell from which some object is seen, fullest first.

    Only the bounds in the file of objects are read. `side` is that of a tile in cells, `reach` the
    largest visibility range of any class in metres. Tiles that are too small are refused.
    """
    metres = side * grid.step
    if reach > MOST_REACHED * metres:
        raise InputError(
            f"a tile of {metres:g} m is too small for a visibility range of {reach:g} m; make it "
            f"at least {reach / MOST_REACHED:g} m."
        )
    objects: Counter[int] = Counter()
    for bounds in bounds_by_group(path):
        widened = bounds + np.array([-reach, -reach, reach, reach])
        places = np.floor((widened - np.tile(grid.origin, 2)) / metres).astype(np.int64)
        boxes, count = np.unique(places, axis=0, return_counts=True)
        west, south, east, north = boxes.T
        height = north + 1 - south
        size = (east + 1 - west) * height
        box = np.repeat(np.arange(len(boxes)), size)
        column, row = np.divmod(consecutive(np.zeros_like(size), size), height[box])
        ids = cell_ids(west[box] + column, south[box] + row)
        distinct, number = np.unique(ids, return_inverse=True)
        total = np.bincount(number, weights=count[box]).astype(np.int64)
        objects.update(dict(zip(distinct.tolist(), total.tolist(), strict=True)))
        if len(objects) > MOST_TILES:
            raise InputError(
                f"tiles of {metres:g} m would be more than {MOST_TILES:,}; make them larger."
            )
    ordered = sorted(objects, key=lambda number: (-objects[number], number))
    columns, rows = split_ids(np.array(ordered, np.int64))
    return list(zip(columns.tolist(), rows.tolist(), strict=True))


def build_tile(plan: TilePlan, tile: Tile) -> Part | None:
    """Build and save the part of one tile; return None where none of its cells sees anything."""
    return save_tile(plan, tile, tile_cells(plan, tile))


def tile_cells(
    plan: TilePlan, tile: Tile, *, only: NDArray[np.int64] | None = None
) -> SignatureDatabase | None:
    """Return the cells of one tile, or `only` those of some ids; None far from any object.

    What decides about a cell lies within the largest range of it: objects, and buildings together
    with their neighbours; a street lies within its own width. So only that is read, and the cells
    are the same as when everything is.
    """
    if not plan.folder.is_dir():
        raise InputError(f"{plan.folder} no longer exists; run the same command again.")
    around = plan.box(tile, plan.reach + MARGIN_M)
    objects = open_objects(plan.objects, box=around)
    if not len(objects):
        return None
    if only is None:
        columns, rows = cells_near(objects.xy, grid=plan.grid, radius=plan.reach)
        inside = (columns // plan.side == tile[0]) & (rows // plan.side == tile[1])
        columns, rows = columns[inside], rows[inside]
    else:
        columns, rows = split_ids(only)
    crs, along = objects.crs, plan.box(tile, plan.street_reach + MARGIN_M)
    return build_cells(
        objects,
        columns,
        rows,
        grid=plan.grid,
        spec=plan.spec,
        viewpoints=plan.viewpoints,
        footprints=None if plan.buildings is None else _footprints(plan.buildings, around, crs),
        streets=None
        if plan.streets is None
        else read_surroundings(plan.streets, role="streets", crs=crs, box=along),
        partial=True,
    )


def save_tile(plan: TilePlan, tile: Tile, database: SignatureDatabase | None) -> Part | None:
    """Save the part of one tile, or note that it has none."""
    path = plan.folder / part_name(tile)
    if database is None or not len(database):
        path.with_suffix(EMPTY).touch()
        return None
    save_database(database, path)
    return describe(tile, database, path)


def _footprints(path: Path, box: Box, crs: CRS) -> gpd.GeoDataFrame:
    """Return the footprints that meet a box, and all neighbours of those that do."""
    near = read_surroundings(path, role="buildings", crs=crs, box=box)
    if len(near):
        low, high = near.total_bounds[:2], near.total_bounds[2:]
        around = (*(np.minimum(low, box[:2]) - MARGIN_M), *(np.maximum(high, box[2:]) + MARGIN_M))
        near = read_surroundings(path, role="buildings", crs=crs, box=around)
    # Flat ones are left out there too, but a tile may have no others.
    flat = shapely.area(near.geometry.to_numpy()) == 0
    flat[flat] = shapely.area(shapely.make_valid(near.geometry.to_numpy()[flat])) == 0
    return near[~flat]


def begin(out: str | Path, recipe: dict[str, Any]) -> Path:
    """Begin a run, or take up an unfinished one, and return its folder: `out` with ``.partial``.

    Raise InputError if `out` holds something that may not be replaced, or the folder tiles of an
    unfinished run by another recipe, which are never thrown away unasked.
    """
    target, folder = Path(os.path.realpath(out)), partial_folder(out)
    _require_replaceable(target)
    if (target / RECIPE).exists():  # of a run that was killed at the very end
        shutil.rmtree(folder, ignore_errors=True)  # which holds what it had replaced
        (target / RECIPE).unlink()
    RUN.begin(folder, recipe)
    return folder


def _require_replaceable(target: Path) -> None:
    """Refuse to put a database in the place of anything but a database."""
    if not target.is_dir():
        if target.exists() and not target.is_file():
            raise InputError(f"{target} is a device or a pipe; give the name of a folder to write.")
        return
    others = {path.name for path in target.iterdir() if not path.name.startswith(TEMPORARY_PREFIX)}
    if MANIFEST in others:
        others -= {MANIFEST, RECIPE, INPUTS, *(part.file for part in read_manifest(target).parts)}
    if others:
        raise InputError(
            f"{target} contains {min(others)!r}, which is not part of a signature database; give "
            "the name of a new folder, or move that file elsewhere."
        )


def describe(tile: Tile, database: SignatureDatabase, path: Path) -> Part:
    """Return the manifest's entry for a part that was saved to a path."""
    return Part(tile, len(database), len(database.codes), path.stat().st_size, digest(path))


def finished_tiles(folder: Path, tiles: Iterable[Tile]) -> dict[Tile, Part | None]:
    """Return the parts of the tiles that are done, None where no cell sees anything.

    A damaged file is deleted, and its tile is not done.
    """
    done: dict[Tile, Part | None] = {}
    for tile in tiles:
        path = folder / part_name(tile)
        if path.with_suffix(EMPTY).exists():
            done[tile] = None
        elif path.exists():
            try:
                done[tile] = describe(tile, open_database(path), path)
            except DatabaseError:
                path.unlink()
    return done


def publish(folder: Path, parts: Sequence[Part]) -> Manifest:
    """Put a database whose tiles are all done, ordered by tile, in the place of another."""
    manifest = Manifest(read_json(folder / RECIPE), tuple(parts))
    _require_replaceable(folder.with_name(folder.name.removesuffix(PARTIAL)))
    manifest.write(folder)
    names = {MANIFEST, RECIPE, INPUTS, *(part.file for part in manifest.parts)}
    target = finish(folder, keep=names)
    (target / RECIPE).unlink()
    return manifest
