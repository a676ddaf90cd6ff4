"""Building a signature database: what every cell sees, encoded."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from semsig_gis.core.errors import CrsError, EmptyResultError, InputError
from semsig_gis.core.geometry import GridSpec, cell_ids, cells_near, consecutive, split_ids
from semsig_gis.core.resources import announce, require_memory
from semsig_gis.core.rtree import PackedIndex
from semsig_gis.core.signature import BEARING_UNITS, SignatureSpec, distance_units_of
from semsig_gis.database.database import SignatureDatabase
from semsig_gis.database.occlusion import TOLERANCE_M, Footprints
from semsig_gis.database.sightings import ViewpointSpec, clockwise_order, sightings
from semsig_gis.database.viewpoints import choose_viewpoints
from semsig_gis.objects.table import StreetObjects, licenses_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import geopandas as gpd
    from numpy.typing import NDArray
    from pyproj import CRS

    from semsig_gis.database.sightings import Sightings

# So many that the arrays of a block stay in the cache of a processor.
CELLS_A_BLOCK = 1 << 14
PAIRS_A_BLOCK = 1 << 20
TILE_CELLS = 16
# Measured: bytes of a block, of a cell and of a sighting until they are saved, and seconds of a
# sighting in the open and among buildings.
BLOCK_BYTES, CELL_BYTES, PAIR_BYTES = 1e8, 100, 26
PAIR_S, HIDDEN_PAIR_S = 2e-7, 1e-6
MOST_PAIRS = 2**31 - 1  # that a file counts
# More than any rounding, so that the measured distance decides alone.
ROUNDING_CELLS = 1e-3


def build_database(
    objects: StreetObjects | gpd.GeoDataFrame,
    *,
    grid: GridSpec | None = None,
    spec: SignatureSpec | None = None,
    viewpoints: ViewpointSpec | None = None,
    footprints: gpd.GeoDataFrame | None = None,
    streets: gpd.GeoDataFrame | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> SignatureDatabase:
    """Compute the signature of every cell that sees at least one object.

    Parameters
    ----------
    objects : StreetObjects or GeoDataFrame
        The objects of a city, or a table of OpenStreetMap's elements with their tags, such as of
        osmnx (see `objects_from_frame`, which takes other tables too).
    grid : GridSpec, optional
        The cells; 10 m by default.
    spec : SignatureSpec, optional
        Visibility range and angle levels; 30 m and 16 by default.
    viewpoints : ViewpointSpec, optional
        Which cells are looked from; all by default.
    footprints : GeoDataFrame, optional
        Buildings (polygons) in any CRS; what they hide is not seen.
    streets : GeoDataFrame, optional
        Centre lines in any CRS, with their half widths in metres in a column ``half_width`` if
        there is one. From a table of OpenStreetMap's elements, buildings and streets are taken as
        `read_surroundings` finds them.
    progress : callable, optional
        Called with the number of cells done and in all.

    Returns
    -------
    SignatureDatabase
        Cells ordered by column and row.

    Raises
    ------
    EmptyResultError
        If no cell sees an object, as when the step is much larger than the range, or no cell is
        a viewpoint.
    InputError
        If footprints, streets or viewpoints cannot be used, those that are needed are missing, or
        the memory does not hold what there is to see.
    CrsError
        If footprints or streets have no CRS.

    Notes
    -----
    Objects at most R away are sorted clockwise from north, ties nearer first (paper, section on
    semantic signatures).

    Examples
    --------
    >>> build_database(demo_objects, spec=SignatureSpec(radius=20.0)).lengths.min() >= 1
    np.True_
    """
    if not isinstance(objects, StreetObjects):
        from semsig_gis.objects.from_geodataframe import objects_from_frame  # noqa: PLC0415 - it loads slowly

        objects = objects_from_frame(objects)
    footprints, streets = elements_of(footprints, "buildings"), elements_of(streets, "streets")
    grid, spec = grid or GridSpec(), spec or SignatureSpec()
    reach = float(objects.taxonomy.ranges(spec.radius).max())
    database = build_cells(
        objects,
        *cells_near(objects.xy, grid=grid, radius=reach),
        grid=grid,
        spec=spec,
        viewpoints=viewpoints,
        footprints=footprints,
        streets=streets,
        progress=progress,
    )
    if len(database) == 0:
        raise EmptyResultError(
            f"no cell sees any of the {len(objects):,} objects; make the step ({grid.step:g} m) "
            f"smaller or the visibility range ({spec.radius:g} m) larger, or check the area, "
            "the streets and the buildings."
        )
    return database


def build_cells(
    objects: StreetObjects,
    columns: NDArray[np.int64],
    rows: NDArray[np.int64],
    *,
    grid: GridSpec,
    spec: SignatureSpec,
    viewpoints: ViewpointSpec | None = None,
    footprints: gpd.GeoDataFrame | None = None,
    streets: gpd.GeoDataFrame | None = None,
    partial: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> SignatureDatabase:
    """Compute the signatures of some cells; what they see must be among the objects.

    The cells are distinct and ordered by column and row; the result has those that are viewpoints
    and see something, possibly none. `partial` cells are some of a city: no building or street need
    be near them, so their tables may be empty. All else is as in `build_database`.
    """
    viewpoints = viewpoints or ViewpointSpec()
    buildings = None
    if footprints is not None and not (partial and footprints.empty):
        buildings = Footprints(moved(footprints, objects.crs).geometry.to_numpy())
    choice = viewpoints
    chosen_by = {"outdoor": footprints, "streets": streets}.get(viewpoints.mode)
    if partial and chosen_by is not None and chosen_by.empty:
        choice = replace(viewpoints, mode="all")
        if viewpoints.mode == "streets":
            columns, rows = columns[:0], rows[:0]
    chosen = choose_viewpoints(
        columns,
        rows,
        grid=grid,
        spec=choice,
        footprints=buildings,
        streets=None if streets is None else moved(streets, objects.crs).geometry.to_numpy(),
        widths=None if streets is None else streets.get("half_width"),
    )
    codes, ranges = objects.codes, objects.taxonomy.ranges(spec.radius)
    count = int(chosen.sum())
    share = count / max(len(chosen), 1)
    pairs = expected_pairs(ranges[codes], grid=grid, cells=count, share=share)
    require_room(pairs, cells=count, objects=len(objects))
    if not partial:
        announce(pairs * (PAIR_S if buildings is None else HIDDEN_PAIR_S), "building")
    columns, rows = columns[chosen], rows[chosen]
    # Lengths, codes, bearings and distances, block by block; the first is that of no cell.
    blocks = [tuple(np.empty(0, kind) for kind in (np.int64, np.uint8, np.uint16, np.uint8))]
    for cells, seen in visible_objects(
        columns,
        rows,
        objects.xy,
        grid=grid,
        index=PackedIndex(objects.xy),
        ranges=ranges[codes],
        footprints=buildings,
    ):
        order = clockwise_order(seen, codes)
        turned = np.floor(seen.bearing * (BEARING_UNITS / 360.0))
        blocks.append(
            (
                np.bincount(seen.viewpoint, minlength=cells.stop - cells.start),
                codes[seen.object][order],
                np.minimum(turned, BEARING_UNITS - 1).astype(np.uint16)[order],
                distance_units_of(seen.distance, ranges.max())[order],
            )
        )
        if progress is not None:
            progress(cells.stop, len(columns))
    lengths, seen_codes, bearing_units, distance_units = (
        np.concatenate(parts) for parts in zip(*blocks, strict=True)
    )
    some = lengths > 0
    return SignatureDatabase(
        columns=columns[some].astype(np.int32),
        rows=rows[some].astype(np.int32),
        offsets=np.append(0, np.cumsum(lengths[some])),
        codes=seen_codes,
        bearing_units=bearing_units,
        distance_units=distance_units,
        grid=grid,
        spec=spec,
        taxonomy=objects.taxonomy,
        crs=objects.crs,
        licenses=(
            *map(str, objects.licenses),
            *licenses_of(footprints, streets if viewpoints.mode == "streets" else None),
        ),
        viewpoints=viewpoints,
        occlusion=None if footprints is None else TOLERANCE_M,
        notes=objects.notes,
    )


def expected_pairs(
    ranges: NDArray[np.float64], *, grid: GridSpec, cells: int, share: float = 1.0
) -> float:
    """Return how many pairs of a cell and an object in range to expect, at most all.

    `ranges` are those of the objects in metres, `share` the part of the cells around them that are
    viewpoints.
    """
    in_range = math.pi * float(((ranges / grid.step) ** 2).sum())
    return min(in_range * share, float(cells) * len(ranges))


def require_room(pairs: float, *, cells: int, objects: int, processes: int = 1) -> None:
    """Refuse to build what the memory does not hold, or one file cannot count.

    So many `processes` build as many cells and pairs each.
    """
    what = f"{objects:,} objects seen from {cells:,} cells (about {pairs:,.0f} sightings)"
    advice = "make the step larger, the visibility range smaller, or build in smaller tiles"
    if pairs > MOST_PAIRS:
        raise InputError(
            f"{what} are more than the {MOST_PAIRS:,} that one file can contain; {advice}."
        )
    needed = BLOCK_BYTES + CELL_BYTES * cells + PAIR_BYTES * pairs
    if processes > 1:
        what += f" by each of {processes} processes"
    require_memory(processes * needed, what, advice=advice)


def elements_of(
    table: gpd.GeoDataFrame | None, role: Literal["buildings", "streets"]
) -> gpd.GeoDataFrame | None:
    """Return what a table is, or what of OpenStreetMap's elements in it (see `elements_in`)."""
    if table is None:
        return None
    from semsig_gis.objects.surroundings import elements_in  # noqa: PLC0415 - it loads slowly

    return elements_in(table, role)


