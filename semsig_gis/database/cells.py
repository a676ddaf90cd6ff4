"""Build a signature database: find the visible objects of every cell and encode them."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import shapely

from semsig_gis.core import (
    BEARING_UNITS,
    FULL_TURN,
    DistanceScale,
    EmptyResultError,
    GridSpec,
    InputError,
    PackedIndex,
    SignatureSpec,
    announce,
    cell_ids,
    cells_near,
    consecutive,
    require_memory,
    split_ids,
)
from semsig_gis.database.city import City
from semsig_gis.database.database import EXTENT_UNITS, SignatureDatabase
from semsig_gis.database.occlusion import TOLERANCE_M, Footprints
from semsig_gis.database.sightings import clockwise_order, landmark_tops, measure_sightings
from semsig_gis.database.store import ObjectStore, save_with_store
from semsig_gis.database.viewpoints import (
    ViewpointSpec,
    choose_viewpoints,
    reproject,
    select_elements,
)
from semsig_gis.objects import Loaded, StreetObjects, licenses_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import geopandas as gpd
    from numpy.typing import NDArray

    from semsig_gis.core import Taxonomy
    from semsig_gis.database.sightings import SightingPairs
    from semsig_gis.database.viewpoints import ViewpointMode

# The arrays of a block fit into the cache of a processor.
CELLS_PER_BLOCK = 1 << 14
PAIRS_PER_BLOCK = 1 << 20
LANDMARK_CELLS_M = 100.0
SQUARE_CELLS = 16  # side of the squares of cells for which the R-tree is searched
# Measured: bytes per block, cell and sighting until they are saved, and seconds per sighting
# without and with buildings.
BLOCK_BYTES, CELL_BYTES, PAIR_BYTES = 1e8, 100, 26
PAIR_S, HIDDEN_PAIR_S = 2e-7, 1e-6
MOST_PAIRS = 2**31 - 1  # limit of the offsets in a file
# More than any rounding error, so that only the measured distance decides.
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
    """Compute the signature of every cell from which at least one object is visible.

    Parameters
    ----------
    objects : StreetObjects or GeoDataFrame
        The objects of a city, or a table of OpenStreetMap elements with their tags, for example
        from osmnx (see `objects_from_frame`, which accepts other tables too).
    grid : GridSpec, optional
        The cells; 10 m by default.
    spec : SignatureSpec, optional
        Visibility range and angle levels; 30 m and 16 by default.
    viewpoints : ViewpointSpec, optional
        Which cells are viewpoints; all by default.
    footprints : GeoDataFrame, optional
        Buildings (polygons) in any CRS; objects that they hide are not visible.
    streets : GeoDataFrame, optional
        Centre lines in any CRS, with an optional column ``half_width`` of half widths in metres.
        In a table of OpenStreetMap elements, buildings and streets are selected as
        `read_surroundings` does.
    progress : callable, optional
        Called with the number of finished cells and of all cells.

    Returns
    -------
    SignatureDatabase
        Cells ordered by column and row.

    Raises
    ------
    EmptyResultError
        If no cell sees an object, for example because the step is much larger than the range, or
        no cell is a viewpoint.
    InputError
        If footprints, streets or viewpoints cannot be used, required ones are missing, or the
        sightings do not fit into memory.
    CrsError
        If footprints or streets have no CRS.

    Notes
    -----
    Objects within the visibility range are sorted clockwise from north, ties by distance (paper,
    section on semantic signatures).

    Examples
    --------
    >>> build_database(demo_objects, spec=SignatureSpec(radius=20.0)).lengths.min() >= 1
    np.True_
    """
    if not isinstance(objects, StreetObjects):
        from semsig_gis.objects import objects_from_frame  # noqa: PLC0415 - it takes 360 ms to load

        objects = objects_from_frame(objects)
    footprints = select_elements(footprints, "buildings")
    streets = select_elements(streets, "streets")
    grid, spec = grid or GridSpec(), spec or SignatureSpec()
    database = build_cells(
        objects,
        *cells_near(objects.xy, grid=grid, radius=cell_reach(objects.taxonomy, spec.radius)),
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


def build(
    data: Loaded | StreetObjects | gpd.GeoDataFrame,
    path: str | Path | None = None,
    *,
    step: float = 10.0,
    radius: float = 30.0,
    viewpoints: ViewpointMode | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> City:
    """Build the signature database of a city, as `semsig build` does.

    Parameters
    ----------
    data : Loaded, StreetObjects or GeoDataFrame
        What `load` returns: its buildings hide what is behind them. Or street objects, or a table
        of OpenStreetMap elements with their tags.
    path : str or Path, optional
        File to write (``.parquet``), with the folder of street objects next to it. Without, the
        city is only in memory.
    step : float, default 10
        Side of a cell in metres.
    radius : float, default 30
        Visibility range in metres of classes without their own.
    viewpoints : {"outdoor", "all", "streets"}, optional
        Which cells are viewpoints; by default those outdoor if there are buildings, otherwise all.
    progress : callable, optional
        Called with the number of finished cells and of all cells.

    Returns
    -------
    City
        The city. `build_database` has more options, and its errors are the same.

    Examples
    --------
    >>> from semsig_gis import build
    >>> city = build(demo_objects)
    >>> len(city.database) == len(demo_database)
    True
    """
    if path is not None and Path(path).suffix.lower() != ".parquet":
        raise InputError(f"{path} cannot be written; the name must end in .parquet.")
    tables = (data.buildings, data.streets) if isinstance(data, Loaded) else (None, None)
    buildings, streets = (None if table is None or table.empty else table for table in tables)
    objects = data.objects if isinstance(data, Loaded) else data
    if not isinstance(objects, StreetObjects):
        from semsig_gis.objects import objects_from_frame  # noqa: PLC0415 - it takes 360 ms to load

        objects = objects_from_frame(objects)
    database = build_database(
        objects,
        grid=GridSpec(step),
        spec=SignatureSpec(radius),
        viewpoints=ViewpointSpec(mode=viewpoints or ("all" if buildings is None else "outdoor")),
        footprints=buildings,
        streets=streets,
        progress=progress,
    )
    store = ObjectStore.of(objects, footprints=buildings, streets=streets)
    if path is not None:
        save_with_store(database, store, path)
    city = City(path)
    vars(city).update(database=database, store=store)
    return city


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
    """Compute the signatures of some cells; `objects` must include all that they can see.

    The cells are distinct and ordered by column and row. The result has the cells that are
    viewpoints and see an object, possibly none. If the cells are only a `partial` city, buildings
    and streets may be empty tables. All else is as in `build_database`.
    """
    viewpoints = viewpoints or ViewpointSpec()
    buildings = None
    if footprints is not None and not (partial and footprints.empty):
        buildings = Footprints.of(reproject(footprints, objects.crs))
    choice = viewpoints
    # Without a building nearby every cell is outdoor; without a street none is along one.
    surroundings = {"outdoor": footprints, "streets": streets}.get(viewpoints.mode)
    if partial and surroundings is not None and surroundings.empty:
        choice = replace(viewpoints, mode="all")
        if viewpoints.mode == "streets":
            columns, rows = columns[:0], rows[:0]
    mask = choose_viewpoints(
        columns,
        rows,
        grid=grid,
        spec=choice,
        footprints=buildings,
        streets=None if streets is None else reproject(streets, objects.crs).geometry.to_numpy(),
        widths=None if streets is None else streets.get("half_width"),
    )
    codes, ranges = objects.codes, objects.taxonomy.ranges(spec.radius)
    scale = DistanceScale.of(objects.taxonomy, spec.radius)
    count = int(mask.sum())
    share = count / max(len(mask), 1)
    expected = expected_pairs(ranges[codes], grid=grid, cells=count, share=share)
    require_room(expected, cells=count, objects=len(objects))
    if not partial:
        announce(expected * (PAIR_S if buildings is None else HIDDEN_PAIR_S), "building")
    columns, rows = columns[mask], rows[mask]
    tops = landmark_tops(objects)
    if tops is not None:
        # Cells farther from all objects would see only landmarks.
        near, _ = shapely.STRtree(np.asarray(shapely.points(objects.xy))).query_nearest(
            shapely.points(grid.viewpoints(columns, rows)),
            max_distance=cell_reach(objects.taxonomy, spec.radius),
            all_matches=False,
        )
        columns, rows = columns[near], rows[near]
    # Lengths, codes, bearings, distances and extents of each block; the first, empty block has the
    # types.
    kinds = (np.int64, np.uint8, np.uint16, np.uint8, np.uint8)
    blocks = [tuple(np.empty(0, kind) for kind in kinds)]
    for cells, pairs in sightings_by_block(
        columns,
        rows,
        objects.xy,
        grid=grid,
        ranges=ranges[codes],
        footprints=buildings,
        groups=objects.groups,
        tops=tops,
    ):
        order = clockwise_order(pairs, codes)
        units = np.floor(pairs.bearing * (BEARING_UNITS / 360.0))
        extent = np.empty(0) if pairs.extent is None else pairs.extent[order]
        blocks.append(
            (
                np.bincount(pairs.viewpoint, minlength=cells.stop - cells.start),
                codes[pairs.object][order],
                np.minimum(units, BEARING_UNITS - 1).astype(np.uint16)[order],
                scale.units(pairs.distance)[order],
                np.rint(extent * (EXTENT_UNITS / FULL_TURN)).astype(np.uint8),
            )
        )
        if progress is not None:
            progress(cells.stop, len(columns))
    lengths, seen_codes, bearing_units, distance_units, extent_units = (
        np.concatenate(parts) for parts in zip(*blocks, strict=True)
    )
    nonempty = lengths > 0
    return SignatureDatabase(
        columns=columns[nonempty].astype(np.int32),
        rows=rows[nonempty].astype(np.int32),
        offsets=np.append(0, np.cumsum(lengths[nonempty])),
        codes=seen_codes,
        bearing_units=bearing_units,
        distance_units=distance_units,
        extent_units=extent_units if extent_units.any() else None,
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


def cell_reach(taxonomy: Taxonomy, radius: float) -> float:
    """Return the largest distance in metres of a cell from an object, of any class.

    It is the longest range of the classes that are not tall. Where landmarks are seen, it is at
    least `LANDMARK_CELLS_M`: beyond, as in open country or at sea, few views are taken.
    """
    reach = taxonomy.near_reach(radius)
    return max(reach, LANDMARK_CELLS_M) if len(taxonomy.tall_codes) else reach


def expected_pairs(
    ranges: NDArray[np.float64], *, grid: GridSpec, cells: int, share: float = 1.0
) -> float:
    """Return the expected number of pairs of a cell and an object in range, at most all.

    `ranges` are the visibility ranges of the objects in metres, `share` is the share of the cells
    around them that are viewpoints.
    """
    in_range = math.pi * share * (ranges / grid.step) ** 2
    return float(np.minimum(in_range, float(cells)).sum())


def require_room(pairs: float, *, cells: int, objects: int, processes: int = 1) -> None:
    """Raise InputError if the sightings do not fit into memory or into one file.

    Each of `processes` builds that number of cells and pairs.
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


