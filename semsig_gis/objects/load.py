"""From files to street objects: layers read, placed in one metric CRS, and merged."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import pandas as pd

from semsig_gis.core.crs import CLASS_NAME, LICENSES
from semsig_gis.core.errors import CrsError, EmptyResultError
from semsig_gis.objects.clean import build_objects
from semsig_gis.objects.conflate import ConflationReport, conflate
from semsig_gis.objects.table import layer_licences
from semsig_gis.sources import find_files, reader

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from pathlib import Path

    import geopandas as gpd
    from pyproj import CRS

    from semsig_gis.objects.clean import LoadReport
    from semsig_gis.objects.table import StreetObjects
    from semsig_gis.sources import RawLayer
    from semsig_gis.sources.catalog import Catalog
    from semsig_gis.sources.layers import LayerSpec


# A UTM zone is six degrees wide; across more than one, lengths are off by more than a thousandth.
ZONE_DEGREES = 6.0


@dataclass(frozen=True, eq=False, kw_only=True)
class Loaded:
    """What came of a load.

    Parameters
    ----------
    objects : StreetObjects
        The street objects.
    report, conflation : LoadReport, ConflationReport
        What became of every row, and what was merged between layers.
    buildings, streets : GeoDataFrame, optional
        Footprints (polygons) and centre lines in the CRS of the objects, where layers hold them;
        of streets whose widths a layer knows, ``half_width`` in metres.
    notes : tuple of str
        Remarks for the user.
    """

    objects: StreetObjects
    report: LoadReport
    conflation: ConflationReport
    buildings: gpd.GeoDataFrame | None = None
    streets: gpd.GeoDataFrame | None = None
    notes: tuple[str, ...] = ()


def choose_layers(
    catalog: Catalog, names: Sequence[str] = (), *, surroundings: bool = False
) -> tuple[LayerSpec, ...]:
    """Return the layers to load, in the order of the catalogue.

    Parameters
    ----------
    catalog : Catalog
        The catalogue.
    names : sequence of str
        Layers by name; by default all that are not optional. UnknownNameError if there is none.
    surroundings : bool, default False
        Whether buildings and streets are wanted too.

    Returns
    -------
    tuple of LayerSpec
        The layers.

    Examples
    --------
    >>> from semsig_gis import choose_layers, load_catalog
    >>> [spec.name for spec in choose_layers(load_catalog("montpellier"), ["cameras"])]
    ['cameras']
    """
    layer_names = {catalog.layer(name).name for name in names}
    return tuple(
        spec
        for spec in catalog.layers
        if spec.name in layer_names
        or (spec.role != "objects" and surroundings)
        or (not layer_names and not spec.optional and spec.role == "objects")
    )


def read_files(
    specs: Sequence[LayerSpec],
    paths: Iterable[str | Path],
    *,
    filters: bool = True,
    crs: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[tuple[RawLayer, ...], tuple[LayerSpec, ...]]:
    """Read layers from local files, each file once.

    Parameters
    ----------
    specs : sequence of LayerSpec
        The layers to look for.
    paths : iterable of str or Path
        Files, and folders that hold them. SourceError if one does not exist, matches no layer, or
        cannot be read.
    filters : bool, default True
        Whether the filters of the layers apply.
    crs : str, optional
        CRS of files that state none.
    progress : callable, optional
        Takes the number of files done and in all.

    Returns
    -------
    layers : tuple of RawLayer
        What was read, in the order of `specs`.
    absent : tuple of LayerSpec
        Layers that have no file among `paths`.

    Examples
    --------
    >>> from semsig_gis import SemsigError, choose_layers, load_catalog
    >>> try:
    ...     read_files(choose_layers(load_catalog("montpellier")), ["nowhere/"])
    ... except SemsigError as error:
    ...     print(error)
    nowhere does not exist; give a file or a folder of files.
    """
    pairs, absent = find_files(specs, paths)
    by_file: dict[tuple[Path, str], list[LayerSpec]] = {}
    for spec, path in pairs:
        by_file.setdefault((path, spec.reader), []).append(spec)
    layers: list[RawLayer] = []
    for done, ((path, name), layers_of_file) in enumerate(by_file.items(), start=1):
        layers.extend(reader(name)(path, layers_of_file, filters=filters, crs=crs))
        if progress is not None:
            progress(done, len(by_file))
    order = {spec.name: number for number, spec in enumerate(specs)}
    return tuple(sorted(layers, key=lambda layer: order[layer.spec.name])), absent


def metric_crs_of(layers: Iterable[RawLayer]) -> tuple[CRS, tuple[str, ...]]:
    """Return the UTM zone of the middle of all features, and a note if they span more than one.

    Raise CrsError if a layer has no CRS, and EmptyResultError if no feature has a position.
    """
    boxes = []
    for layer in layers:
        if layer.table.crs is None:
            msg = f"layer {layer.spec.name!r} has no coordinate reference system; state its crs."
            raise CrsError(msg)
        geometry = layer.table.geometry
        features = geometry[~(geometry.isna() | geometry.is_empty)]
        if len(features):
            boxes.append(features.to_crs("EPSG:4326"))
    if not boxes:
        msg = "no layer has a feature with a position; look at the filters and the area."
        raise EmptyResultError(msg)
    everything = pd.concat(boxes)
    west, _, east, _ = everything.total_bounds
    note = (
        f"the data is {east - west:.1f} degrees wide, more than a UTM zone, so distances "
        "far from its middle are off; give a metric CRS of the region"
    )
    return everything.estimate_utm_crs(), (note,) if east - west > ZONE_DEGREES else ()


def assemble(
    layers: Sequence[RawLayer],
    catalog: Catalog,
    *,
    metric_crs: str | None = None,
    collapse: bool = True,
    merge: bool = True,
) -> Loaded:
    """Place raw layers in one metric CRS and merge what stands in several of them.

    Parameters
    ----------
    layers : sequence of RawLayer
        What was read or fetched.
    catalog : Catalog
        Whose classes, metric CRS and merging radii hold.
    metric_crs : str, optional
        CRS to work in; the catalogue's by default, or the UTM zone of the data where it has none.
    collapse : bool, default True
        Whether objects of one class at the same place become one.
    merge : bool, default True
        Whether objects of different layers are merged by the catalogue's radii.

    Returns
    -------
    Loaded
        The objects and what became of every row. CrsError if the CRS is not metric or a layer has
        none, EmptyResultError if no object remains.

    Examples
    --------
    >>> from semsig_gis import CitySpec, assemble, load_catalog, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> assemble(layers, load_catalog("openstreetmap")).objects.crs.name
    'WGS 84 / UTM zone 31N'
    """
    notes: tuple[str, ...] = ()
    system: CRS | str | None = metric_crs or catalog.metric_crs
    if system is None:
        system, notes = metric_crs_of(layers)
    objects, report = build_objects(
        [layer for layer in layers if layer.spec.role == "objects"],
        taxonomy=catalog.taxonomy,
        crs=system,
        collapse=collapse,
        apart=[name for name, _ in catalog.conflate] if merge else (),
    )
    merged = ConflationReport(())
    if merge and catalog.conflate:
        objects, merged = conflate(objects, dict(catalog.conflate))
    return Loaded(
        objects=objects,
        report=report,
        conflation=merged,
        buildings=_surroundings(layers, "buildings", objects.crs),
        streets=_surroundings(layers, "streets", objects.crs),
        notes=notes,
    )


def _surroundings(layers: Sequence[RawLayer], role: str, crs: CRS) -> gpd.GeoDataFrame | None:
    of_role = [layer for layer in layers if layer.spec.role == role]
    if not of_role:
        return None
    tables = [layer.table.to_crs(crs) for layer in of_role]
    table = pd.concat(tables, ignore_index=True).drop(columns=CLASS_NAME)
    table = table[~(table.geometry.isna() | table.geometry.is_empty)].reset_index(drop=True)
    table.attrs[LICENSES] = [str(licence) for licence in layer_licences(of_role)]
    return table
