"""Build a signature database in square tiles, each only from the data near it.

A run writes to ``OUT.partial``. The same command resumes an interrupted run there. When all tiles
are finished, the folder is renamed to ``OUT``.
"""

from __future__ import annotations

import contextlib
import os
import shutil
from collections import Counter
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow.parquet as pq

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
    place_locked,
    require_number,
    require_step,
    split_ids,
)
from semsig_gis.database.cells import (
    HIDDEN_PAIR_S,
    PAIR_S,
    build_cells,
    cell_reach,
    expected_pairs,
    require_room,
)
from semsig_gis.database.file import (
    INPUTS,
    MANIFEST,
    Manifest,
    PartFile,
    open_database,
    part_name,
    read_manifest,
    save_database,
)
from semsig_gis.database.occlusion import MARGIN_M, SHADOW_M, TOLERANCE_M, footprints_around
from semsig_gis.database.tile_inputs import (
    copy_with_bounds,
    fingerprint,
    input_files,
    widest_street,
)
from semsig_gis.database.viewpoints import ViewpointSpec, require_surroundings
from semsig_gis.objects import open_objects, read_surroundings
from semsig_gis.storage import (
    EMPTY_BOX,
    PARTIAL,
    RunKind,
    bounds_by_group,
    digest,
    finish,
    partial_folder,
    read_json,
    write_json,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    import geopandas as gpd
    from numpy.typing import NDArray

    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.database.tile_inputs import Input
    from semsig_gis.objects import StreetObjects

    Tile = tuple[int, int]
    Box = tuple[float, float, float, float]

MOST_TILES_IN_RANGE = 16  # largest visibility range in sides of a tile
MOST_TILES = 1_000_000
TILE_S = 0.05  # shortest time to build a tile

RECIPE = "_recipe.json"
EMPTY = ".empty"
RUN = RunKind(
    content="unfinished run",
    another=(
        "{folder} contains an unfinished run that differs in {difference}; delete that folder "
        "to start again, or finish it with the same command and inputs as before."
    ),
    read=lambda folder: read_json(folder / RECIPE),
    write=lambda folder, recipe: write_json(folder / RECIPE, recipe),
    names={RECIPE, INPUTS},
    results="tile_*",
)


@dataclass(frozen=True, slots=True)
class TileSpec:
    """Size of the tiles of a database.

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
    remark: Callable[[str], None] | None = None,
) -> Manifest:
    """Build a signature database in tiles: a folder that can be opened like a file.

    Parameters
    ----------
    objects : str or Path
        Street objects that `save_objects` wrote.
    out : str or Path
        Folder to write. It appears complete, by rename, and replaces an existing database.
    tile : TileSpec, optional
        Size of a tile; 2000 m by default.
    grid, spec, viewpoints : optional
        As in `build_database`.
    buildings, streets : str, Path or GeoDataFrame, optional
        Files that `read_surroundings` reads, or tables.
    workers : int, default 0
        Number of processes of this machine that build tiles; 0 builds in this one, without dask.
    scheduler : str, optional
        Address of a dask scheduler, such as ``tcp://10.0.0.5:8786``. Its workers must see the same
        files under the same paths, and `workers` must be 0.
    progress : callable, optional
        Called with the number of finished tiles and of all tiles.
    remark : callable, optional
        Called with messages for the user, for example that a run is resumed.

    Returns
    -------
    Manifest
        The parts of the database.

    Raises
    ------
    InputError
        If an option cannot be used, the scheduler cannot be reached, the fullest tile does not fit
        into memory, or `out` is not a database or has an unfinished run with other inputs or
        specs.
    DatabaseError
        If the street objects cannot be read, or a tile cannot be built; the next run reuses the
        other tiles.
    EmptyResultError
        If no cell sees an object.

    Notes
    -----
    The files are byte for byte the same for any number of workers. The folder has copies of the
    objects, buildings and streets, which `update_tiles` needs. The same command resumes an
    interrupted run from ``OUT.partial``, if the specs and the content of the input files (by
    SHA-256) are the same. A script that gives `workers` needs the guard
    ``if __name__ == "__main__":``, because the workers import it.

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
    with (
        place_locked(Path(os.path.realpath(out))),
        input_files(objects, out, buildings=buildings, streets=streets) as surroundings,
    ):
        plan = plan_tiles(
            objects,
            out,
            tile=tile or TileSpec(),
            grid=grid or GridSpec(),
            spec=spec or SignatureSpec(),
            viewpoints=viewpoints or ViewpointSpec(),
            buildings=surroundings.get("buildings"),
            streets=surroundings.get("streets"),
            remark=remark,
        )
        parts = build_parts(
            plan,
            objects,
            build=partial(build_tile, plan),
            workers=workers,
            scheduler=scheduler,
            progress=progress,
            remark=remark,
        )
        return publish_tiles(plan.folder, parts)


def build_parts(
    plan: TilePlan,
    objects: str | Path,
    *,
    build: Callable[[Tile], PartFile | None],
    copies: Mapping[Tile, PartFile] | None = None,
    share: float = 1.0,
    workers: int,
    scheduler: str | None,
    progress: Callable[[int, int], None] | None,
    remark: Callable[[str], None] | None,
) -> list[PartFile]:
    """Build the missing tiles of a plan, and return all parts, ordered by tile.

    `build` builds a tile; `copies` are in the folder already. About this `share` of the cells of
    the other tiles is computed.
    """
    copies = copies or {}
    try:
        tiles = touched_tiles(plan.objects, grid=plan.grid, side=plan.side, reach=plan.near_reach)
        others = [tile for tile in tiles if tile not in copies]
        results: dict[Tile, PartFile | None] = {**copies, **finished_tiles(plan.folder, others)}
        missing = [tile for tile in others if tile not in results]
        _check_resources(
            plan, tiles, missing=share * len(missing), workers=workers, scheduler=scheduler
        )
        if results and remark is not None:
            remark(
                f"an unfinished run has left {len(results):,} of {len(tiles):,} tiles; resuming it"
            )

        def add_result(tile: Tile, part: PartFile | None) -> None:
            results[tile] = part
            if progress is not None:
                progress(len(results), len(tiles))

        errors = finish_tasks(
            build,
            missing,
            on_success=add_result,
            workers=workers,
            scheduler=scheduler,
            files=[*filter(None, (plan.folder, plan.objects, plan.buildings, plan.streets))],
        )
    finally:
        RUN.abandon(plan.folder)
    if errors:
        first = min(errors)
        more = f" and {len(errors) - 1} more" if len(errors) > 1 else ""
        raise DatabaseError(
            f"{part_name(first)}{more} could not be built ({errors[first]}); the {len(results):,} "
            f"tiles that are done are kept in {plan.folder}, so fix the cause and run the "
            "same command again."
        )
    parts = sorted(part for part in results.values() if part is not None)
    if not parts:
        shutil.rmtree(plan.folder, ignore_errors=True)
        raise EmptyResultError(
            f"no cell sees an object of {objects}; make the step ({plan.grid.step:g} m) smaller or "
            f"the visibility range ({plan.spec.radius:g} m) larger, or check the area, the "
            "streets and the buildings."
        )
    return parts


def _check_resources(
    plan: TilePlan, tiles: Sequence[Tile], *, missing: float, workers: int, scheduler: str | None
) -> None:
    """Raise InputError if a tile does not fit into memory, and announce a long run.

    The first tile is the fullest. Workers of a scheduler check their own memory for each tile.
    """
    if not missing:
        return
    objects = _objects_around(plan, tiles[0])
    ranges = objects.taxonomy.ranges(plan.spec.radius)[objects.codes]
    cells = plan.side**2
    pairs = expected_pairs(ranges, grid=plan.grid, cells=cells)
    if scheduler is None:
        # Most of a large tile may be far from any object.
        furthest = ranges.max(initial=0.0)
        near = min(cells, round(len(objects) * (2.0 * furthest / plan.grid.step + 2.0) ** 2))
        require_room(pairs, cells=near, objects=len(objects), processes=max(workers, 1))
    if len(objects):
        pair_s = PAIR_S if plan.buildings is None else HIDDEN_PAIR_S
        count = pq.read_metadata(plan.objects).num_rows
        seconds = TILE_S * len(tiles) + pair_s * pairs * count / len(objects)
        announce(seconds * missing / len(tiles) / max(workers, 1), "building tiles")


@dataclass(frozen=True, slots=True, kw_only=True)
class TilePlan:
    """Paths and specs for building any tile; small, because it is sent to the workers.

    Part files are written to `folder`; all inputs can be read by box and are in one CRS. `side` is
    the side of a tile in cells; `reach` is the largest visibility range of any class, `near_reach`
    the largest distance of a cell from an object (`cell_reach`), and `street_reach` the largest
    half-width of a street, all in metres.
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
    near_reach: float
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
    remark: Callable[[str], None] | None = None,
) -> TilePlan:
    """Check the inputs of a run, begin or resume it, and return the plan of its tiles.

    Streets are only copied unless the viewpoints are ``"streets"``. `digests` replace the computed
    digests of inputs that are copies. `remark` is called with messages about the files of buildings
    and streets.
    """
    inputs: dict[Input, str | Path | None] = {
        "objects": objects,
        "buildings": buildings,
        "streets": streets,
    }
    paths = {name: Path(path).absolute() for name, path in inputs.items() if path is not None}
    empty = open_objects(paths["objects"], box=EMPTY_BOX)
    taxonomy = empty.taxonomy
    reach = float(taxonomy.ranges(spec.radius).max())
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
    folder = begin_run(out, recipe)
    try:
        files = {
            name: copy_with_bounds(name, path, empty.crs, folder, remark)
            for name, path in paths.items()
        }
        lines = files.get("streets") if viewpoints.mode == "streets" else None
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
            near_reach=cell_reach(taxonomy, spec.radius),
            street_reach=0.0 if lines is None else max(viewpoints.width, widest_street(lines)),
        )
    except BaseException:
        RUN.abandon(folder)
        raise


def _objects_around(plan: TilePlan, tile: Tile) -> StreetObjects:
    """Return the objects that the cells of a tile may see."""
    objects = open_objects(plan.objects, box=plan.box(tile, plan.reach + MARGIN_M))
    if not len(objects.taxonomy.tall_codes):
        return objects
    west, south, east, north = plan.box(tile, plan.near_reach + MARGIN_M)
    x, y = objects.xy.T
    near = (x >= west) & (x <= east) & (y >= south) & (y <= north)
    near |= np.isin(objects.codes, objects.taxonomy.tall_codes)
    return replace(objects, table=objects.table[near])


def touched_tiles(path: str | Path, *, grid: GridSpec, side: int, reach: float) -> list[Tile]:
    """Return the tiles in range of an object, by decreasing number of objects.

    Only the bounds in the file of objects are read. `side` is the side of a tile in cells, `reach`
    a visibility range in metres. InputError if the tiles are too small.
    """
    metres = side * grid.step
    if reach > MOST_TILES_IN_RANGE * metres:
        raise InputError(
            f"a tile of {metres:g} m is too small for a visibility range of {reach:g} m; make it "
            f"at least {reach / MOST_TILES_IN_RANGE:g} m."
        )
    objects_in: Counter[int] = Counter()
    for bounds in bounds_by_group(path):
        widened = bounds + np.array([-reach, -reach, reach, reach])
        # Objects with the same box of tiles are counted together, then added to each of its tiles.
        corners = np.floor((widened - np.tile(grid.origin, 2)) / metres).astype(np.int64)
        boxes, count = np.unique(corners, axis=0, return_counts=True)
        west, south, east, north = boxes.T
        height = north + 1 - south
        size = (east + 1 - west) * height
        box = np.repeat(np.arange(len(boxes)), size)
        column, row = np.divmod(consecutive(np.zeros_like(size), size), height[box])
        ids = cell_ids(west[box] + column, south[box] + row)
        distinct, number = np.unique(ids, return_inverse=True)
        total = np.bincount(number, weights=count[box]).astype(np.int64)
        objects_in.update(dict(zip(distinct.tolist(), total.tolist(), strict=True)))
        if len(objects_in) > MOST_TILES:
            raise InputError(
                f"tiles of {metres:g} m would be more than {MOST_TILES:,}; make them larger."
            )
    ordered = sorted(objects_in, key=lambda number: (-objects_in[number], number))
    columns, rows = split_ids(np.array(ordered, np.int64))
    return list(zip(columns.tolist(), rows.tolist(), strict=True))


def build_tile(plan: TilePlan, tile: Tile) -> PartFile | None:
    """Build and save the part of one tile; return None if none of its cells sees an object."""
    return save_tile(plan, tile, tile_cells(plan, tile))


def tile_cells(
    plan: TilePlan, tile: Tile, *, only: NDArray[np.int64] | None = None
) -> SignatureDatabase | None:
    """Return the cells of one tile, or `only` some by id; None if no object is near.

    A cell depends only on objects within the largest range, on buildings within it and their
    neighbours, and on streets within their half-width. Only these are read, and the cells are the
    same as those computed from all data.
    """
    if not plan.folder.is_dir():
        raise InputError(f"{plan.folder} no longer exists; run the same command again.")
    objects = _objects_around(plan, tile)
    if not len(objects):
        return None
    if only is None:
        columns, rows = cells_near(objects.xy, grid=plan.grid, radius=plan.near_reach)
        inside = (columns // plan.side == tile[0]) & (rows // plan.side == tile[1])
        columns, rows = columns[inside], rows[inside]
    else:
        columns, rows = split_ids(only)
    read = partial(read_surroundings, crs=objects.crs)
    footprints = streets = None
    if plan.buildings is not None:
        # Roofs farther away than other objects may hide a landmark.
        tall = objects.taxonomy.tall_codes
        hiding = max(plan.near_reach, SHADOW_M) if len(tall) else plan.near_reach
        around = plan.box(tile, hiding + MARGIN_M)
        footprints = footprints_around(
            lambda box: read(plan.buildings, role="buildings", box=box), around
        )
    if plan.streets is not None:
        box = plan.box(tile, plan.street_reach + MARGIN_M)
        streets = read(plan.streets, role="streets", box=box)
    return build_cells(
        objects,
        columns,
        rows,
        grid=plan.grid,
        spec=plan.spec,
        viewpoints=plan.viewpoints,
        footprints=footprints,
        streets=streets,
        partial=True,
    )


def save_tile(plan: TilePlan, tile: Tile, database: SignatureDatabase | None) -> PartFile | None:
    """Save the part of one tile, or an empty marker file if it has no cells."""
    path = plan.folder / part_name(tile)
    if database is None or not len(database):
        path.with_suffix(EMPTY).touch()
        return None
    save_database(database, path)
    return describe_part(tile, database, path)


def begin_run(out: str | Path, recipe: dict[str, Any]) -> Path:
    """Begin a run or resume an unfinished one, and return its folder: `out` with ``.partial``.

    Raise InputError if `out` may not be replaced, or the folder has tiles of an unfinished run with
    another recipe, which are never deleted without a request.
    """
    target, folder = Path(os.path.realpath(out)), partial_folder(out)
    _require_replaceable(target)
    # A run was killed after it had exchanged the folders; the partial one has the old database.
    if (target / RECIPE).exists():
        shutil.rmtree(folder, ignore_errors=True)
        (target / RECIPE).unlink()
    RUN.begin(folder, recipe)
    return folder


def _require_replaceable(target: Path) -> None:
    """Raise InputError if a path is neither free nor a database or a file."""
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


def describe_part(tile: Tile, database: SignatureDatabase, path: Path) -> PartFile:
    """Return the entry in the manifest of a saved part."""
    return PartFile(tile, len(database), len(database.codes), path.stat().st_size, digest(path))


def finished_tiles(folder: Path, tiles: Iterable[Tile]) -> dict[Tile, PartFile | None]:
    """Return the parts of the finished tiles, None for tiles without cells.

    A damaged file is deleted; its tile must be built again.
    """
    parts: dict[Tile, PartFile | None] = {}
    for tile in tiles:
        path = folder / part_name(tile)
        if path.with_suffix(EMPTY).exists():
            parts[tile] = None
        elif path.exists():
            try:
                parts[tile] = describe_part(tile, open_database(path), path)
            except DatabaseError:
                path.unlink()
    return parts


def publish_tiles(folder: Path, parts: Sequence[PartFile]) -> Manifest:
    """Move a finished database to its final folder and replace it; parts are ordered by tile."""
    inputs = {file.name: digest(file) for file in sorted((folder / INPUTS).glob("*.parquet"))}
    manifest = Manifest(read_json(folder / RECIPE), tuple(parts), inputs)
    _require_replaceable(folder.with_name(folder.name.removesuffix(PARTIAL)))
    manifest.write(folder)
    names = {MANIFEST, RECIPE, INPUTS, *(part.file for part in manifest.parts)}
    target = finish(folder, keep=names)
    with contextlib.suppress(OSError):  # the database is in place, and the next run removes it
        (target / RECIPE).unlink()
    return manifest