def sightings_by_block(
    columns: NDArray[np.int64],
    rows: NDArray[np.int64],
    objects: NDArray[np.float64],
    *,
    grid: GridSpec,
    ranges: NDArray[np.float64],
    footprints: Footprints | None = None,
    groups: NDArray[np.int32] | None = None,
    tops: NDArray[np.float64] | None = None,
) -> Iterator[tuple[slice, SightingPairs]]:
    """Yield the sightings from the centres of grid cells, block by block.

    The cells are distinct and ordered by column and row. `objects` are positions in metres;
    `ranges`, `groups` and `tops` are as in `measure_sightings`. Each block is a slice of the cells
    and their sightings in any order, with viewpoints counted from the first cell of the slice.
    """
    # Landmarks are few, and their range is long, so that they are searched apart.
    tall = np.zeros(len(objects), np.bool_) if tops is None else ~np.isnan(tops)
    parts = [np.flatnonzero(part) for part in (~tall, tall) if part.any()]
    indexes = [PackedIndex(objects[part]) for part in parts]
    starts = range(0, len(columns), CELLS_PER_BLOCK)
    blocks = [
        slice(start, min(start + CELLS_PER_BLOCK, len(columns))) for start in reversed(starts)
    ]
    while blocks:
        block = blocks.pop()
        cells = columns[block], rows[block]
        runs = [
            _cell_runs(*cells, objects[part], grid=grid, index=index, ranges=ranges[part])
            for part, index in zip(parts, indexes, strict=True)
        ]
        item = np.concatenate([part[run[0]] for part, run in zip(parts, runs, strict=True)])
        first, size = (np.concatenate([run[number] for run in runs]) for number in (1, 2))
        # Blocks with very many pairs are halved.
        if size.sum() > PAIRS_PER_BLOCK and block.stop - block.start > 1:
            middle = (block.start + block.stop) // 2
            blocks += [slice(middle, block.stop), slice(block.start, middle)]
            continue
        pairs = consecutive(first, size), np.repeat(item, size)
        centres = grid.viewpoints(*cells)
        yield (
            block,
            measure_sightings(
                *pairs,
                centres,
                objects,
                ranges=ranges,
                footprints=footprints,
                groups=groups,
                tops=tops,
            ),
        )


