"""Layers of Web Feature Services (OGC WFS 2.0), as GeoJSON or, if not available, as GML."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self
from xml.etree import ElementTree as ET

from semsig_gis.core import SourceError
from semsig_gis.sources.http.fetch import host_of
from semsig_gis.sources.services.fetch import service
from semsig_gis.sources.services.gml import ID, features, local_name
from semsig_gis.sources.services.layers import Download, find_field
from semsig_gis.sources.services.pages import (
    Page,
    ServiceQuery,
    geojson_page,
    next_offset,
    xml_root,
)

if TYPE_CHECKING:
    from semsig_gis.sources.area import Area
    from semsig_gis.sources.http.cache import Fetched
    from semsig_gis.sources.services.pages import Client

VERSION = "2.0.0"
PAGE_ROWS = 5_000
# With the URN, coordinates in GML are latitude first; with the short name, in GeoJSON, longitude.
URN, SHORT = "urn:ogc:def:crs:EPSG::4326", "EPSG:4326"
# Names of GeoJSON in capabilities, without the parameters after a semicolon.
JSON_FORMATS = frozenset(
    {"application/geo+json", "application/json", "application/vnd.geo+json", "geojson", "json"}
)
FILTER = (
    '<fes:Filter xmlns:fes="http://www.opengis.net/fes/2.0" '
    'xmlns:gml="http://www.opengis.net/gml/3.2">{}</fes:Filter>'
)
BOX = (
    '<fes:BBOX><gml:Envelope srsName="{}"><gml:lowerCorner>{}</gml:lowerCorner>'
    "<gml:upperCorner>{}</gml:upperCorner></gml:Envelope></fes:BBOX>"
)


@dataclass(frozen=True, slots=True)
class _Capabilities:
    """Feature types, formats, constraints and terms of a service."""

    types: tuple[str, ...]
    formats: tuple[str, ...]
    constraints: dict[str, str]
    terms: str = ""
    provider: str = ""

    @classmethod
    def parse(cls, content: bytes, client: Client) -> Self:
        """Parse the capabilities of a service; SourceError if it is not a WFS 2.0."""
        root = xml_root(content, client.endpoint)
        version = root.get("version", "")
        if local_name(root) != "WFS_Capabilities" or not version.startswith("2."):
            raise SourceError(
                f"{host_of(client.endpoint)} is not a Web Feature Service of version 2.0 (it sent "
                f"{local_name(root)} {version}".rstrip()
                + f"); check the address {client.endpoint}."
            )
        formats = [
            value
            for operation in _named(root, "Operation", "GetFeature")
            for parameter in _named(operation, "Parameter", "outputFormat")
            for value in _texts(parameter, "Value")
        ]
        constraints = {
            item.get("name", ""): next(iter(_texts(item, "DefaultValue")), "")
            for item in root.iter()
            if local_name(item) == "Constraint"
        }
        types = (item for item in root.iter() if local_name(item) == "FeatureType")
        terms = [text for text in _texts(root, "AccessConstraints") if text.lower() != "none"]
        return cls(
            types=tuple(name for item in types for name in _texts(item, "Name")[:1]),
            formats=tuple(formats),
            constraints=constraints,
            terms=" ".join(terms),
            provider=" ".join(_texts(root, "ProviderName")),
        )

    def lacks(self, name: str) -> bool:
        """Whether the service states that it does not support something."""
        return self.constraints.get(name, "").upper() == "FALSE"


@service
def fetch_layer(client: Client, area: Area | None) -> Download:
    """Fetch a feature type in WGS 84; the catalogue may omit the namespace prefix of its name.

    ``server_where`` is a condition in XML (OGC Filter Encoding 2.0). Rows are ordered by the
    layer's `id_field` if the service supports it.
    """
    service = client.document(
        _query(client, "GetCapabilities"), lambda content: _Capabilities.parse(content, client)
    )
    dataset = client.dataset
    matches = [name for name in service.types if dataset in {name, name.rpartition(":")[2]}]
    if dataset not in matches and len(matches) != 1:
        raise client.unknown_dataset(service.types, what="feature type")
    name = dataset if dataset in matches else matches[0]
    types = client.document(
        _query(client, "DescribeFeatureType").with_params(typeName=name),
        lambda content: _field_types(xml_root(content, client.endpoint)),
    )
    fields = tuple(dict.fromkeys([*types, ID])) if types else ()
    names = {text.partition(";")[0].strip().lower(): text for text in reversed(service.formats)}
    json_format = next((text for kind, text in names.items() if kind in JSON_FORMATS), None)
    query = _query(client, "GetFeature").with_params(
        typeNames=name, srsName=SHORT if json_format else URN
    )
    properties = [field for field in client.fields(fields) if field in types]
    places = [field for field, kind in types.items() if kind.startswith("gml:")]
    if properties and places:
        query = query.with_params(propertyName=",".join(dict.fromkeys([*properties, *places])))
    order: dict[str, str | float] = {"outputFormat": json_format} if json_format else {}
    key = client.layer.id_field and find_field(client.layer.id_field, client.layer, fields)
    if key and key in types and not service.lacks("ImplementsSorting"):
        order["sortBy"] = key
    files: tuple[Fetched, ...] = ()
    for box in area.boxes if area is not None else (None,):
        files += _fetch_pages(client, query.with_params(**_condition(client, box)), service, order)
    return Download(
        spec=client.with_license(service.terms, service.provider), files=files, fields=fields
    )


def _query(client: Client, request: str) -> ServiceQuery:
    return ServiceQuery(client.endpoint, {"service": "WFS", "version": VERSION, "request": request})


def _named(element: ET.Element, kind: str, name: str) -> list[ET.Element]:
    return [
        item for item in element.iter() if local_name(item) == kind and item.get("name") == name
    ]


def _texts(element: ET.Element, name: str) -> list[str]:
    texts = ((item.text or "").strip() for item in element.iter() if local_name(item) == name)
    return [text for text in texts if text]


def _field_types(schema: ET.Element) -> dict[str, str]:
    """Return the types of the properties in a schema, by name."""
    top_level = set(schema)
    elements = (item for item in schema.iter() if local_name(item) == "element")
    return {
        item.get("name", ""): item.get("type", "")
        for item in elements
        if item not in top_level and "name" in item.attrib
    }


def _condition(
    client: Client, box: tuple[float, float, float, float] | None
) -> dict[str, str | float]:
    """Return the parameter for an area and the layer's filter; KVP accepts only one of them."""
    where = client.layer.server_where
    if box is None and not where:
        return {}
    if box is None:
        return {"filter": FILTER.format(where)}
    west, south, east, north = (f"{number:.7f}" for number in box)
    if not where:
        return {"bbox": f"{south},{west},{north},{east},{URN}"}
    inside = BOX.format(URN, f"{south} {west}", f"{north} {east}")
    return {"filter": FILTER.format(f"<fes:And>{inside}{where}</fes:And>")}


