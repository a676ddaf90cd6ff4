"""Datasets of CKAN portals: the file of a resource, or its rows in the portal's datastore."""

from __future__ import annotations

import re
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote, urljoin, urlsplit

from semsig_gis.core import CatalogError, SourceError
from semsig_gis.sources.http.fetch import HttpError, host_of
from semsig_gis.sources.paths import matches_pattern
from semsig_gis.sources.services.fetch import service
from semsig_gis.sources.services.layers import Download, PositionReader
from semsig_gis.sources.services.pages import (
    HTML,
    NOT_FOUND,
    Page,
    ServiceQuery,
    json_object,
    next_offset,
)
from semsig_gis.sources.services.table import ServiceTable

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.sources.area import Area
    from semsig_gis.sources.layer_spec import LayerSpec
    from semsig_gis.sources.services.pages import Client

    Resource = dict[str, Any]

PAGE_ROWS = 10_000
# Names of the readable formats on portals, best first, and the suffixes of their files.
FORMATS = {
    "geojson": ".geojson",
    "geopackage": ".gpkg",
    "gpkg": ".gpkg",
    "flatgeobuf": ".fgb",
    "fgb": ".fgb",
    "shp": ".zip",
    "shapefile": ".zip",
    "zip": ".zip",
    "gml": ".gml",
    "csv": ".csv",
    "json": ".json",
    "parquet": ".parquet",
}
# For files of these suffixes, the datastore has the rows with their types.
TABLES = frozenset({".csv", ".json", ""})


@service
def fetch_layer(client: Client, area: Area | None) -> Download:  # noqa: ARG001 - not in CKAN
    """Fetch a dataset by its name: rows of the datastore, or the file of a resource.

    The resource has the best format; of several, it is the newest that matches the layer's `files`.
    ``server_where`` is a filter of the datastore in JSON. CKAN cannot select by area.
    """
    package = _package(client)
    resource, suffix = _resource(client, list(package.get("resources") or ()))
    owner = (package.get("organization") or {}).get("title")
    spec = client.with_license(
        package.get("license_title") or package.get("license_id"), owner or package.get("author")
    )
    if resource.get("datastore_active") and suffix in TABLES:
        return _rows(client, spec, str(resource.get("id")))
    if client.layer.server_where:
        raise CatalogError(
            f"layer {client.layer.name!r} has a server_where, and the datastore of "
            f"{host_of(client.endpoint)} does not accept it; write it as `where`, which is applied "
            "here."
        )
    address = urljoin(f"{client.endpoint}/", str(resource.get("url") or ""))

    def refuse_web_page(path: Path) -> None:
        with path.open("rb") as stream:
            if HTML.match(stream.read(200).lstrip()):
                raise SourceError(
                    f"{host_of(address)} sent a web page where the file {address} was expected; "
                    "download it by hand, or report it to the publisher."
                )

    file = client.file(
        ServiceQuery(address), refuse_web_page, suffix=suffix, progress=client.progress
    )
    return Download(spec=spec, files=(file,))


def _action(client: Client, name: str, **params: str | float) -> ServiceQuery:
    return ServiceQuery(f"{client.endpoint}/api/3/action/{name}", params)


def _package(client: Client) -> dict[str, Any]:
    """Return the description of a dataset; CatalogError, with the nearest name, if unknown."""
    try:
        reply = client.json(_action(client, "package_show", id=client.dataset))
    except HttpError as error:
        if error.status != NOT_FOUND:
            raise
        names = client.json(_action(client, "package_list")).get("result")
        names = [str(name) for name in names] if isinstance(names, list) else []
        raise client.unknown_dataset(names, what="dataset") from error
    package = reply.get("result")
    if not isinstance(package, dict):
        raise SourceError(
            "the portal did not send the description of a dataset; check that the address is that "
            "of a CKAN portal."
        )
    return package


def _file_name(resource: Resource) -> str:
    return unquote(PurePosixPath(urlsplit(str(resource.get("url") or "")).path).name)


def _suffix(resource: Resource) -> str | None:
    """Return the suffix for the format of a resource, or None if the format cannot be read."""
    stated_format = str(resource.get("format") or "").lower()
    words = re.split(r"[().\s]+", stated_format)
    words.append(PurePosixPath(_file_name(resource)).suffix.lower().lstrip("."))
    suffix = next((FORMATS[word] for word in FORMATS if word in words), None)
    return "" if suffix is None and resource.get("datastore_active") else suffix


def _resource(client: Client, resources: list[Resource]) -> tuple[Resource, str]:
    """Return the resource to fetch, and the suffix of its file."""
    usable = [(item, suffix) for item in resources if (suffix := _suffix(item)) is not None]
    names = [_shown(item) for item in resources]
    if not usable:
        raise CatalogError(
            f"dataset {client.dataset!r} of layer {client.layer.name!r} has no resource that can "
            f"be read, only {', '.join(names) or 'none at all'}; choose another dataset."
        )
    patterns = client.layer.files
    matches = [
        pair
        for pair in usable
        if matches_pattern(_file_name(pair[0]), patterns)
        or matches_pattern(str(pair[0].get("name") or ""), patterns)
    ]
    order = [*dict.fromkeys(FORMATS.values()), ""]
    candidates = matches or usable
    best = min((suffix for _, suffix in candidates), key=order.index)
    candidates = [pair for pair in candidates if pair[1] == best]
    if len(candidates) > 1 and not matches:
        file_names = ", ".join(_shown(item) for item, _ in candidates)
        raise CatalogError(
            f"dataset {client.dataset!r} of layer {client.layer.name!r} has several resources "
            f"({file_names}); name the one that is meant in `files`, by a pattern such as "
            f"{_file_name(candidates[0][0])!r}."
        )

    def age(pair: tuple[Resource, str]) -> tuple[str, str]:
        # Names of files often contain their dates.
        resource = pair[0]
        date = resource.get("created") or resource.get("last_modified") or ""
        return str(date), _shown(resource)

    return max(candidates, key=age)


def _shown(resource: Resource) -> str:
    return _file_name(resource) or str(resource.get("name") or resource.get("id"))


def _rows(client: Client, spec: LayerSpec, resource: str) -> Download:
    """Fetch the rows of a resource from the datastore, in its order."""
    query = _action(client, "datastore_search", resource_id=resource)
    description = client.document(
        query.with_params(limit=0), lambda content: _result(content, client)
    )
    names = tuple(str(item.get("id")) for item in description.get("fields") or ())
    fields = client.fields(names)
    if fields:
        table = ServiceTable(names, lambda _: iter(()))
        places = PositionReader(spec, table, where=f"dataset {client.dataset!r}").fields
        query = query.with_params(fields=",".join(dict.fromkeys([*fields, *places])))
    if client.layer.server_where:
        query = query.with_params(filters=client.layer.server_where)
    query = query.with_params(limit=PAGE_ROWS, sort="_id")

    def read(content: bytes) -> Page:
        result = _result(content, client)
        total = result.get("total")
        exact = isinstance(total, int) and not result.get("total_was_estimated")
        return Page(result["records"], total=total if exact else None)

    files = client.pages(query.with_params(offset=0), read, next_offset(query, "offset"))
    return Download(spec=spec, files=files, fields=names)


def _result(content: bytes, client: Client) -> dict[str, Any]:
    result = json_object(content, client.endpoint).get("result")
    if not isinstance(result, dict) or not isinstance(result.get("records"), list):
        raise SourceError(
            f"{host_of(client.endpoint)} sent JSON without records; check the address "
            f"{client.endpoint}."
        )
    return result
