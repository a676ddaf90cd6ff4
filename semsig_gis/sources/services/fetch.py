"""Layers of a catalogue, fetched from the service that has them."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from semsig_gis.core import SourceError
from semsig_gis.sources.http.fetch import DEFAULT_HTTP, HttpError
from semsig_gis.sources.services import arcgis, ckan, ogc_features, opendatasoft, socrata, wfs
from semsig_gis.sources.services.pages import Client, PagingError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from semsig_gis.sources.area import Area
    from semsig_gis.sources.http.cache import Cache
    from semsig_gis.sources.http.fetch import HttpSpec, Progress
    from semsig_gis.sources.layer_spec import LayerSpec
    from semsig_gis.sources.services.layers import Download

# The function that fetches a layer, by the name of the catalogue's reader.
SERVICES = {
    "arcgis": arcgis.fetch_layer,
    "ckan": ckan.fetch_layer,
    "ogc_features": ogc_features.fetch_layer,
    "opendatasoft": opendatasoft.fetch_layer,
    "socrata": socrata.fetch_layer,
    "wfs": wfs.fetch_layer,
}


def fetch_layers(
    name: str,
    specs: Sequence[LayerSpec],
    *,
    endpoints: Sequence[str],
    area: Area | None = None,
    cache: Cache,
    spec: HttpSpec = DEFAULT_HTTP,
    progress: Progress | None = None,
) -> list[Download]:
    """Fetch layers from a service by the name of its reader; the first endpoint is its address.

    Layers without a dataset are skipped, because the service does not have them. CatalogError if
    the service lacks a dataset or field of the catalogue, SourceError if a request fails or the
    answer is not data.
    """
    downloads = []
    for layer in specs:
        if layer.dataset is None:
            continue
        client = Client(layer=layer, endpoints=endpoints, cache=cache, spec=spec, progress=progress)
        try:
            download = SERVICES[name](client, area)
            downloads.append(dataclasses.replace(download, area=area))
        except SourceError as error:
            if isinstance(error, PagingError):  # the cached pages do not belong together
                for file in client.requested_files:
                    cache.forget(file)
            message = f"layer {layer.name!r}: {error}"
            if isinstance(error, HttpError):
                raise HttpError(message, error.status) from error
            raise type(error)(message) from error
    return downloads
