"""Layers of ArcGIS servers: the query operation of a FeatureServer or MapServer."""

from __future__ import annotations

import functools
import re
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from semsig_gis.core import CatalogError, SourceError
from semsig_gis.sources.http.fetch import HttpError, host_of
from semsig_gis.sources.services.fetch import service
from semsig_gis.sources.services.layers import Download
from semsig_gis.sources.services.pages import ServiceQuery, geojson_page

if TYPE_CHECKING:
    from semsig_gis.sources.area import Area
    from semsig_gis.sources.http.cache import Fetched
    from semsig_gis.sources.services.pages import Client, Page

SERVER = re.compile(r"(.*/(?:Feature|Map)Server)(?:/(.+))?", re.IGNORECASE)
# Rows of a page if the server does not state its own limit.
PAGE_ROWS = 1_000
ID_TYPE = "esriFieldTypeOID"


@service
def fetch_layer(client: Client, area: Area | None) -> Download:
    """Fetch a layer in WGS 84 as GeoJSON or, from an old server, as JSON of Esri.

    The dataset is ``SERVICE/FeatureServer/LAYER``, the layer by its number or name. An area is
    requested by its bounding box.
    """
    address = _address(client)
    info = client.json(ServiceQuery(address, {"f": "json"}))
    names = [item["name"] for item in info.get("fields") or ()]
    fields = client.fields(names)
    id_fields = (item["name"] for item in info.get("fields") or () if item.get("type") == ID_TYPE)
    id_field = info.get("objectIdField") or next(id_fields, None)
    formats = str(info.get("supportedQueryFormats") or "").lower()
    query = ServiceQuery(
        f"{address}/query",
        {
            "where": client.layer.server_where or "1=1",
            "outFields": ",".join(fields) or "*",
            "outSR": 4326,
            "f": "geojson" if "geojson" in formats else "json",
        },
    )
    files: tuple[Fetched, ...] = ()
    for box in area.boxes if area is not None else (None,):
        part = query
        if box is not None:
            part = query.with_params(
                geometry=",".join(f"{number:.7f}" for number in box),
                geometryType="esriGeometryEnvelope",
                inSR=4326,
                spatialRel="esriSpatialRelIntersects",
            )
        files += _fetch_pages(client, part, info, id_field)
    return Download(
        spec=client.with_license(attribution=info.get("copyrightText")),
        files=files,
        fields=tuple(names),
    )


def _address(client: Client) -> str:
    """Return the address of the layer; CatalogError, with the existing layers, if it is unknown."""
    match = SERVER.fullmatch(f"{client.endpoint}/{quote(client.dataset, safe='/')}".rstrip("/"))
    if match is None:
        raise CatalogError(
            f"layer {client.layer.name!r} has the dataset {client.dataset!r}, which is not a layer "
            "of an ArcGIS server; write 'SERVICE/FeatureServer/LAYER', the layer by number or "
            "name."
        )
    service = match[1]
    layer = client.dataset.rstrip("/").rpartition("/")[2] if match[2] else ""
    try:
        root = client.json(ServiceQuery(service, {"f": "json"}))
    except HttpError as error:
        msg = f"{error}".removesuffix("; correct it.")
        raise HttpError(
            f"{msg}; correct `dataset` or `endpoints` in the catalogue.", error.status
        ) from error
    try:
        layers = {
            str(item["id"]): item["name"] for item in (*root["layers"], *root.get("tables", ()))
        }
    except (KeyError, TypeError) as error:
        raise SourceError(
            "the server did not send the description of a FeatureServer or MapServer; check the "
            "address."
        ) from error
    if not layer and len(layers) == 1:
        layer = next(iter(layers))
    number = next((n for n, name in layers.items() if layer in {n, name}), None)
    if number is None:
        known_layers = [f"{number} ({name})" for number, name in layers.items()]
        raise client.unknown_dataset(known_layers, what="layer", name=layer)
    return f"{service}/{number}"


def _fetch_pages(
    client: Client, query: ServiceQuery, info: dict[str, Any], id_field: str | None
) -> tuple[Fetched, ...]:
    """Fetch all rows of a query, ordered by `id_field`, and check their number."""
    total = client.json(query.with_params(returnCountOnly="true", f="json")).get("count")
    most = info.get("maxRecordCount") or PAGE_ROWS
    read = functools.partial(geojson_page, client=client)
    if not (info.get("advancedQueryCapabilities") or {}).get("supportsPagination", False):
        if total is None or total > most:
            raise SourceError(
                f"{host_of(query.url)} sends {most:,} rows at most and cannot send the rest of "
                f"{total or 'more'}; ask for a smaller area."
            )
        return client.pages(query, read, lambda *_: None, total=total)
    query = query.with_params(resultRecordCount=most)
    if id_field:
        query = query.with_params(orderByFields=id_field)
    start = 0

    def then(page: Page, rows: int) -> ServiceQuery | None:
        nonlocal start
        # A page can be empty and not the last, if all its rows are only near the area.
        start += len(page.rows) or (most if page.more else 0)
        rest = total is not None and rows < total and len(page.rows) > 0
        return query.with_params(resultOffset=start) if page.more or rest else None

    return client.pages(query.with_params(resultOffset=0), read, then, total=total)
