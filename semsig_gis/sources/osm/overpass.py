"""OpenStreetMap elements from Overpass servers, and places from Nominatim."""

from __future__ import annotations

import dataclasses
import json
import re
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from semsig_gis.core import InputError, SourceError
from semsig_gis.sources.area import Area, fetch_tiles, join_areas, tiles_of
from semsig_gis.sources.filters import ANY_VALUE
from semsig_gis.sources.http.fetch import (
    DEFAULT_HTTP,
    HttpError,
    NotCachedError,
    TooLargeError,
    fetch,
    host_of,
    read_text,
)
from semsig_gis.sources.osm.documents import load_document
from semsig_gis.sources.osm.elements import require_tags
from semsig_gis.storage import parse_json

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from semsig_gis.sources.area import Tile
    from semsig_gis.sources.http.cache import Cache
    from semsig_gis.sources.http.fetch import HttpSpec
    from semsig_gis.sources.layer_spec import LayerSpec

JSON = ("application/json",)
QUERY_S = 90  # time limit of a query on the server
ANSWER_S = 30.0  # additional time for waiting and for the transfer
STATUS_S = 10.0
TILE_BYTES = 2**28  # limit, because a tile is parsed in memory
MOST_SPLITS = 4
TOO_SLOW = 504
TOO_MANY = 429
NO_SLOT_MARGIN_S = 1.0
# Characters with a meaning in POSIX extended regular expressions.
SPECIAL = re.compile(r"[.^$*+?()\[\]{}|\\]")


def find_place(name: str, *, endpoint: str, cache: Cache, spec: HttpSpec = DEFAULT_HTTP) -> Area:
    """Return the first place with a name and an outline, from a Nominatim server."""
    name = " ".join(name.split())
    if not name:
        raise InputError("the name of the place is empty; write one such as 'Helsinki'.")
    host = host_of(endpoint)

    file = fetch(
        f"{endpoint.rstrip('/')}/search",
        params={"q": name, "format": "jsonv2", "polygon_geojson": 1, "limit": 10},
        cache=cache,
        spec=spec,
        accept=JSON,
        check=lambda path: _places(path, host),
    )
    places = _places(file.path, host)
    for place in places:
        try:
            geometry = shapely.from_geojson(json.dumps(place.get("geojson")))
        except shapely.errors.ShapelyError:
            continue  # it has no outline, or an invalid one
        outline = join_areas(np.array([geometry]))
        if outline is not None:
            return Area(outline, str(place.get("display_name", name)))
    problem = f"has no outline ({places[0].get('display_name')})" if places else "is unknown"
    raise InputError(
        f"place {name!r} {problem} at {host}; write the name of a city or district, or its "
        "bounding box as west,south,east,north."
    )


def _places(path: Path, host: str) -> list[dict[str, Any]]:
    try:
        places = parse_json(path.read_bytes())
    except ValueError:
        places = None
    if not isinstance(places, list) or not all(isinstance(place, dict) for place in places):
        raise SourceError(f"{host} did not answer as a Nominatim server does; check the address.")
    return places


def overpass_query(
    specs: Sequence[LayerSpec], bounds: tuple[float, float, float, float], *, timeout: int = QUERY_S
) -> str:
    """Return the Overpass QL query for the elements of layers, by their ``tags`` and ``elements``.

    Bounds are west, south, east and north in degrees. Values match exactly. The answer has the
    geometry of ways and multipolygons, and no names of mappers.
    """
    west, south, east, north = bounds
    # A dict removes the repeats of several layers and keeps the order.
    lines: dict[str, None] = {}
    for spec in specs:
        for alternative in require_tags(spec):
            filters = "".join(_filter(key, values) for key, values in alternative)
            for kind in spec.elements:
                # The reader accepts only multipolygons among the relations.
                areas = '["type"="multipolygon"]' if kind == "relation" else ""
                lines[f"{kind}{filters}{areas};"] = None
    box = f"{south:.7f},{west:.7f},{north:.7f},{east:.7f}"
    head = f"[out:json][timeout:{timeout}][bbox:{box}];"
    return "\n".join([head, "(", *lines, ");", "out body geom;"])


def _filter(key: str, values: tuple[str, ...]) -> str:
    if ANY_VALUE in values:
        return f'[{_quoted(key)}][{_quoted(key)}!="no"]'
    if len(values) == 1:
        return f"[{_quoted(key)}={_quoted(values[0])}]"
    pattern = "|".join(SPECIAL.sub(r"\\\g<0>", value) for value in values)
    return f"[{_quoted(key)}~{_quoted(f'^({pattern})$')}]"


