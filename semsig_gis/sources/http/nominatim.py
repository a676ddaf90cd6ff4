"""Places by name, from a Nominatim server."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from semsig_gis.core.errors import InputError, SourceError
from semsig_gis.sources.area import Area, join_areas
from semsig_gis.sources.http.fetch import fetch
from semsig_gis.sources.http.wire import DEFAULT_HTTP, host_of

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.sources.http.cache import Cache
    from semsig_gis.sources.http.wire import HttpSpec


def find_place(name: str, *, endpoint: str, cache: Cache, spec: HttpSpec = DEFAULT_HTTP) -> Area:
    """Return the first place of that name that has an outline, from a Nominatim server.

    InputError if there is no such place, or it is known as a point or a line only.
    """
    name = " ".join(name.split())
    if not name:
        msg = "the name of the place is empty; write one such as 'Helsinki'."
        raise InputError(msg)
    host = host_of(endpoint)

    def check(path: Path) -> None:
        _places(path, host)

    fetched = fetch(
        f"{endpoint.rstrip('/')}/search",
        params={"q": name, "format": "jsonv2", "polygon_geojson": 1, "limit": 10},
        cache=cache,
        spec=spec,
        accept=("application/json",),
        check=check,
    )
    places = _places(fetched.path, host)
    for place in places:
        outline = _outline(place)
        if outline is not None:
            return Area(outline, str(place.get("display_name", name)))
    found = f"has no outline ({places[0].get('display_name')})" if places else "is unknown"
    msg = (
        f"place {name!r} {found} at {host}; write the name of a city or district, or its bounding "
        "box as west,south,east,north."
    )
    raise InputError(msg)


def _places(path: Path, host: str) -> list[dict[str, Any]]:
    try:
        places = json.loads(path.read_bytes())
    except ValueError:
        places = None
    if not isinstance(places, list) or not all(isinstance(place, dict) for place in places):
        msg = f"{host} did not answer as a Nominatim server does; check the address."
        raise SourceError(msg)
    return places


def _outline(place: dict[str, Any]) -> shapely.Polygon | shapely.MultiPolygon | None:
    """Return the outline of a place; None where it has none, or not a valid one."""
    try:
        geometry = shapely.from_geojson(json.dumps(place.get("geojson")))
    except shapely.errors.ShapelyError:
        return None
    return join_areas(np.array([geometry]))
