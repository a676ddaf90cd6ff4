"""From the rows that a reader collects to a `RawLayer`: geometries built and checked at once."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import geopandas as gpd
import numpy as np
import pandas as pd
import shapely

from semsig_gis.errors import CrsError
from semsig_gis.schema import CLASS_NAME, HALF_WIDTH, SOURCE_ID
from semsig_gis.sources import RawLayer
from semsig_gis.sources._crs import crs_label, fits_the_globe, off_the_globe

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray
    from pyproj import CRS

    from semsig_gis.layer_spec import LayerSpec

KINDS = {
    "point": ("Point", "MultiPoint"),
    "line": ("LineString", "LinearRing", "MultiLineString"),
    "polygon": ("Polygon", "MultiPolygon"),
}
ERRORS_KEPT = 10
# Rows of one id farther apart than this are told of: about a metre, by unit of the CRS.
APART_DEGREES, APART_METRES = 1e-5, 1.0

# A point as its two coordinates, so that all points are built at once; else a built geometry.
Position = tuple[float, float] | shapely.Geometry | None


class Row(NamedTuple):
    """A row that is wanted and, so far, good."""

    number: int  # from 1, in the order of the file
    class_name: str
    source_id: str
    position: Position
    half_width: float = math.nan  # metres; of streets


@dataclass(slots=True)
class Rows:
    """What a reader has seen so far of a layer: how many rows, and those that are wanted.

    `filtered` counts rows that the filter leaves out; `errors` says what is wrong with others.
    """

    read: int = 0
    filtered: int = 0
    kept: list[Row] = field(default_factory=list)
    errors: dict[int, str] = field(default_factory=dict)  # by number of the row

    def refuse(self, bad: Mapping[int, str]) -> None:
        """Move rows from the kept ones to the errors."""
        self.errors.update(bad)
        self.kept = [row for row in self.kept if row.number not in bad]


def raw_layer(
    rows: Rows,
    spec: LayerSpec,
    crs: CRS,
    *,
    by_file: bool,
    where: str,
    notes: tuple[str, ...] = (),
) -> RawLayer:
    """Build the geometries of a layer and check them against its CRS and its specification.

    Rows with impossible coordinates are refused in place. `by_file` says whether the file itself
    states the CRS. CrsError if that is in degrees and most coordinates cannot be.
    """
    geometry = _geometries(rows)
    geometry = _on_globe(rows, geometry, crs, where=where, by_file=by_file)
    duplicates = 0
    if spec.unique_id:
        apart = APART_DEGREES if crs.is_geographic else APART_METRES
        geometry, duplicates, more = _one_of_each_id(rows, geometry, apart=apart)
        notes += more
    if crs.is_projected and not by_file and fits_the_globe(shapely.get_coordinates(geometry)):
        notes += (f"the coordinates look like degrees, yet {crs_label(crs)} is stated",)
    columns: dict[str, pd.Series[Any]] = {
        CLASS_NAME: pd.Series([row.class_name for row in rows.kept], dtype="str"),
        SOURCE_ID: pd.Series([row.source_id for row in rows.kept], dtype="str"),
    }
    if spec.has_width:
        columns[HALF_WIDTH] = pd.Series([row.half_width for row in rows.kept], dtype="float64")
    first_errors = sorted(rows.errors.items())[:ERRORS_KEPT]
    return RawLayer(
        spec=spec,
        table=gpd.GeoDataFrame(columns, geometry=geometry, crs=crs),
        read=rows.read,
        filtered=rows.filtered,
        errors=tuple(f"row {number}: {message}" for number, message in first_errors),
        error_count=len(rows.errors),
        notes=(*notes, *_surprises(rows, geometry, spec)),
        duplicates=duplicates,
    )


def _geometries(rows: Rows) -> NDArray[np.object_]:
    """Build the geometries of the kept rows; those that are not finite are refused."""
    geometry = np.empty(len(rows.kept), dtype=object)
    points = []
    for index, row in enumerate(rows.kept):
        if isinstance(row.position, tuple):
            points.append(index)
        else:
            geometry[index] = row.position
    if points:
        geometry[points] = shapely.points(np.array([rows.kept[index].position for index in points]))
    xy, owner = shapely.get_coordinates(geometry, return_index=True)
    wrong = ~np.isfinite(xy).all(axis=1)
    return _without(rows, geometry, owner[wrong], xy[wrong], "are not finite")


def _on_globe(
    rows: Rows, geometry: NDArray[np.object_], crs: CRS, *, where: str, by_file: bool
) -> NDArray[np.object_]:
    """Refuse rows that cannot be longitudes and latitudes where they must be.

    A few are bad rows; if they are most of the layer, then it is the CRS that is wrong.
    """
    xy, owner = shapely.get_coordinates(geometry, return_index=True)
    wrong = off_the_globe(xy, crs)
    if 2 * wrong.sum() > len(xy):
        x, y = xy[wrong][0]
        remedy = "correct the file" if by_file else "state the crs they are in, such as 'EPSG:2154'"
        msg = (
            f"{where} has coordinates such as ({x:.12g}, {y:.12g}), which are not the degrees that "
            f"{crs_label(crs)} means; {remedy}."
        )
        raise CrsError(msg)
    return _without(rows, geometry, owner[wrong], xy[wrong], f"are not in {crs_label(crs)}")


def _without(
    rows: Rows,
    geometry: NDArray[np.object_],
    indices: NDArray[np.intp],
    xy: NDArray[np.float64],
    what: str,
) -> NDArray[np.object_]:
    """Refuse the rows of these indices, for the coordinates beside them."""
    bad = {
        rows.kept[index].number: f"its coordinates ({x:.12g}, {y:.12g}) {what}"
        for index, (x, y) in zip(indices[::-1], xy[::-1], strict=True)  # the first one stays
    }
    if not bad:
        return geometry
    rows.refuse(bad)
    return np.delete(geometry, indices)


def _one_of_each_id(
    rows: Rows, geometry: NDArray[np.object_], *, apart: float
) -> tuple[NDArray[np.object_], int, tuple[str, ...]]:
    """Keep the first row of every id, but one that has a position rather than one that has none."""
    ids = pd.Series([row.source_id for row in rows.kept], dtype="str")
    nowhere = shapely.is_missing(geometry) | shapely.is_empty(geometry)
    ranked = ids.iloc[np.argsort(nowhere, kind="stable")]
    firsts = ranked[ranked != ""].drop_duplicates()
    repeated = ranked.index[ranked.duplicated() & (ranked != "")].to_numpy(np.intp)
    if not len(repeated):
        return geometry, 0, ()
    first_of = pd.Series(firsts.index, index=firsts).loc[ids[repeated]].to_numpy(np.intp)
    distances = shapely.distance(geometry[repeated], geometry[first_of])
    far = int((distances > apart).sum())  # NaN where there is no position
    rows.kept = [rows.kept[index] for index in np.delete(np.arange(len(ids)), repeated)]
    note = f"{far} rows have the id of a row that stands elsewhere; the first one's place is used"
    return np.delete(geometry, repeated), len(repeated), (note,) if far else ()


def _surprises(rows: Rows, geometry: NDArray[np.object_], spec: LayerSpec) -> tuple[str, ...]:
    """Return where a layer is not what its specification expects."""
    notes = []
    if rows.read == 0:
        notes.append("the layer has no rows")
    elif spec.rows is not None and not spec.rows[0] <= rows.read <= spec.rows[1]:
        least, most = spec.rows
        notes.append(f"the layer has {rows.read} rows, and {least} to {most} were expected")
    types = pd.Series([item.geom_type for item in geometry if item is not None], dtype="str")
    others = types[~types.isin(KINDS[spec.geometry])]
    if len(others):
        names = ", ".join(sorted(others.unique()))
        notes.append(f"{len(others)} of {rows.read} rows are {names}, not {spec.geometry}")
    unknown = sum(math.isnan(row.half_width) for row in rows.kept) if spec.has_width else 0
    if unknown:
        notes.append(f"{unknown} of {len(rows.kept)} streets have no known width")
    return tuple(notes)
