"""Layers of ArcGIS servers: the query operation of a FeatureServer or MapServer."""

from __future__ import annotations

import dataclasses
import functools
import re
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from semsig_gis.core import CatalogError, SourceError
from semsig_gis.sources.http.fetch import HttpError, host_of
from semsig_gis.sources.services.layers import Download
from semsig_gis.sources.services.pages import Query, geojson_page, json_object

if TYPE_CHECKING:
    from semsig_gis.sources.area import Area
    from semsig_gis.sources.http.cache import Fetched
    from semsig_gis.sources.services.pages import Client, Page

SERVER = re.compile(r"(.*/(?:Feature|Map)Server)(?:/(.+))?", re.IGNORECASE)
# Rows of a page where the server does not say its own limit.
PAGE_ROWS = 1_000
ID_TYPE = "esriFieldTypeOID"


def fetch_layer(client: Client, area: Area | None) -> Download:
    """Fetch a layer, in WGS 84, as GeoJSON or, where the server is old, as JSON of Esri.

    The dataset is ``SERVICE/FeatureServer/LAYER``, the layer by its number or name. An area is
    asked for by its bounding box.
    """
    address = _address(client)
    info = client.json(Query(address, {"f": "json"}))
    names = [item["name"] for item in info.get("fields") or ()]
    fields = client.fields(names)
    key = info.get("objectIdField") or _id_field(info)
    query = Query(
        f"{address}/query",
        {
            "where": client.layer.server_where or "1=1",
            "outFields": ",".join(fields) or "*",
            "outSR": 4326,
            "f": "geojson" if "geojson" in _said(info, "supportedQueryFormats") else "json",
        },
    )
    files: tuple[Fetched, ...] = ()
    for box in area.boxes if area is not None else (None,):
        part = query
        if box is not None:
            part = query.also(
                geometry=",".join(f"{number:.7f}" for number in box),
                geometryType="esriGeometryEnvelope",
                inSR=4326,
                spatialRel="esriSpatialRelIntersects",
            )
        files += _fetch_pages(client, part, info, key)
    return Download(
        spec=client.licensed(attribution=info.get("copyrightText")),
        files=files,
        fields=tuple(names),
    )


def _address(client: Client) -> str:
    """Return the address of the layer; CatalogError, with the layers there are, if it is none."""
    found = SERVER.fullmatch(f"{client.endpoint}/{quote(client.dataset, safe='/')}".rstrip("/"))
    if found is None:
        raise CatalogError(
            f"layer {client.layer.name!r} has the dataset {client.dataset!r}, which is not a layer "
            "of an ArcGIS server; write 'SERVICE/FeatureServer/LAYER', the layer by number or "
            "name."
        )
    service = found[1]
    layer = client.dataset.rstrip("/").rpartition("/")[2] if found[2] else ""
    try:
        root = client.json(Query(service, {"f": "json"}))
    except HttpError as error:
        msg = f"{error}".removesuffix("; correct it.")
        raise HttpError(
            f"{msg}; correct `dataset` or `endpoints` in the catalogue.", error.status
        ) from error
    layers = {str(item["id"]): item["name"] for item in _tables(root)}
    if not layer and len(layers) == 1:
        layer = next(iter(layers))
    number = next((n for n, name in layers.items() if layer in {n, name}), None)
    if number is None:
        listed = [f"{number} ({name})" for number, name in layers.items()]
        raise client.unknown(listed, what="layer", name=layer)
    return f"{service}/{number}"


def _tables(root: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the layers and tables of a service."""
    try:
        return [*root["layers"], *root.get("tables", ())]
    except (KeyError, TypeError) as error:
        raise SourceError(
            "the server did not send the description of a FeatureServer or MapServer; check the "
            "address."
        ) from error


def _id_field(info: dict[str, Any]) -> str | None:
    fields = info.get("fields") or ()
    return next((item["name"] for item in fields if item.get("type") == ID_TYPE), None)


def _said(info: dict[str, Any], name: str) -> str:
    return str(info.get(name) or "").lower()


def _fetch_pages(
    client: Client, query: Query, info: dict[str, Any], key: str | None
) -> tuple[Fetched, ...]:
    """Fetch all rows of a query, ordered by `key`, as many as the server says that there are."""
    counted = client.json(query.also(returnCountOnly="true", f="json"))
    told = counted.get("count")
    most = info.get("maxRecordCount") or PAGE_ROWS
    read = functools.partial(_page, client=client)
    if not (info.get("advancedQueryCapabilities") or {}).get("supportsPagination", False):
        if told is None or told > most:
            raise SourceError(
                f"{host_of(query.url)} sends {most:,} rows at most and cannot send the rest of "
                f"{told or 'more'}; ask for a smaller area."
            )
        return client.pages(query, read, lambda *_: None, told=told)
    asked = query.also(resultRecordCount=most)
    if key:
        asked = asked.also(orderByFields=key)
    start = 0

    def then(page: Page, rows: int) -> Query | None:
        nonlocal start
        # Rows that a spatial index lets pass in vain leave a page empty that is not the last.
        start += len(page.rows) or (most if page.more else 0)
        rest = told is not None and rows < told and len(page.rows) > 0
        return asked.also(resultOffset=start) if page.more or rest else None

    first = asked.also(resultOffset=0)
    return client.pages(first, read, then, told=told)


def _page(content: bytes, client: Client) -> Page:
    """Return a page, which says in its own way, by its format, that there are more."""
    beside = json_object(content, client.endpoint)
    beside = {**(beside.get("properties") or {}), **beside}
    page = geojson_page(content, client)
    return dataclasses.replace(page, more=bool(beside.get("exceededTransferLimit")))