def _fetch_pages(
    client: Client, query: ServiceQuery, service: _Capabilities, order: dict[str, str | float]
) -> tuple[Fetched, ...]:
    """Fetch all rows of a query and check their number."""
    total = client.document(
        query.with_params(resultType="hits"), lambda content: _gml_page(content, client).total
    )
    as_json = "outputFormat" in order
    read = functools.partial(geojson_page if as_json else _gml_page, client=client)
    suffix = ".json" if as_json else ".gml"
    query = query.with_params(**order)
    if service.lacks("ImplementsResultPaging"):
        return client.pages(query, read, lambda *_: None, total=total, suffix=suffix)
    most = service.constraints.get("CountDefault", "")
    count = min(PAGE_ROWS, int(most) if most.isdecimal() and int(most) else PAGE_ROWS)
    query = query.with_params(count=count)
    # No startIndex for the first page: a service that cannot order rows refuses it.
    then = next_offset(query, "startIndex", total)
    return client.pages(query, read, then, total=total, suffix=suffix)


def _gml_page(content: bytes, client: Client) -> Page:
    root = xml_root(content, client.endpoint)
    if local_name(root) != "FeatureCollection":
        raise SourceError(
            f"{host_of(client.endpoint)} sent {local_name(root)} where features were expected; "
            f"check the address {client.endpoint}."
        )
    matched = root.get("numberMatched", "")
    rows = [ET.tostring(item, encoding="unicode") for item in features(root)]
    return Page(rows, total=int(matched) if matched.isdecimal() else None)
