"""Street objects: raw layers become one checked table of points in a metric CRS."""

from __future__ import annotations

import functools
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import shapely

from semsig_gis import __version__
from semsig_gis.boxes import BBOX, COVERING, GROUP_ROWS, bounds_column, hilbert_order, rows_meeting
from semsig_gis.errors import CrsError, DatabaseError, EmptyResultError
from semsig_gis.schema import (
    CLASS_CODE,
    CLASS_NAME,
    COUNT,
    GEOMETRY,
    MERGED,
    SOURCE,
    SOURCE_ID,
    require_metric_crs,
)
from semsig_gis.storage import geo_metadata, read_geoparquet, write_geoparquet
from semsig_gis.taxonomy import Taxonomy

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence
    from pathlib import Path

    from numpy.typing import NDArray
    from pyproj import CRS

    from semsig_gis.sources import RawLayer

__all__ = [
    "LayerReport",
    "LoadReport",
    "StreetObjects",
    "build_objects",
    "license_lines",
    "objects_of",
    "objects_specs",
    "open_objects",
    "save_objects",
]

KIND = "street objects"
# Two objects of a class within the same centimetre are one object listed twice.
SAME_PLACE_M = 0.01
# Larger than any projected coordinate; files write -1.8e308 and the like for "no value".
BEYOND_EARTH_M = 1e8


@dataclass(frozen=True, eq=False)
class StreetObjects:
    """The street objects of a city.

    Parameters
    ----------
    table : GeoDataFrame
        One row an object: ``class_code`` (uint8), ``source`` (layer name), ``source_id``,
        ``count`` (rows of the sources that were collapsed into it) and ``geometry`` (point in a
        metric CRS). After `semsig_gis.conflation.conflate` also ``merged``: what other sources
        say of the same object, as ``"source:id; source:id"``, or empty.
    taxonomy : Taxonomy
        The classes that the codes belong to.
    licenses : tuple of str
        One line for every publisher and licence: who, under what, which layers.

    Examples
    --------
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> objects.xy.shape == (len(objects), 2)
    True
    """

    table: gpd.GeoDataFrame
    taxonomy: Taxonomy
    licenses: tuple[str, ...]

    def __len__(self) -> int:  # noqa: D105
        return len(self.table)

    @property
    def crs(self) -> CRS:
        """Metric coordinate reference system of the positions."""
        crs: CRS = self.table.crs
        return crs

    @property
    def codes(self) -> NDArray[np.uint8]:
        """Class code of every object, shape (n,)."""
        codes: NDArray[np.uint8] = self.table[CLASS_CODE].to_numpy(np.uint8)
        return codes

    @property
    def class_counts(self) -> dict[int, int]:
        """How many objects of each class code there are, of those that there are."""
        codes, counts = np.unique(self.codes, return_counts=True)
        return dict(zip(codes.tolist(), counts.tolist(), strict=True))

    @functools.cached_property
    def xy(self) -> NDArray[np.float64]:
        """Position of every object in metres, shape (n, 2)."""
        xy: NDArray[np.float64] = shapely.get_coordinates(self.table.geometry.array)
        xy.setflags(write=False)
        return xy


@dataclass(frozen=True, slots=True, kw_only=True)
class LayerReport:
    """What became of the rows of one layer; the numbers add up to `read`.

    Rows are dropped as `unreadable`, `filtered` (by the catalogue's filter), `missing` (no
    geometry, or an empty one), `duplicates` (the id of an earlier row, where the catalogue says
    that ids are unique), `misplaced` (no finite coordinates in the metric CRS, or off the Earth) or
    `collapsed` (at the same place as an earlier object of the class). `notes` are warnings and the
    first messages about unreadable rows.
    """

    name: str
    read: int
    unreadable: int
    filtered: int
    missing: int
    misplaced: int
    collapsed: int
    kept: int
    duplicates: int = 0
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class LoadReport:
    """What became of every layer, in the order they were given."""

    layers: tuple[LayerReport, ...]

    def to_list(self) -> list[dict[str, Any]]:
        """Return the reports as plain mappings, ready for JSON."""
        return [asdict(layer) for layer in self.layers]


