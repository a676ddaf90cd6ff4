"""Fetch layers of an area from the service of a catalogue, through a cache."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from platformdirs import user_cache_path

from semsig_gis.core import InputError
from semsig_gis.sources.area_file import names_place
from semsig_gis.sources.clip import clip_layer, parse_area
from semsig_gis.sources.http.access_token import AccessToken
from semsig_gis.sources.http.cache import Cache
from semsig_gis.sources.http.fetch import DEFAULT_HTTP, HttpSpec
from semsig_gis.sources.layer import derived_layer
from semsig_gis.sources.osm import overpass
from semsig_gis.sources.registry import READERS

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import geopandas as gpd

    from semsig_gis.sources.area import Area
    from semsig_gis.sources.catalog import Catalog
    from semsig_gis.sources.layer import RawLayer
    from semsig_gis.sources.layer_spec import LayerSpec


def fetch_layers(
    specs: Sequence[LayerSpec],
    catalog: Catalog,
    *,
    area: Area,
    cache: Cache,
    http: HttpSpec,
    filters: bool = True,
    progress: Callable[[int, int], None] | None = None,
    remark: Callable[[str], None] = lambda _: None,
) -> tuple[RawLayer, ...]:
    """Fetch layers of an area from the service of a catalogue, and read them.

    Parameters
    ----------
    specs : sequence of LayerSpec
        The layers.
    catalog : Catalog
        The catalogue; requests go only to its endpoints.
    area : Area
        The area.
    cache : Cache
        Cache of downloaded files; unchanged files are not downloaded again.
    http : HttpSpec
        Settings of requests; offline, all files come from the cache.
    filters : bool, default True
        Whether the filters of the layers are applied.
    progress : callable, optional
        Called with the amount received and the total, 0 if unknown: bytes of a portal's file, rows
        of a paged service, or tiles of an area.
    remark : callable, optional
        Called with a line about each layer that was fetched: rows, size and date.

    Returns
    -------
    tuple of RawLayer
        The layers, clipped to the area. InputError if the catalogue has no service, or its access
        token is not in the environment; SourceError if a service refuses, fails, or sends an
        unexpected answer.

    Examples
    --------
    >>> from semsig_gis import find_area, load_catalog, open_cache
    >>> files = load_catalog("montpellier")
    >>> cache, http = open_cache("unused", offline=True)
    >>> area = find_area("3.8,43.6,3.9,43.7", files, cache=cache, http=http)
    >>> fetch_layers(files.layers, files, area=area, cache=cache, http=http)
    Traceback (most recent call last):
    ...
    semsig_gis.core.errors.InputError: catalogue 'montpellier' has no service to fetch from; use
    `semsig load` on files.
    """
    fetch = READERS[catalog.reader].fetch
    if not catalog.endpoints or fetch is None:
        raise InputError(
            f"catalogue {catalog.name!r} has no service to fetch from; use `semsig load` on files."
        )
    if catalog.token is not None and not http.offline:
        http = replace(http, token=AccessToken.from_environment(catalog.token))
    layers: list[RawLayer] = []
    for layer, size in fetch(
        [item for item in specs if item.derive is None],
        endpoints=catalog.endpoints,
        area=area,
        cache=cache,
        spec=http,
        filters=filters,
        progress=progress,
    ):
        layers.append(clip_layer(layer, area))
        rows = size or f"{len(layers[-1]):,} rows"
        remark(f"{layer.spec.name}: {rows}; {layer.spec.terms}")
    layers += [clip_layer(derived_layer(item), area) for item in specs if item.derive is not None]
    return tuple(layers)


def open_cache(
    folder: str | Path | None = None,
    *,
    offline: bool = False,
    deadline_s: float = DEFAULT_HTTP.deadline_s,
    remark: Callable[[str], None] = lambda _: None,
) -> tuple[Cache, HttpSpec]:
    """Open the cache of downloads.

    Parameters
    ----------
    folder : str or Path, optional
        Folder of the cache; by default ``semsig`` in the user's cache folder, which on Linux is
        ``XDG_CACHE_HOME`` or ``.cache`` in the home folder.
    offline : bool, default False
        Whether all files come from the cache.
    deadline_s : float, default 600
        Maximum time for a file in seconds, including all attempts and pauses.
    remark : callable, optional
        Called with a line if a server fails and the request will be repeated.

    Returns
    -------
    tuple of (Cache, HttpSpec)
        The cache, and the settings of requests.

    Examples
    --------
    >>> cache, http = open_cache("downloads", offline=True)
    >>> http.offline
    True
    """
    return Cache(Path(folder or user_cache_path("semsig", appauthor=False))), HttpSpec(
        offline=offline, deadline_s=deadline_s, report=remark
    )


def find_area(
    text: str | gpd.GeoDataFrame, catalog: Catalog, *, cache: Cache, http: HttpSpec
) -> Area:
    """Return an area from its bounds, polygons or name.

    Parameters
    ----------
    text : str or GeoDataFrame
        ``west,south,east,north`` in degrees, the path of a polygon file, polygons, or the name of a
        place.
    catalog : Catalog
        Catalogue with the geocoder for names.
    cache, http : Cache, HttpSpec
        Cache and settings of requests to the geocoder (see `open_cache`).

    Returns
    -------
    Area
        The area. InputError if the numbers are not a box on the Earth, or the catalogue has no
        geocoder; SourceError if the file cannot be read.

    Examples
    --------
    >>> from semsig_gis import find_area, load_catalog, open_cache
    >>> cache, http = open_cache("unused", offline=True)
    >>> osm = load_catalog("openstreetmap")
    >>> find_area("2.3,48.8,2.4,48.9", osm, cache=cache, http=http).bounds
    (2.3, 48.8, 2.4, 48.9)
    """
    if not isinstance(text, str) or not names_place(text):
        return parse_area(text)
    if catalog.geocoder is None:
        raise InputError(
            f"catalogue {catalog.name!r} names no geocoder, so {text!r} cannot be looked up; give "
            "west,south,east,north in degrees or a polygon file."
        )
    return overpass.find_place(text, endpoint=catalog.geocoder, cache=cache, spec=http)
