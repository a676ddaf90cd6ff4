"""Tiles: building a signature database square by square, each from what lies near it alone."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import shapely

from semsig_gis.boxes import each_bounds
from semsig_gis.building import build_cells
from semsig_gis.database_file import save_database
from semsig_gis.errors import InputError
from semsig_gis.grid import GridSpec, cell_ids, cells_near, split_ids
from semsig_gis.manifest import part_name
from semsig_gis.objects import open_objects
from semsig_gis.occlusion import TOLERANCE_M
from semsig_gis.signatures import SignatureSpec
from semsig_gis.surroundings import licenses_of, read_surroundings
from semsig_gis.unfinished import describe, mark_empty
from semsig_gis.viewpoints import ViewpointSpec

if TYPE_CHECKING:
    from pathlib import Path

    import geopandas as gpd
    from pyproj import CRS

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.manifest import Part
    from semsig_gis.objects import StreetObjects

    Tile = tuple[int, int]
    Box = tuple[float, float, float, float]

__all__ = ["TilePlan", "TileSpec", "build_tile", "touched_tiles"]

# Beyond the range: for rounding, and for walls as near as occlusion.GAP_M and TOLERANCE_M look.
MARGIN_M = 2.0
# Tiles that one object may touch in a row, and tiles in all.
MOST_REACHED = 16
MOST_TILES = 1_000_000


@dataclass(frozen=True, slots=True)
class TileSpec:
    """How a database is cut into tiles.

    Parameters
    ----------
    side : float, default 2000
        Side of a tile in metres; it is rounded to whole cells, at least one.

    Raises
    ------
    InputError
        If the side is not a number of metres above 0.

    Examples
    --------
    >>> TileSpec(side=104.0).cells(GridSpec(step=10.0))
    10
    """

    side: float = 2000.0

    def __post_init__(self) -> None:  # noqa: D105
        if not (math.isfinite(self.side) and self.side > 0):
            msg = f"the side of a tile is {self.side} m; give a number of metres above 0."
            raise InputError(msg)

    def cells(self, grid: GridSpec) -> int:
        """Return the side in cells.

        Parameters
        ----------
        grid : GridSpec
            The cells.

        Returns
        -------
        int
            At least 1.
        """
        return max(1, round(self.side / grid.step))


@dataclass(frozen=True, slots=True, kw_only=True)
class TilePlan:
    """All that is needed to build any tile: paths and specs, so that it travels lightly.

    Part files are written to `folder`. `objects` is a file of `semsig_gis.objects.save_objects`,
    `buildings` and `streets` are files of `semsig_gis.surroundings.save_surroundings` in the same
    CRS. `side` is that of a tile in cells; `reach` is the largest visibility range of any class,
    and `street_reach` how far the widest street reaches from its centre line, both in metres.
    """

    folder: Path
    objects: Path
    buildings: Path | None = None
    streets: Path | None = None
    grid: GridSpec = GridSpec()  # noqa: RUF009 - it is frozen
    spec: SignatureSpec = SignatureSpec()  # noqa: RUF009
    viewpoints: ViewpointSpec = ViewpointSpec()  # noqa: RUF009
    side: int
    reach: float
    street_reach: float = 0.0

    def box(self, tile: Tile, margin: float) -> Box:
        """Return ``xmin, ymin, xmax, ymax`` of a tile, widened by `margin` metres on each side."""
        side = self.side * self.grid.step
        west, south = (
            start + place * side for start, place in zip(self.grid.origin, tile, strict=True)
        )
        return west - margin, south - margin, west + side + margin, south + side + margin


def touched_tiles(path: str | Path, *, grid: GridSpec, side: int, reach: float) -> list[Tile]:
    """Return the tiles that may have a cell from which some object is seen, fullest first.

    Only the bounds in the file of objects are read. `side` is that of a tile in cells, `reach` the
    largest visibility range of any class in metres. Raise InputError if tiles are so small that an
    object would touch very many, or if there are too many.
    """
    metres = side * grid.step
    if reach > MOST_REACHED * metres:
        msg = (
            f"a tile of {metres:g} m is too small for a visibility range of {reach:g} m; make it "
            f"at least {reach / MOST_REACHED:g} m."
        )
        raise InputError(msg)
    objects: Counter[int] = Counter()
    for bounds in each_bounds(path):
        widened = bounds + np.array([-reach, -reach, reach, reach])
        places = np.floor((widened - np.tile(grid.origin, 2)) / metres).astype(np.int64)
        ranges, count = np.unique(places, axis=0, return_counts=True)
        width, height = (ranges[:, 2:] - ranges[:, :2] + 1).T
        which = np.repeat(np.arange(len(ranges)), width * height)
        inside = np.arange(len(which)) - np.repeat(
            np.cumsum(width * height) - width * height, width * height
        )
        ids = cell_ids(
            ranges[which, 0] + inside // height[which], ranges[which, 1] + inside % height[which]
        )
        distinct, row = np.unique(ids, return_inverse=True)
        total = np.bincount(row, weights=count[which]).astype(np.int64)
        objects.update(dict(zip(distinct.tolist(), total.tolist(), strict=True)))
        if len(objects) > MOST_TILES:
            msg = f"tiles of {metres:g} m would be more than {MOST_TILES:,}; make them larger."
            raise InputError(msg)
    ordered = sorted(objects, key=lambda number: (-objects[number], number))
    columns, rows = split_ids(np.array(ordered, np.int64))
    return list(zip(columns.tolist(), rows.tolist(), strict=True))


def build_tile(plan: TilePlan, tile: Tile) -> Part | None:
    """Build and save the part of one tile; return None where none of its cells sees anything.

    What decides about a cell lies within the largest range of it: objects, and buildings together
    with their neighbours; a street lies within its own width. So only that is read, and the cells
    are the same as when everything is.
    """
    if not plan.folder.is_dir():
        msg = f"{plan.folder} is not there any more; run the same command again."
        raise InputError(msg)
    objects = open_objects(plan.objects, box=plan.box(tile, plan.reach + MARGIN_M))
    database = _seen_from(plan, tile, objects) if len(objects) else None
    if database is None or len(database) == 0:
        mark_empty(plan.folder, tile)
        return None
    path = plan.folder / part_name(tile)
    save_database(database, path)
    return describe(tile, database, path)


def _seen_from(plan: TilePlan, tile: Tile, objects: StreetObjects) -> SignatureDatabase | None:
    """Return the cells of a tile; None where it has surely none."""
    columns, rows = cells_near(objects.xy, grid=plan.grid, radius=plan.reach)
    inside = (columns // plan.side == tile[0]) & (rows // plan.side == tile[1])
    streets = None
    viewpoints = plan.viewpoints
    if plan.streets is not None:
        box = plan.box(tile, plan.street_reach + MARGIN_M)
        streets = read_surroundings(plan.streets, role="streets", crs=objects.crs, box=box)
        if streets.empty:
            return None
    footprints = None
    if plan.buildings is not None:
        footprints = _footprints(plan.buildings, plan.box(tile, plan.reach + MARGIN_M), objects.crs)
        if footprints.empty and viewpoints.mode == "outdoor":
            viewpoints = replace(viewpoints, mode="all")
    database = build_cells(
        objects,
        columns[inside],
        rows[inside],
        grid=plan.grid,
        spec=plan.spec,
        viewpoints=viewpoints,
        footprints=None if footprints is None or footprints.empty else footprints,
        streets=streets,
    )
    # A tile without buildings was made in the same way as the others.
    return replace(
        database,
        viewpoints=plan.viewpoints,
        occlusion=None if footprints is None else TOLERANCE_M,
        licenses=(*objects.licenses, *licenses_of(footprints, streets)),
    )


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
