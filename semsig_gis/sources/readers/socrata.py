"""Datasets of Socrata portals, by their Open Data API (SODA 2.1)."""

from __future__ import annotations

import dataclasses
import functools
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from semsig_gis.core import SourceError
from semsig_gis.sources.positions import find_positions
from semsig_gis.sources.services.fetch import service
from semsig_gis.sources.services.layers import POINT, SHAPE, Download, find_field
from semsig_gis.sources.services.pages import (
    Page,
    ServiceQuery,
    geojson_page,
    json_object,
    json_value,
    next_offset,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from semsig_gis.sources.area import Area
    from semsig_gis.sources.http.cache import Fetched
    from semsig_gis.sources.services.pages import Client

    Box = tuple[float, float, float, float]

PAGE_ROWS = 10_000
LOCATION = "location"  # coordinates and an address; it cannot be exported as GeoJSON
TEXT = "text"
POINTS = frozenset({"location", "multipoint", "point"})
SHAPES = frozenset({"line", "multiline", "multipolygon", "polygon"})


@service
def fetch_layer(client: Client, area: Area | None) -> Download:
    """Fetch a dataset by its identifier, such as ``uvpi-gqnh``, ordered by the ids of its rows.

    ``server_where`` is a condition in SoQL. Of several geometry columns, the one of an alias is
    used, or else the first.
    """
    description = f"{client.endpoint}/api/views/{quote(client.dataset, safe='')}.json"
    about = client.description(
        ServiceQuery(description),
        lambda content: json_object(content, description),
        page="browse",
    )
    types = _types(about)
    layer = client.with_license((about.get("license") or {}).get("name"), about.get("attribution"))
    places = [name for name, kind in types.items() if kind in POINTS | SHAPES]
    place = find_field(SHAPE, layer, places) or find_field(POINT, layer, places)
    place = place or next(iter(places), None)
    as_geojson = place is not None and types[place] != LOCATION
    if place is not None and not as_geojson:
        layer = dataclasses.replace(layer, aliases=(*layer.aliases, (POINT, (place,))))
    kind = "geojson" if as_geojson else "json"
    address = f"{client.endpoint}/resource/{quote(client.dataset, safe='')}"
    fields = client.fields(list(types))
    if not fields and len(places) > 1:
        fields = [name for name in types if name not in places]
    position_fields = filter(None, (place, *_coordinates(client, list(types))))
    columns = dict.fromkeys([*fields, *position_fields])
    read = functools.partial(_page, client=client)
    files: tuple[Fetched, ...] = ()
    for box in area.boxes if area is not None else (None,):
        where = _where(client, types, place, box)
        params: dict[str, str | float] = {"$where": where} if where else {}
        total = client.document(
            ServiceQuery(f"{address}.json", {**params, "$select": "count(*)"}),
            lambda content: _count(content, client),
        )
        if fields:
            params["$select"] = ",".join(columns)
        params |= {"$order": ":id", "$limit": PAGE_ROWS}
        query = ServiceQuery(f"{address}.{kind}", params)
        then = next_offset(query, "$offset", total)
        files += client.pages(query.with_params(**{"$offset": 0}), read, then, total=total)
    return Download(spec=layer, files=files, fields=tuple(types))


def _types(about: Mapping[str, Any]) -> dict[str, str]:
    """Return the types of a dataset's columns, without columns that the portal computes."""
    columns = about.get("columns")
    if not isinstance(columns, list):
        raise SourceError(
            "the portal does not describe its dataset as Socrata does; check that the address is "
            "that of a Socrata portal."
        )
    types = {item.get("fieldName", ""): item.get("dataTypeName", "") for item in columns}
    return {name: kind for name, kind in types.items() if name and not name.startswith(":")}


def _coordinates(client: Client, fields: list[str]) -> tuple[str | None, str | None]:
    """Return the columns of longitude and latitude from the catalogue or by common names."""
    layer = client.layer
    if layer.x_field and layer.y_field:
        x, y = (find_field(name, layer, fields) for name in (layer.x_field, layer.y_field))
        return x, y
    place_fields = find_positions(fields, ())
    return (place_fields.x, place_fields.y) if place_fields else (None, None)


def _where(
    client: Client, types: Mapping[str, str], place: str | None, box: Box | None
) -> str | None:
    """Return the condition for a box and the layer's filter; None without both.

    A dataset without columns of positions is not limited to the box.
    """
    conditions = [client.layer.server_where] if client.layer.server_where else []
    if box is not None:
        west, south, east, north = (f"{number:.7f}" for number in box)
        if place is None:
            # Two columns of coordinates, which may be text.
            names = _coordinates(client, list(types))
            conditions += [
                f"{name}{'::number' * (types[name] == TEXT)} between {least} and {most}"
                for name, least, most in zip(names, (west, south), (east, north), strict=True)
                if name is not None
            ]
        elif types[place] in POINTS:
            conditions.append(f"within_box({place}, {north}, {west}, {south}, {east})")
        else:
            corners = [(west, south), (east, south), (east, north), (west, north), (west, south)]
            ring = ", ".join(f"{x} {y}" for x, y in corners)
            conditions.append(f"intersects({place}, 'POLYGON (({ring}))')")
    return " AND ".join(f"({condition})" for condition in conditions) or None


def _page(content: bytes, client: Client) -> Page:
    """Parse a page of GeoJSON, or a list of rows."""
    value = json_value(content, client.endpoint)
    if isinstance(value, list):
        return Page(value)
    return geojson_page(content, client)


def _count(content: bytes, client: Client) -> int | None:
    """Return the number in an answer with one row and one column, or None."""
    value = json_value(content, client.endpoint)
    try:
        return int(next(iter(value[0].values())))
    except (AttributeError, LookupError, TypeError, ValueError, StopIteration):
        return None