def build_objects(
    layers: Iterable[RawLayer],
    *,
    taxonomy: Taxonomy,
    crs: CRS | str,
    collapse: bool = True,
    apart: Collection[str] = (),
) -> tuple[StreetObjects, LoadReport]:
    """Turn raw layers into one table of street objects.

    A geometry that is not a point is represented by its centroid (paper, section on semantic
    signatures). Rows without a usable position are dropped and counted.

    Parameters
    ----------
    layers : iterable of RawLayer
        What the readers of `semsig_gis.sources` return; each has a coordinate reference system.
    taxonomy : Taxonomy
        Classes that the layers name.
    crs : pyproj.CRS or str
        Metric coordinate reference system to work in.
    collapse : bool, default True
        Whether objects of one class at the same place (within the same centimetre) become one,
        with their number in ``count``.
    apart : collection of str
        Classes that are collapsed within each layer only, because they will be conflated (see
        `semsig_gis.conflation`), which keeps account of where objects came from.

    Returns
    -------
    objects : StreetObjects
        The objects, in the order of the layers.
    report : LoadReport
        What became of every row.

    Raises
    ------
    CrsError
        If `crs` is not metric, or a layer has no coordinate reference system.
    UnknownNameError
        If a layer names a class that `taxonomy` does not have.
    EmptyResultError
        If no object remains.

    Examples
    --------
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> _, report = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> all(layer.kept == layer.read for layer in report.layers)
    True
    """
    system = require_metric_crs(crs)
    layers = tuple(layers)
    parts = [_positions(layer, taxonomy, system) for layer in layers]
    columns = [SOURCE, SOURCE_ID, CLASS_CODE, "x", "y"]
    everything = (
        pd.concat([part for part, _, _ in parts], ignore_index=True)
        if parts
        else pd.DataFrame(columns=columns)
    )
    if everything.empty:
        msg = (
            f"no object remains of {sum(layer.read for layer in layers)} rows in {len(layers)} "
            "layers; look at the filters, the geometries and the coordinate systems."
        )
        raise EmptyResultError(msg)
    # By number, because two layers may bear one name.
    owner = np.repeat(np.arange(len(parts)), [len(part) for part, _, _ in parts])
    again = _same_id(everything, np.array([layer.spec.unique_id for layer in layers])[owner])
    repeated = np.bincount(owner[again], minlength=len(parts)).tolist()
    everything, owner = everything[~again].reset_index(drop=True), owner[~again]
    if collapse:
        codes = [taxonomy.by_name(name).code for name in apart]
        first, counts = _first_at_place(
            everything, np.where(everything[CLASS_CODE].isin(codes), owner, -1)
        )
    else:
        first, counts = np.arange(len(everything)), np.ones(len(everything), np.int64)
    kept = everything.iloc[first].reset_index(drop=True)
    table = gpd.GeoDataFrame(
        {
            CLASS_CODE: kept[CLASS_CODE].to_numpy(np.uint8),
            SOURCE: kept[SOURCE].to_numpy(str).astype(object),
            SOURCE_ID: kept[SOURCE_ID].to_numpy(str).astype(object),
            COUNT: counts.astype(np.int32),
        },
        geometry=shapely.points(kept["x"].to_numpy(), kept["y"].to_numpy()),
        crs=system,
    )
    remaining = np.bincount(owner[first], minlength=len(parts)).tolist()
    reports = tuple(
        LayerReport(
            name=layer.spec.name,
            read=layer.read,
            unreadable=layer.error_count,
            filtered=layer.filtered,
            missing=missing,
            duplicates=layer.duplicates + twice,
            misplaced=misplaced,
            collapsed=len(part) - twice - kept_here,
            kept=kept_here,
            notes=(*layer.notes, *layer.errors),
        )
        for layer, (part, missing, misplaced), twice, kept_here in zip(
            layers, parts, repeated, remaining, strict=True
        )
    )
    return StreetObjects(table, taxonomy, license_lines(layers)), LoadReport(reports)


