"""Raw layers become one clean table of street objects, and what became of each row."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
import pandas as pd
import shapely

from semsig_gis.core.crs import CLASS_CODE, CLASS_NAME, COUNT, SOURCE, SOURCE_ID, require_metric_crs
from semsig_gis.core.errors import CrsError, EmptyResultError
from semsig_gis.objects.table import StreetObjects, layer_licences

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

    from numpy.typing import NDArray
    from pyproj import CRS

    from semsig_gis.core.taxonomy import Taxonomy
    from semsig_gis.sources import RawLayer, RowCounts

# Two objects of a class within the same centimetre are one object listed twice.
SAME_PLACE_M = 0.01
# Larger than any projected coordinate; files write -1.8e308 and the like for "no value".
BEYOND_EARTH_M = 1e8


@dataclass(frozen=True, slots=True)
class LayerReport:
    """What became of one layer's rows; `notes` are warnings and messages on unreadable rows."""

    name: str
    counts: RowCounts
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class LoadReport:
    """What became of every layer, in the order they were given."""

    layers: tuple[LayerReport, ...]


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
        What readers return. CrsError if one has no coordinate reference system.
    taxonomy : Taxonomy
        Classes that the layers name. UnknownNameError if it lacks one.
    crs : pyproj.CRS or str
        Metric coordinate reference system to work in.
    collapse : bool, default True
        Whether objects of one class at the same place (within the same centimetre) become one,
        with their number in ``count``.
    apart : collection of str
        Classes that are collapsed within each layer only, because they will be conflated (see
        `conflate`), which keeps account of where objects came from.

    Returns
    -------
    objects : StreetObjects
        The objects, in the order of the layers; EmptyResultError if there is none.
    report : LoadReport
        What became of every row.

    Examples
    --------
    >>> from semsig_gis import CitySpec, build_objects, paper_taxonomy, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> _, report = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> all(layer.counts.kept == layer.counts.read for layer in report.layers)
    True
    """
    system = require_metric_crs(crs)
    layers = tuple(layers)
    parts = [_positions(layer, taxonomy, system) for layer in layers]
    if not any(len(part) for part, _, _ in parts):
        msg = (
            f"no object remains of {sum(layer.counts.read for layer in layers)} rows in "
            f"{len(layers)} layers; look at the filters, the geometries and the coordinate systems."
        )
        raise EmptyResultError(msg)
    everything = pd.concat([part for part, _, _ in parts], ignore_index=True)
    # By number, because two layers may bear one name.
    owner = np.repeat(np.arange(len(parts)), [len(part) for part, _, _ in parts])
    unique = np.array([layer.spec.unique_id for layer in layers])[owner]
    has_id = (everything[SOURCE_ID] != "") & unique
    # Of the id of an earlier row of the layer, as in a second file of it.
    again = (has_id & everything.duplicated([SOURCE, SOURCE_ID])).to_numpy(bool)
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
    reports = []
    for layer, (part, missing, misplaced), twice, kept_here in zip(
        layers, parts, repeated, remaining, strict=True
    ):
        dropped = replace(
            layer.counts,
            missing=missing,
            duplicates=layer.counts.duplicates + twice,
            misplaced=misplaced,
            collapsed=len(part) - twice - kept_here,
        )
        reports.append(LayerReport(layer.spec.name, dropped, (*layer.notes, *layer.errors)))
    return StreetObjects(table, taxonomy, layer_licences(layers)), LoadReport(tuple(reports))


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


def _first_at_place(
    everything: pd.DataFrame, group: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the first row of every group, class and place, in order, and how many share it."""
    places = np.rint(everything[["x", "y"]].to_numpy() / SAME_PLACE_M).astype(np.int64)
    keys = np.column_stack([group, everything[CLASS_CODE].to_numpy(np.int64), places])
    _, first, counts = np.unique(keys, axis=0, return_index=True, return_counts=True)
    order = np.argsort(first)
    return first[order], counts[order]
