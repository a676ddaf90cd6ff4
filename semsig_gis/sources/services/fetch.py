"""Layers of a catalogue, fetched from the service that has them."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from semsig_gis.core import SourceError
from semsig_gis.sources.http.fetch import DEFAULT_HTTP
from semsig_gis.sources.registry import READERS, Source
from semsig_gis.sources.services.layers import read_layers
from semsig_gis.sources.services.pages import Client, PagingError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from semsig_gis.sources.area import Area
    from semsig_gis.sources.http.cache import Cache
    from semsig_gis.sources.http.fetch import HttpSpec, Progress
    from semsig_gis.sources.layer import RawLayer
    from semsig_gis.sources.layer_spec import LayerSpec
    from semsig_gis.sources.services.layers import Download

    FetchLayer = Callable[[Client, Area | None], Download]


def service(fetch_layer: FetchLayer) -> FetchLayer:
    """Register a service by the function that fetches one of its layers; a decorator."""

    def fetch(
        specs: Sequence[LayerSpec],
        *,
        filters: bool,
        **request: Any,  # noqa: ANN401 - see `Source`
    ) -> Iterator[tuple[RawLayer, str]]:
        for download in fetch_layers(fetch_layer, specs, **request):
            layer = download.read(filters=filters)
            from_cache = all(file.from_cache for file in download.files)
            text = (
                f"{layer.counts.read:,} rows, "
                f"{sum(file.bytes for file in download.files) / 1e6:.2f} MB, "
                f"from {'the cache' if from_cache else 'the portal'}, "
                f"fetched {min(file.fetched_at for file in download.files)}"
            )
            yield layer, text

    READERS.register(Source(read=read_layers, fetch=fetch), fetch_layer.__module__)
    return fetch_layer


def fetch_layers(
    fetch_layer: FetchLayer,
    specs: Sequence[LayerSpec],
    *,
    endpoints: Sequence[str],
    area: Area | None = None,
    cache: Cache,
    spec: HttpSpec = DEFAULT_HTTP,
    progress: Progress | None = None,
) -> list[Download]:
    """Fetch layers from a service; the first endpoint is its address.

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
            downloads.append(dataclasses.replace(fetch_layer(client, area), area=area))
        except SourceError as error:
            if isinstance(error, PagingError):  # the cached pages do not belong together
                for file in client.requested_files:
                    cache.forget(file)
            error.args = (f"layer {layer.name!r}: {error}",)
            raise
    return downloads
