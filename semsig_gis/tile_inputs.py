"""What tiles are built from: files that can be read by box, known by their content."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from pyproj import CRS
from pyproj.exceptions import CRSError

from semsig_gis import __version__
from semsig_gis.boxes import NOWHERE, each_bounds
from semsig_gis.errors import SourceError
from semsig_gis.grid import cells_near
from semsig_gis.manifest import digest
from semsig_gis.objects import open_objects, save_objects
from semsig_gis.occlusion import TOLERANCE_M
from semsig_gis.schema import HALF_WIDTH
from semsig_gis.surroundings import read_surroundings, save_surroundings
from semsig_gis.tiles import TilePlan
from semsig_gis.unfinished import INPUTS, abandon, start
from semsig_gis.viewpoints import choose_viewpoints

if TYPE_CHECKING:
    from semsig_gis.grid import GridSpec
    from semsig_gis.signatures import SignatureSpec
    from semsig_gis.tiles import TileSpec
    from semsig_gis.viewpoints import ViewpointSpec

    Role = Literal["buildings", "streets"]

__all__ = ["plan_tiles"]


NEEDED = {"outdoor": "buildings", "streets": "streets"}


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
) -> TilePlan:
    """Check the inputs of a run, begin it or take it up again, and return the plan of its tiles.

    `objects` is a file of `semsig_gis.objects.save_objects`; `buildings` and `streets` are files
    that `semsig_gis.surroundings.read_surroundings` reads. Streets are needed by the viewpoints
    ``"streets"`` and left aside by others. Inputs that cannot be read by box are copied into the
    folder of the run. Raise SemsigError if an input is missing or cannot be used, or `out` cannot
    be written.
    """
    places = {"objects": objects, "buildings": buildings, "streets": streets}
    if viewpoints.mode != "streets":
        del places["streets"]
    paths = {name: Path(path).absolute() for name, path in places.items() if path is not None}
    nothing = open_objects(paths["objects"], box=NOWHERE)
    reach = float(nothing.taxonomy.ranges(spec.radius).max())
    cells_near(np.array([grid.origin]), grid=grid, radius=reach)  # refuses a step that is too small
    if viewpoints.mode != "all" and NEEDED[viewpoints.mode] not in paths:
        no_cells = np.empty(0, np.int64)
        choose_viewpoints(no_cells, no_cells, grid=grid, spec=viewpoints)  # says what is missing
    recipe: dict[str, Any] = {
        "version": __version__,
        "grid": asdict(grid),
        "signature": asdict(spec),
        "viewpoints": viewpoints.to_dict(),
        "occlusion": TOLERANCE_M if "buildings" in paths else None,
        "tile": {"cells": tile.cells(grid)},
        "inputs": {name: _fingerprint(path) for name, path in paths.items()},
    }
    folder = start(out, recipe)
    try:
        lines = _by_box(paths, "streets", nothing.crs, folder)
        return TilePlan(
            folder=folder,
            objects=_objects_by_box(paths["objects"], folder),
            buildings=_by_box(paths, "buildings", nothing.crs, folder),
            streets=lines,
            grid=grid,
            spec=spec,
            viewpoints=viewpoints,
            side=tile.cells(grid),
            reach=reach,
            street_reach=0.0 if lines is None else max(viewpoints.width, _widest(lines)),
        )
    except BaseException:
        abandon(folder)
        raise


def _fingerprint(path: Path) -> str:
    """Return the digest of a file, with its companions, or of a folder."""
    if path.is_dir():
        files = sorted(one for one in path.rglob("*") if one.is_file())
    elif path.suffix.lower() == ".shp":
        files = sorted(path.parent.glob(f"{path.stem}.*"))
    else:
        files = [path]
    try:
        return digest(*files)
    except OSError as error:
        msg = f"{path} does not exist or cannot be read; give another file."
        raise SourceError(msg) from error


def _objects_by_box(path: Path, folder: Path) -> Path:
    """Return a file of street objects that can be read by box; those of before have no bounds."""
    if next(each_bounds(path), None) is not None:
        return path
    copy = folder / INPUTS / "objects.parquet"
    if not copy.exists():
        save_objects(open_objects(path), copy)
    return copy


def _by_box(paths: dict[str, Path], role: Role, crs: CRS, folder: Path) -> Path | None:
    """Return a file of surroundings that can be read by box in a CRS."""
    path = paths.get(role)
    if path is None or _covered(path, crs):
        return path
    copy = folder / INPUTS / f"{role}.parquet"
    if not copy.exists():
        save_surroundings(read_surroundings(path, role=role, crs=crs), copy)
    return copy


def _covered(path: Path, crs: CRS) -> bool:
    """Tell whether a file is GeoParquet in this CRS with a column of bounds."""
    try:
        geo = json.loads(pq.read_metadata(path).metadata[b"geo"])
        column = geo["columns"][geo["primary_column"]]
        return "covering" in column and CRS.from_user_input(column["crs"]) == crs
    except (pa.ArrowException, OSError, LookupError, TypeError, ValueError, CRSError):
        return False


def _widest(streets: Path) -> float:
    """Return the largest half-width of any street in metres, 0 where the file tells none."""
    if HALF_WIDTH not in pq.read_schema(streets).names:
        return 0.0
    widths = pq.read_table(streets, columns=[HALF_WIDTH])[HALF_WIDTH].to_numpy()
    finite = widths[np.isfinite(widths.astype(np.float64))]
    return float(finite.max(initial=0.0))