def _quoted(text: str) -> str:
    return '"{}"'.format(text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n"))


def fetch_layers(
    specs: Sequence[LayerSpec],
    *,
    area: Area,
    endpoints: Sequence[str],
    cache: Cache,
    spec: HttpSpec = DEFAULT_HTTP,
    tile_deg: float = 0.1,
    progress: Callable[[int, int], None] | None = None,
) -> list[Path]:
    """Fetch the elements of layers in an area, and some around it, as files for `read_layers`.

    Each tile of at most `tile_deg` degrees is a file; a tile that is too large for the servers is
    split into four. An endpoint is for example ``"https://overpass-api.de/api"``; one that fails
    becomes the last one to try. The cache does not distinguish the servers, so that a later run
    continues an interrupted one. `progress` takes the number of finished tiles and of all tiles,
    which may grow. SourceError if no server answers for a tile.
    """
    if not endpoints:
        raise InputError("there is no Overpass server to ask; name one in endpoints.")
    if not specs:
        return []
    addresses = [address.rstrip("/").removesuffix("/interpreter") for address in endpoints]
    servers = _Servers(addresses, cache, spec)
    remedy = "give a smaller one, or load an extract of OpenStreetMap"

    def fetch_tile(tile: Tile) -> Path | None:
        last = tile.splits == MOST_SPLITS
        return servers.answer(overpass_query(specs, tile.bounds), last=last)

    return fetch_tiles(tiles_of(area, tile_deg, remedy=remedy), area, fetch_tile, progress)


class _Servers:
    """Servers with the same data, in the order of the attempts."""

    def __init__(self, addresses: list[str], cache: Cache, spec: HttpSpec) -> None:
        connect, read = spec.timeout
        self._addresses = addresses
        self._cache = cache
        self._spec = dataclasses.replace(
            spec,
            timeout=(connect, max(read, QUERY_S + ANSWER_S)),
            max_bytes=min(spec.max_bytes, TILE_BYTES),
        )

    def answer(self, query: str, *, last: bool) -> Path | None:
        """Return the file of the answer; None, unless `last`, if a smaller tile may work."""
        failures: list[SourceError] = []
        for address in tuple(self._addresses):
            try:
                path = self._ask(address, query)
            except TooLargeError as error:
                failures = [error]
                break
            except SourceError as error:
                failures.append(error)
                if isinstance(error, NotCachedError):
                    break  # it is the same for all servers
                self._addresses.remove(address)
                self._addresses.append(address)
                continue
            document = load_document(path, where=str(path))
            if not document.exhausted:
                return path
            msg = (
                f"{host_of(address)} cannot answer even for the smallest tile ({document.remark}); "
                "ask for fewer layers or try again later."
            )
            failures = [TooLargeError(msg)]
            break
        # Offline, the cache may have only the quarters of a tile.
        too_large = (
            isinstance(failure, TooLargeError | NotCachedError)
            or (isinstance(failure, HttpError) and failure.status == TOO_SLOW)
            for failure in failures
        )
        if not last and any(too_large):
            return None
        if len(failures) == 1:
            raise failures[0]
        causes = ", and ".join(str(failure).rstrip(".") for failure in failures)
        raise SourceError(f"no Overpass server gave an answer: {causes}.") from failures[0]

    def _ask(self, address: str, query: str) -> Path:
        def check(path: Path) -> None:
            document = load_document(path, where=f"the answer of {host_of(address)}")
            # An answer that is too large is cached, so that the next run splits the tile at once.
            if document.failed and not document.exhausted:
                raise HttpError(f"{host_of(address)} failed ({document.remark}); try again later.")

        def wait_for_slot() -> None:
            spec = self._spec
            short = dataclasses.replace(spec, timeout=(STATUS_S, STATUS_S), deadline_s=STATUS_S)
            try:
                status = read_text(f"{address}/status", spec=short)
            except SourceError:
                return  # without a status page, the answer to the query shows that a server is busy
            wait = waiting_time(status)
            if wait > spec.longest_wait_s:
                raise HttpError(
                    f"{host_of(address)} has no free slot for {wait:.0f} s; try again after that.",
                    TOO_MANY,
                )
            if wait:
                spec.report(f"{host_of(address)} has no free slot for {wait:.0f} s")
                spec.sleep(wait + NO_SLOT_MARGIN_S)

        return fetch(
            f"{address}/interpreter",
            data={"data": query},
            cache=self._cache,
            spec=self._spec,
            accept=JSON,
            identity="overpass",
            check=check,
            before=wait_for_slot,
        ).path


def waiting_time(status: str) -> float:
    """Return the seconds until a slot is free, from the page ``/api/status``; 0 if not stated."""
    free = re.search(r"^(\d+) slots? available now", status, re.MULTILINE)
    if free and int(free[1]):
        return 0.0
    later = re.findall(r"^Slot available after: .*?, in (-?\d+) seconds", status, re.MULTILINE)
    return max(0.0, min(map(float, later), default=0.0))