def moved(table: gpd.GeoDataFrame, crs: CRS) -> gpd.GeoDataFrame:
    """Return buildings or streets in a CRS; raise CrsError if theirs is not known."""
    if table.crs is None:
        raise CrsError("buildings or streets have no coordinate reference system; state their crs.")
    return table.to_crs(crs)


def visible_objects(
    columns: NDArray[np.int64],
    rows: NDArray[np.int64],
    objects: NDArray[np.float64],
    *,
    grid: GridSpec,
    index: PackedIndex,
    ranges: NDArray[np.float64],
    footprints: Footprints | None = None,
) -> Iterator[tuple[slice, Sightings]]:
    """Yield what is seen from the centres of grid cells, block by block.

    The cells are distinct and ordered by column and row. `index` is an R-tree over `objects`,
    positions in metres; `ranges` tells from how far each object is seen, in metres. Each block is a
    slice of the cells and what is seen from these, viewpoints counted from the first, in any order.
    """
    starts = range(0, len(columns), CELLS_A_BLOCK)
    blocks = [slice(start, min(start + CELLS_A_BLOCK, len(columns))) for start in reversed(starts)]
    while blocks:
        block = blocks.pop()
        here = columns[block], rows[block]
        item, first, size = _runs(*here, objects, grid=grid, index=index, ranges=ranges)
        if size.sum() > PAIRS_A_BLOCK and block.stop - block.start > 1:
            middle = (block.start + block.stop) // 2
            blocks += [slice(middle, block.stop), slice(block.start, middle)]
            continue
        pairs = consecutive(first, size), np.repeat(item, size)
        centres = grid.viewpoints(*here)
        yield block, sightings(*pairs, centres, objects, ranges=ranges, footprints=footprints)