def _cell_runs(
    columns: NDArray[np.int64],
    rows: NDArray[np.int64],
    objects: NDArray[np.float64],
    *,
    grid: GridSpec,
    index: PackedIndex,
    ranges: NDArray[np.float64],
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return runs of cells in range of an object: the object, the first cell, the number of cells.

    The cells of one column that are in range of an object follow each other in the list of cells.
    """
    ids = cell_ids(columns, rows)
    # Squares of cells, clipped to this block; the R-tree returns the objects near each of them.
    square = np.stack(
        split_ids(np.unique(cell_ids(columns // SQUARE_CELLS, rows // SQUARE_CELLS))), axis=-1
    )
    low = np.maximum(square * SQUARE_CELLS, [columns[0], rows.min()])
    high = np.minimum((square + 1) * SQUARE_CELLS - 1, [columns[-1], rows.max()])
    furthest = ranges.max() / grid.step + ROUNDING_CELLS
    corners = grid.viewpoints(*(low - furthest).T), grid.viewpoints(*(high + furthest).T)
    box, item = index.pairs_in(*corners)

    # The columns in range of each object, then the rows in range in each column.
    place = (objects[item] - grid.origin) / grid.step - 0.5
    reach = ranges[item] / grid.step + ROUNDING_CELLS
    first = np.maximum(np.ceil(place[:, 0] - reach), low[box, 0]).astype(np.int64)
    last = np.minimum(np.floor(place[:, 0] + reach), high[box, 0]).astype(np.int64)
    size = np.maximum(last + 1 - first, 0)
    pair, column = np.repeat(np.arange(len(size)), size), consecutive(first, size)
    half = np.sqrt(np.maximum(reach[pair] ** 2 - (column - place[pair, 0]) ** 2, 0.0))
    first = np.maximum(np.ceil(place[pair, 1] - half), low[box[pair], 1])
    last = np.minimum(np.floor(place[pair, 1] + half), high[box[pair], 1])
    # Two searches find the run in the list of cells, which may have gaps.
    begin = np.searchsorted(ids, cell_ids(column, first))
    end = np.searchsorted(ids, cell_ids(column, last), side="right")
    return item[pair], begin, np.maximum(end - begin, 0)
