"""Building a signature database: what every cell sees, encoded."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core.errors import CrsError, EmptyResultError
from semsig_gis.core.grid import GridSpec, cells_near
from semsig_gis.core.rtree import PackedIndex
from semsig_gis.core.signature import SignatureSpec
from semsig_gis.database.database import BEARING_UNITS, DISTANCE_UNITS, SignatureDatabase
from semsig_gis.database.occlusion import Footprints, hidden
from semsig_gis.database.viewpoints import ViewpointSpec, choose_viewpoints
from semsig_gis.database.visibility import clockwise_order, visible_objects
from semsig_gis.objects.surroundings import licenses_of

if TYPE_CHECKING:
    from collections.abc import Callable

    import geopandas as gpd
    from numpy.typing import NDArray
    from pyproj import CRS

    from semsig_gis.database.visibility import Sightings
    from semsig_gis.objects.table import StreetObjects

    _Block = tuple[NDArray[np.int64], NDArray[np.uint8], NDArray[np.uint16], NDArray[np.uint8]]

# Lengths, codes, bearings and distances of no cell.
_NOTHING: _Block = (
    np.empty(0, np.int64),
    np.empty(0, np.uint8),
    np.empty(0, np.uint16),
    np.empty(0, np.uint8),
)


def build_database(
    objects: StreetObjects,
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
    objects : StreetObjects
        The objects of a city.
    grid : GridSpec, optional
        The cells; 10 m by default.
    spec : SignatureSpec, optional
        Visibility range and angle levels; 30 m and 16 by default.
    viewpoints : ViewpointSpec, optional
        Which cells are looked from; all by default.
    footprints : GeoDataFrame, optional
        Buildings (polygons) in any CRS; what they hide is not seen.
    streets : GeoDataFrame, optional
        Centre lines in any CRS; a column ``half_width`` holds metres where it is there.
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
        If footprints, streets or viewpoints cannot be used, or those that are needed are missing.
    CrsError
        If footprints or streets have no CRS.

    Notes
    -----
    Objects at most R away are sorted clockwise from north, ties nearer first (paper, section on
    semantic signatures).

    Examples
    --------
    >>> from semsig_gis.sources.synthetic.city import CitySpec, synthetic_city
    >>> from semsig_gis.sources.catalog import paper_taxonomy
    >>> from semsig_gis.objects.clean import build_objects
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> build_database(objects, spec=SignatureSpec(radius=20.0)).lengths.min() >= 1
    np.True_
    """
    grid = grid or GridSpec()
    spec = spec or SignatureSpec()
    reach = float(objects.taxonomy.ranges(spec.radius).max())
    columns, rows = cells_near(objects.xy, grid=grid, radius=reach)
    database = build_cells(
        objects,
        columns,
        rows,
        grid=grid,
        spec=spec,
        viewpoints=viewpoints,
        footprints=footprints,
        streets=streets,
        progress=progress,
    )
    if len(database) == 0:
        msg = (
            f"no cell sees any of the {len(objects):,} objects; make the step ({grid.step:g} m) "
            f"smaller or the visibility range ({spec.radius:g} m) larger, or look at the area, "
            "the streets and the buildings."
        )
        raise EmptyResultError(msg)
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
    progress: Callable[[int, int], None] | None = None,
) -> SignatureDatabase:
    """Compute the signatures of some cells; what they see must be among the objects.

    The cells are distinct and ordered by column and row; the result has those that are viewpoints
    and see something, possibly none. Further objects do no harm. `footprints` hide what is behind
    them; `streets` are centre lines, with half their width in metres in a column ``half_width``
    where it is there; both may be in any CRS. `progress` is called with the number of cells done
    and in all.

    Raise InputError if footprints, streets or viewpoints cannot be used or needed ones are missing,
    and CrsError if footprints or streets have no CRS.
    """
    viewpoints = viewpoints or ViewpointSpec()
    buildings = None if footprints is None else Footprints(_moved(footprints, objects.crs))
    chosen = choose_viewpoints(
        columns,
        rows,
        grid=grid,
        spec=viewpoints,
        footprints=buildings,
        streets=None if streets is None else _moved(streets, objects.crs),
        widths=None if streets is None else streets.get("half_width"),
    )
    columns, rows = columns[chosen], rows[chosen]
    along = streets if viewpoints.mode == "streets" else None
    by_class = objects.taxonomy.ranges(spec.radius)
    index = PackedIndex(objects.xy, objects.table.geometry.to_numpy())
    ranges = by_class[objects.codes]
    blocks = []
    for cells, seen in visible_objects(
        columns, rows, objects.xy, grid=grid, index=index, ranges=ranges
    ):
        centres = grid.viewpoints(columns[cells], rows[cells])
        block = _block(objects, centres, seen, reach=by_class.max(), footprints=buildings)
        blocks.append(block)
        if progress is not None:
            progress(cells.stop, len(columns))
    lengths, codes, bearing_units, distance_units = (
        np.concatenate(parts) for parts in zip(_NOTHING, *blocks, strict=True)
    )
    some = lengths > 0
    return SignatureDatabase(
        columns=columns[some].astype(np.int32),
        rows=rows[some].astype(np.int32),
        offsets=np.concatenate([[0], np.cumsum(lengths[some])]),
        codes=codes,
        bearing_units=bearing_units,
        distance_units=distance_units,
        grid=grid,
        spec=spec,
        taxonomy=objects.taxonomy,
        crs=objects.crs,
        licenses=(*map(str, objects.licenses), *licenses_of(footprints, along)),
        viewpoints=viewpoints,
        occlusion=None if buildings is None else buildings.tolerance,
    )


def _moved(table: gpd.GeoDataFrame, crs: CRS) -> NDArray[np.object_]:
    """Return the geometries of a table in a CRS."""
    if table.crs is None:
        msg = "buildings or streets have no coordinate reference system; state their crs."
        raise CrsError(msg)
    moved: NDArray[np.object_] = table.geometry.to_crs(crs).to_numpy()
    return moved


def _block(
    objects: StreetObjects,
    centres: NDArray[np.float64],
    seen: Sightings,
    *,
    reach: float,
    footprints: Footprints | None,
) -> _Block:
    """Return lengths, codes, bearings and distances of cells with these centres."""
    if footprints is not None:
        seen = seen.only(np.argsort(seen.viewpoint))  # as `hidden` is fastest
        ends = centres[seen.viewpoint], objects.xy[seen.object]
        seen = seen.only(~hidden(*ends, footprints=footprints))
    units = np.floor(seen.bearing * (BEARING_UNITS / 360.0))
    order = clockwise_order(seen, objects.codes)
    return (
        np.bincount(seen.viewpoint, minlength=len(centres)),
        objects.codes[seen.object][order],
        np.minimum(units, BEARING_UNITS - 1).astype(np.uint16)[order],
        np.rint(seen.distance * (DISTANCE_UNITS / reach)).astype(np.uint8)[order],
    )