def _runs(
    columns: NDArray[np.int64],
    rows: NDArray[np.int64],
    objects: NDArray[np.float64],
    *,
    grid: GridSpec,
    index: PackedIndex,
    ranges: NDArray[np.float64],
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return objects, and the first and the number of the cells of a column that may see each.

    The R-tree tells which objects are near each tile of cells. The cells of one column that see an
    object follow each other, so that two searches in the list of cells find them all.
    """
    ids = cell_ids(columns, rows)
    # Tiles, and the corners of the part of them that is in this block.
    tile = np.stack(
        split_ids(np.unique(cell_ids(columns // TILE_CELLS, rows // TILE_CELLS))), axis=-1
    )
    low = np.maximum(tile * TILE_CELLS, [columns[0], rows.min()])
    high = np.minimum((tile + 1) * TILE_CELLS - 1, [columns[-1], rows.max()])
    furthest = ranges.max() / grid.step + ROUNDING_CELLS
    corners = grid.viewpoints(*(low - furthest).T), grid.viewpoints(*(high + furthest).T)
    box, item = index.pairs_in(*corners)

    # The columns in reach of each object, then the rows in each of them.
    place = (objects[item] - grid.origin) / grid.step - 0.5
    reach = ranges[item] / grid.step + ROUNDING_CELLS
    first = np.maximum(np.ceil(place[:, 0] - reach), low[box, 0]).astype(np.int64)
    last = np.minimum(np.floor(place[:, 0] + reach), high[box, 0]).astype(np.int64)
    size = np.maximum(last + 1 - first, 0)
    pair, column = np.repeat(np.arange(len(size)), size), consecutive(first, size)
    half = np.sqrt(np.maximum(reach[pair] ** 2 - (column - place[pair, 0]) ** 2, 0.0))
    first = np.maximum(np.ceil(place[pair, 1] - half), low[box[pair], 1])
    last = np.minimum(np.floor(place[pair, 1] + half), high[box[pair], 1])
    begin = np.searchsorted(ids, cell_ids(column, first))
    end = np.searchsorted(ids, cell_ids(column, last), side="right")
    return item[pair], begin, np.maximum(end - begin, 0)
