"""Datasets of Opendatasoft portals, such as Open Data Paris, by the Explore API v2.1."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import shapely

from semsig_gis.core import CatalogError, SourceError
from semsig_gis.sources.services.fetch import service
from semsig_gis.sources.services.layers import POINT, SHAPE, Download, find_field
from semsig_gis.sources.services.pages import ServiceQuery
from semsig_gis.storage import parse_json

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from shapely.geometry.base import BaseGeometry

    from semsig_gis.sources.area import Area
    from semsig_gis.sources.services.pages import Client

# Some servers refuse longer addresses.
LONGEST_OUTLINE = 2_000
GEOJSON = ("application/geo+json", "application/vnd.geo+json", "application/json")


@service
def fetch_layer(client: Client, area: Area | None) -> Download:
    """Fetch a dataset from a portal as one file.

    The first request gets its description, the second one an export. The ``where`` of the export
    consists of the layer's ``server_where`` and the area; an outline with very many corners becomes
    a slightly larger one. A layer that selects fields also gets the fields of its other keys.
    """
    dataset = quote(client.dataset, safe="")
    address = f"{client.endpoint}/api/explore/v2.1/catalog/datasets/{dataset}"

    def field_types(reply: bytes) -> dict[str, str]:
        try:
            content: Any = parse_json(reply)
            return {field["name"]: field["type"] for field in content["fields"]}
        except (KeyError, TypeError, ValueError) as error:
            raise SourceError(
                "the portal does not describe its dataset as the Explore API v2.1 does; "
                "check that the address is that of an Opendatasoft portal."
            ) from error

    def check_complete(path: Path) -> None:
        # A whole file starts and ends as GeoJSON does.
        with path.open("rb") as stream:
            start = stream.read(16).lstrip()
            stream.seek(max(0, path.stat().st_size - 16))
            end = stream.read().rstrip()
        if not (start.startswith(b"{") and end.endswith(b"}")):
            raise SourceError("what the portal sent is not whole geojson; try again later.")

    types = client.description(
        ServiceQuery(address), field_types, page="explore", accept=("application/json",)
    )
    file = client.file(
        ServiceQuery(f"{address}/exports/geojson", _query(client, types, area)),
        check_complete,
        accept=GEOJSON,
        suffix=".geojson",
        progress=client.progress,
    )
    return Download(spec=client.layer, files=(file,))


def _query(client: Client, types: Mapping[str, str], area: Area | None) -> dict[str, str | float]:
    """Return the parameters of an export."""
    layer = client.layer
    places = [name for name, kind in types.items() if kind in {POINT, SHAPE}]
    query: dict[str, str | float] = {"limit": -1}
    conditions = [layer.server_where] if layer.server_where else []
    if area is not None:
        points = [name for name in places if types[name] == POINT] or places
        if not points:
            raise CatalogError(
                f"dataset {layer.dataset!r} of layer {layer.name!r} has no positions to cut an "
                "area out of."
            )
        field = find_field(POINT, layer, points) or points[0]
        west, south, east, north = area.bounds
        if area.polygon.equals(shapely.box(west, south, east, north)):
            inside = f"in_bbox({field}, {south:.7f}, {west:.7f}, {north:.7f}, {east:.7f})"
        else:
            inside = f"intersects({field}, geom'{_outline(area.polygon)}')"
        conditions.append(inside)
    if conditions:
        query["where"] = " and ".join(f"({condition})" for condition in conditions)
    fields = client.fields(list(types))
    if fields:
        query["select"] = ",".join(dict.fromkeys([*fields, *places]))
    return query


def _outline(polygon: BaseGeometry) -> str:
    """Return a polygon as WKT, short enough for an address; it covers the given polygon."""
    text: str = shapely.to_wkt(polygon, rounding_precision=7)
    tolerance = 1e-5  # degrees: about a metre
    while len(text) > LONGEST_OUTLINE:
        # The buffer is wider than the tolerance, because its round corners lie a little inside.
        polygon = polygon.buffer(1.1 * tolerance, quad_segs=2).simplify(tolerance)
        text = shapely.to_wkt(polygon, rounding_precision=7)
        tolerance *= 2
    return text
