"""From the service that a catalogue names: layers of an area, through a cache."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from semsig_gis.core.crs import CLASS_NAME, LICENSES
from semsig_gis.core.errors import CrsError, EmptyResultError, InputError
from semsig_gis.objects.clean import build_objects
from semsig_gis.objects.conflate import ConflationReport, conflate
from semsig_gis.objects.table import layer_licences
from semsig_gis.sources import find_files, reader
from semsig_gis.sources.area import clip_layer, names_place, parse_area
from semsig_gis.sources.http.cache import Cache
from semsig_gis.sources.http.fetch import HttpSpec
from semsig_gis.sources.opendatasoft import reader as opendatasoft
from semsig_gis.sources.osm import overpass, overpass_json
from semsig_gis.sources.osm.overpass import find_place

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    import geopandas as gpd
    from pyproj import CRS

    from semsig_gis.objects.clean import LoadReport
    from semsig_gis.objects.table import StreetObjects
    from semsig_gis.sources import RawLayer
    from semsig_gis.sources.area import Area
    from semsig_gis.sources.catalog import Catalog
    from semsig_gis.sources.layers import LayerSpec


def fetch_layers(
    specs: Sequence[LayerSpec],
    catalog: Catalog,
    *,
    area: Area,
    cache: Cache,
    http: HttpSpec,
    filters: bool = True,
    progress: Callable[[int, int], None] | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> tuple[RawLayer, ...]:
    """Fetch layers of an area from the service that a catalogue names, and read them.

    Parameters
    ----------
    specs : sequence of LayerSpec
        The layers.
    catalog : Catalog
        Whose endpoints are asked; nothing else is.
    area : Area
        What is fetched.
    cache : Cache
        Where files are kept; what has not changed is not sent again.
    http : HttpSpec
        How requests are made; offline, everything comes from the cache.
    filters : bool, default True
        Whether the filters of the layers apply.
    progress : callable, optional
        Takes how much has arrived and how much there is, 0 where nobody knows: bytes of a portal's
        file, tiles of OpenStreetMap.
    tell : callable, optional
        Takes a line about each layer that has arrived: rows, size and date.

    Returns
    -------
    tuple of RawLayer
        The layers, cut to the area. InputError if the catalogue has no service to fetch from,
        SourceError if a service refuses, fails, or sends something else.
    """
    if not catalog.endpoints or catalog.reader not in {"opendatasoft", "osm_file"}:
        msg = (
            f"catalogue {catalog.name!r} has no service to fetch from; use `semsig load` on files."
        )
        raise InputError(msg)
    layers: list[RawLayer] = []
    if catalog.reader == "osm_file":
        tiles = overpass.fetch_layers(
            specs, endpoints=catalog.endpoints, area=area, cache=cache, spec=http, progress=progress
        )
        for layer in overpass_json.read_layers(tiles, specs, filters=filters):
            layers.append(clip_layer(layer, area))
            tell(f"{layer.spec.name}: {len(layers[-1].table):,} rows")
        return tuple(layers)
    for spec, file in opendatasoft.fetch_layers(
        specs, endpoints=catalog.endpoints, area=area, cache=cache, spec=http, progress=progress
    ):
        (layer,) = opendatasoft.read_layers(file.path, [spec], filters=filters)
        layers.append(clip_layer(layer, area))
        origin = "the cache" if file.from_cache else "the portal"
        tell(
            f"{spec.name}: {layer.counts.read:,} rows, {file.bytes / 1e6:.2f} MB, from {origin}, "
            f"fetched {file.fetched_at}"
        )
    return tuple(layers)


def open_cache(
    folder: str | Path | None = None, *, offline: bool = False
) -> tuple[Cache, HttpSpec]:
    """Open the cache of downloads.

    Parameters
    ----------
    folder : str or Path, optional
        Where it is; by default ``semsig`` in the user's cache folder (``XDG_CACHE_HOME``, or
        ``.cache`` in the home folder).
    offline : bool, default False
        Whether everything comes from the cache.

    Returns
    -------
    tuple of (Cache, HttpSpec)
        The cache, and how requests are made.
    """
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Cache(Path(folder or Path(base) / "semsig")), HttpSpec(offline=offline)


def find_area(text: str, catalog: Catalog, *, cache: Cache, http: HttpSpec) -> Area:
    """Return an area from what a user says of it.

    Parameters
    ----------
    text : str
        ``west,south,east,north`` in degrees, the path of a polygon file, or the name of a place.
    catalog : Catalog
        Whose geocoder knows places by name.
    cache, http : Cache, HttpSpec
        Where the answer about a name is kept, and how it is asked for (see `open_cache`).

    Returns
    -------
    Area
        The area. InputError if the numbers are no box on the Earth, or the catalogue has no
        geocoder; SourceError if the file cannot be read.

    Examples
    --------
    >>> from semsig_gis import find_area, load_catalog, open_cache
    >>> cache, http = open_cache("unused", offline=True)
    >>> osm = load_catalog("openstreetmap")
    >>> find_area("2.3,48.8,2.4,48.9", osm, cache=cache, http=http).bounds
    (2.3, 48.8, 2.4, 48.9)
    """
    if not names_place(text):
        return parse_area(text)
    if catalog.geocoder is None:
        msg = (
            f"catalogue {catalog.name!r} names no geocoder, so {text!r} cannot be looked up; give "
            "west,south,east,north in degrees or a polygon file."
        )
        raise InputError(msg)
    return find_place(text, endpoint=catalog.geocoder, cache=cache, spec=http)


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
    notes: tuple[str, ...] = ()
    if east - west > ZONE_DEGREES:
        notes = (
            (
                f"the data is {east - west:.1f} degrees wide, more than a UTM zone, so distances "
                "far from its middle are off; give a metric CRS of the region"
            ),
        )
    return everything.estimate_utm_crs(), notes


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
