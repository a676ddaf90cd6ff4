"""Collections of OGC API - Features services, page by page along their links."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from urllib.parse import quote, urljoin

from semsig_gis.core import CatalogError, SourceError
from semsig_gis.sources.http.fetch import HttpError, host_of
from semsig_gis.sources.services.fetch import service
from semsig_gis.sources.services.gml import ID
from semsig_gis.sources.services.layers import Download
from semsig_gis.sources.services.pages import NOT_FOUND, ServiceQuery, geojson_page

if TYPE_CHECKING:
    from semsig_gis.sources.area import Area
    from semsig_gis.sources.http.cache import Fetched
    from semsig_gis.sources.services.pages import Client, Page

PAGE_ROWS = 1_000
GEOJSON, JSON = ("application/geo+json", "application/json"), ("application/json",)
SCHEMA = ("application/schema+json", "application/json")
CORE, FILTER = "ogcapi-features-1", "ogcapi-features-3/1.0/conf/features-filter"
QUERYABLES = "http://www.opengis.net/def/rel/ogc/1.0/queryables"


@service
def fetch_layer(client: Client, area: Area | None) -> Download:
    """Fetch a collection in WGS 84, longitude first.

    ``server_where`` is a filter in CQL2 text, if the service accepts filters.
    """
    conformance = client.json(ServiceQuery(f"{client.endpoint}/conformance"), accept=JSON)
    classes = [str(name) for name in conformance.get("conformsTo") or ()]
    if not any(CORE in name for name in classes):
        raise SourceError(
            f"{host_of(client.endpoint)} does not declare that it supports OGC API - Features; "
            f"check the address {client.endpoint}."
        )
    params: dict[str, str | float] = {"limit": PAGE_ROWS}
    if client.layer.server_where:
        if not any(FILTER in name for name in classes):
            raise CatalogError(
                f"layer {client.layer.name!r} has a server_where, and {host_of(client.endpoint)} "
                "accepts no filter; write it as `where`, which is applied here."
            )
        params |= {"filter": client.layer.server_where, "filter-lang": "cql2-text"}
    collection, address = _collection(client)
    items = _link(collection, "items", GEOJSON[0]) or f"{address}/items"
    items = urljoin(f"{address}/", items)
    # All fields of the collection; a page may lack some.
    fields = dict.fromkeys(_queryables(client, collection, address))
    fields.update({ID: None} if fields else {})

    def read(content: bytes) -> Page:
        page = geojson_page(content, client)
        for row in page.rows:
            fields.update(dict.fromkeys([*(row.get("properties") or {}), ID]))
        return page

    def then(page: Page, _: int) -> ServiceQuery | None:
        return (
            ServiceQuery(urljoin(items, page.following)) if page.following and page.rows else None
        )

    files: tuple[Fetched, ...] = ()
    for box in area.boxes if area is not None else (None,):
        inside = {} if box is None else {"bbox": ",".join(f"{number:.7f}" for number in box)}
        query = ServiceQuery(items, {**params, **inside})
        files += client.pages(query, read, then, accept=GEOJSON)
    if fields:
        client.fields(list(fields))
    licence = _link(collection, "license")
    return Download(
        spec=client.with_license(licence, collection.get("attribution")),
        files=files,
        fields=tuple(fields),
    )


def _collection(client: Client) -> tuple[dict[str, Any], str]:
    """Return a collection and its address; CatalogError, with the existing ones, if unknown."""
    address = f"{client.endpoint}/collections/{quote(client.dataset, safe='')}"
    try:
        return client.json(ServiceQuery(address), accept=JSON), address
    except HttpError as error:
        if error.status != NOT_FOUND:
            raise
        reply = client.json(ServiceQuery(f"{client.endpoint}/collections"), accept=JSON)
        names = [str(item.get("id")) for item in reply.get("collections") or ()]
        raise client.unknown_dataset(names, what="collection") from error


def _link(collection: dict[str, Any], relation: str, kind: str = "") -> str:
    """Return the target of a link of a collection, preferring links of type `kind`, or ""."""
    links = [item for item in collection.get("links") or () if item.get("rel") == relation]
    links.sort(key=lambda item: kind not in str(item.get("type")))
    return str(links[0].get("href") or "") if links else ""


def _queryables(client: Client, collection: dict[str, Any], address: str) -> list[str]:
    """Return the fields that can be used in filters."""
    link = _link(collection, QUERYABLES)
    if not link:
        return []
    schema = client.json(ServiceQuery(urljoin(f"{address}/", link)), accept=SCHEMA)
    return list(schema.get("properties") or {})