def _positions(layer: RawLayer, taxonomy: Taxonomy, crs: CRS) -> tuple[pd.DataFrame, int, int]:
    """Return the usable rows of a layer, and how many are missing and misplaced."""
    table = layer.table
    if table.crs is None:
        msg = (
            f"layer {layer.spec.name!r} has no coordinate reference system; "
            "state its crs in the catalogue."
        )
        raise CrsError(msg)
    geometry = table.geometry
    usable = ~(geometry.isna() | geometry.is_empty).to_numpy(bool)
    points = geometry[usable]
    if not (points.geom_type == "Point").all():
        # In the layer's own plane: a street object is small, so the CRS makes no difference.
        with np.errstate(invalid="ignore", over="ignore"):  # such rows are dropped below
            centroids = shapely.centroid(points.array)
        points = gpd.GeoSeries(centroids, index=points.index, crs=table.crs)
    moved = points if points.crs == crs else points.to_crs(crs)
    # A broken geometry may have an empty centroid, which has no coordinates at all.
    xy = np.full((len(moved), 2), np.nan)
    coordinates, row = shapely.get_coordinates(moved.array, return_index=True)
    xy[row] = coordinates
    placed = (np.abs(xy) < BEYOND_EARTH_M).all(axis=1)  # false for NaN too
    codes = {name: taxonomy.by_name(name).code for name in table[CLASS_NAME].unique()}
    rows = table[usable][placed]
    part = pd.DataFrame(
        {
            SOURCE: layer.spec.name,
            SOURCE_ID: rows[SOURCE_ID].to_numpy(),
            CLASS_CODE: rows[CLASS_NAME].map(codes).to_numpy(),
            "x": xy[placed, 0],
            "y": xy[placed, 1],
        }
    )
    return part, int((~usable).sum()), int((~placed).sum())


