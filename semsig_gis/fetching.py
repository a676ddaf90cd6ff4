"""From the service that a catalogue names: layers of an area, through a cache."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from semsig_gis.errors import InputError
from semsig_gis.sources import opendatasoft, overpass, reader
from semsig_gis.sources._area import clip_layer, names_place, parse_area
from semsig_gis.sources._http import Cache, HttpSpec

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from semsig_gis.catalog import Catalog
    from semsig_gis.layer_spec import LayerSpec
    from semsig_gis.sources import RawLayer
    from semsig_gis.sources._area import Area

__all__ = ["fetch_layers", "find_area", "open_cache"]


def fetch_layers(
    specs: Sequence[LayerSpec],
    catalog: Catalog,
    *,
    area: Area,
    cache: Cache,
    http: HttpSpec,
    filters: bool = True,
    progress: Callable[[int, int], None] | None = None,
    tell: Callable[[str], None] | None = None,
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
        Called with how much has arrived and how much there is, 0 where nobody knows: bytes of
        a portal's file, tiles of OpenStreetMap.
    tell : callable, optional
        Called with a line about each layer that has arrived: rows, size and date.

    Returns
    -------
    tuple of RawLayer
        The layers, cut to the area.

    Raises
    ------
    InputError
        If the catalogue has no service to fetch from.
    SourceError
        If a service refuses, fails, or sends something else.
    """
    if not catalog.endpoints or catalog.reader not in {"opendatasoft", "osm_file"}:
        msg = (
            f"catalogue {catalog.name!r} has no service to fetch from; use `semsig load` on files."
        )
        raise InputError(msg)
    if catalog.reader == "osm_file":
        files = overpass.fetch_layers(
            specs, area=area, endpoints=catalog.endpoints, cache=cache, spec=http, progress=progress
        )
        # Tiles and long outlines cover more than the area.
        found = [
            clip_layer(layer, area) for layer in overpass.read_layers(files, specs, filters=filters)
        ]
        if tell is not None:
            for layer in found:
                tell(f"{layer.spec.name}: {len(layer.table):,} rows")
        return tuple(found)
    fetched = opendatasoft.fetch_layers(
        specs,
        portal=catalog.endpoints[0],
        area=area,
        cache=cache,
        spec=http,
        progress=None if progress is None else lambda _, done, total: progress(done, total),
    )
    layers: list[RawLayer] = []
    for spec, file in fetched:
        read = reader(catalog.reader)(file.path, [spec], filters=filters)
        layers.extend(clip_layer(layer, area) for layer in read)
        if tell is not None:
            source = "the cache" if file.from_cache else "the portal"
            tell(
                f"{spec.name}: {sum(layer.read for layer in read):,} rows, "
                f"{file.bytes / 1e6:.2f} MB, from {source}, fetched {file.fetched_at}"
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
    cache : Cache
        The cache.
    http : HttpSpec
        How requests are made.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     open_cache(folder, offline=True)[1].offline
    True
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
    cache : Cache
        Where the answer about a name is kept.
    http : HttpSpec
        How a name is asked for.

    Returns
    -------
    Area
        The area.

    Raises
    ------
    InputError
        If the numbers are no box on the Earth, or the catalogue has no geocoder for a name.
    SourceError
        If the file cannot be read, or no place has that name.

    Examples
    --------
    >>> from semsig_gis.catalog import load_catalog
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
    return overpass.find_place(text, endpoint=catalog.geocoder, cache=cache, spec=http)