def _same_id(everything: pd.DataFrame, unique: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell the rows whose id an earlier row of the layer has, as in a second file of it."""
    told = unique & (everything[SOURCE_ID] != "").to_numpy(bool)
    again: NDArray[np.bool_] = everything.duplicated([SOURCE, SOURCE_ID]).to_numpy(bool)
    return told & again


def _first_at_place(
    everything: pd.DataFrame, group: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the first row of every group, class and place, in order, and how many share it."""
    keys = np.stack(
        [
            group,
            everything[CLASS_CODE].to_numpy(np.int64),
            np.rint(everything["x"].to_numpy() / SAME_PLACE_M).astype(np.int64),
            np.rint(everything["y"].to_numpy() / SAME_PLACE_M).astype(np.int64),
        ],
        axis=1,
    )
    _, first, counts = np.unique(keys, axis=0, return_index=True, return_counts=True)
    order = np.argsort(first)
    return first[order], counts[order]


def license_lines(layers: Iterable[RawLayer]) -> tuple[str, ...]:
    """Return whom to name for layers.

    There is a line for every publisher and licence, with the names of the layers that they cover.
    """
    layers_of: dict[str, list[str]] = {}
    for layer in layers:
        publisher = layer.spec.attribution or "no attribution given"
        names = layers_of.setdefault(f"{publisher} ({layer.spec.license})", [])
        if layer.spec.name not in names:
            names.append(layer.spec.name)
    return tuple(f"{terms}: {', '.join(names)}" for terms, names in layers_of.items())


def save_objects(objects: StreetObjects, path: str | Path, *, keep_order: bool = False) -> None:
    """Save street objects as one GeoParquet file that can be read by box.

    Parameters
    ----------
    objects : StreetObjects
        What to save.
    path : str or Path
        File to write; it appears whole, by rename.
    keep_order : bool, default False
        Whether the objects stay in their order, for whoever knows them by row number. Else the
        file holds them in a spatial order, of which a box is read faster, and so does what
        `open_objects` returns; saving that again does not change the order.

    Notes
    -----
    The column ``bbox`` holds the bounds of every object, and the rows are in groups of
    `semsig_gis.boxes.GROUP_ROWS`.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_objects(objects, f"{folder}/objects.parquet")
    ...     len(open_objects(f"{folder}/objects.parquet")) == len(objects)
    True
    """
    table = objects.table
    if not keep_order:
        table = table.iloc[hilbert_order(table.geometry.array)]
    columns = {
        CLASS_CODE: pa.array(table[CLASS_CODE].to_numpy(np.uint8)),
        SOURCE: pa.array(table[SOURCE].tolist(), pa.string()),
        SOURCE_ID: pa.array(table[SOURCE_ID].tolist(), pa.string()),
        COUNT: pa.array(table[COUNT].to_numpy(np.int32)),
    }
    if MERGED in table.columns:
        columns[MERGED] = pa.array(table[MERGED].tolist(), pa.string())
    columns[GEOMETRY] = pa.array(shapely.to_wkb(table.geometry.array), pa.binary())
    columns[BBOX] = bounds_column(shapely.bounds(table.geometry.array))
    bounds = (*objects.xy.min(axis=0), *objects.xy.max(axis=0))
    geo = geo_metadata(objects.crs, geometry_types=["Point"], bounds=bounds)
    geo["columns"]["geometry"]["covering"] = COVERING
    write_geoparquet(
        pa.table(columns),
        path,
        geo=geo,
        group_rows=GROUP_ROWS,
        specs=objects_specs(objects),
    )


def objects_specs(objects: StreetObjects) -> dict[str, Any]:
    """Return all but the table of street objects, as plain values for JSON."""
    return {
        "kind": KIND,
        "version": __version__,
        "taxonomy": objects.taxonomy.to_list(),
        "licenses": list(objects.licenses),
    }


def open_objects(path: str | Path, *, box: Sequence[float] | None = None) -> StreetObjects:
    """Open a file that `save_objects` wrote, or a part of it.

    Parameters
    ----------
    path : str or Path
        File to read.
    box : sequence of float, optional
        ``xmin, ymin, xmax, ymax`` in metres: only objects in it or on its edge.

    Returns
    -------
    StreetObjects
        The objects; there is at least one, but in a box there may be none.

    Raises
    ------
    DatabaseError
        If the file is missing, damaged, or holds something else.

    Examples
    --------
    >>> open_objects("nowhere.parquet")
    Traceback (most recent call last):
    ...
    semsig_gis.errors.DatabaseError: nowhere.parquet does not exist; give a street objects file.
    """
    arrow, specs, crs = read_geoparquet(path, kind=KIND, box=box)
    if box is not None:
        arrow = rows_meeting(arrow, box)
    return objects_of(arrow, specs, crs, path=path, box=box)


def objects_of(
    arrow: pa.Table,
    specs: dict[str, Any],
    crs: CRS,
    *,
    path: str | Path,
    box: Sequence[float] | None = None,
) -> StreetObjects:
    """Return the street objects that columns and the values of `objects_specs` hold.

    The columns are those of `StreetObjects.table`, ``geometry`` as WKB. With a box ``xmin, ymin,
    xmax, ymax`` in metres, only objects in it or on its edge are returned, possibly none. Raise
    DatabaseError, which names `path`, if they are damaged; without a box, a table without objects
    is damaged.
    """
    try:
        taxonomy = Taxonomy.from_list(specs["taxonomy"])
        columns = {
            CLASS_CODE: arrow[CLASS_CODE].to_numpy(),
            SOURCE: arrow[SOURCE].to_pylist(),
            SOURCE_ID: arrow[SOURCE_ID].to_pylist(),
            COUNT: arrow[COUNT].to_numpy(),
        }
        if MERGED in arrow.column_names:  # only conflated objects have it
            columns[MERGED] = arrow[MERGED].to_pylist()
        table = gpd.GeoDataFrame(
            columns,
            geometry=shapely.from_wkb(arrow[GEOMETRY].to_numpy(zero_copy_only=False)),
            crs=crs,
        )
        for code in pc.unique(arrow[CLASS_CODE]).to_pylist():
            taxonomy.by_code(code)
        licenses = tuple(specs["licenses"])
    except (TypeError, ValueError, LookupError, shapely.errors.ShapelyError) as error:
        msg = f"{path} is damaged ({error}); load the street objects again."
        raise DatabaseError(msg) from error
    xy = shapely.get_coordinates(table.geometry.array)
    points = (table.geometry.geom_type == "Point").all()
    some = len(table) > 0 or box is not None
    if not (some and points and len(xy) == len(table) and np.isfinite(xy).all()):
        msg = f"{path} is damaged (it has rows without a position); load the street objects again."
        raise DatabaseError(msg)
    if box is not None:
        inside = ((xy >= box[:2]) & (xy <= box[2:])).all(axis=1)
        table = table[inside].reset_index(drop=True)
    return StreetObjects(table, taxonomy, licenses)
