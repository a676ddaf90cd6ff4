"""OpenStreetMap elements from Overpass servers or their JSON files, and places from Nominatim."""

from __future__ import annotations

import collections
import dataclasses
import json
import re
from dataclasses import dataclass
from pathlib import Path
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
from semsig_gis.sources.osm.elements import (
    KIND_BY_LETTER,
    TagIndex,
    add_element,
    element_layers,
    relation_shape,
    require_tags,
    way_shape,
)
from semsig_gis.sources.rows import WGS84, BadFeatureError
from semsig_gis.storage import parse_json

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from semsig_gis.sources.area import Tile
    from semsig_gis.sources.http.cache import Cache
    from semsig_gis.sources.http.fetch import HttpSpec
    from semsig_gis.sources.layer import RawLayer
    from semsig_gis.sources.layer_spec import LayerSpec
    from semsig_gis.sources.rows import Position

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
LONGEST_REMARK = 300
EXHAUSTED = ("timed out", "out of memory")


@dataclass(frozen=True, slots=True)
class Document:
    """Elements of an answer, and the remark of the server, which is usually empty."""

    elements: list[dict[str, Any]]
    remark: str = ""

    @property
    def exhausted(self) -> bool:
        """Whether the answer is incomplete because the question was too large."""
        return self.failed and any(words in self.remark for words in EXHAUSTED)

    @property
    def failed(self) -> bool:
        """Whether the answer is incomplete."""
        return "error" in self.remark


def load_document(path: Path, *, where: str) -> Document:
    """Read an answer, complete or not; SourceError if it is not from an Overpass server."""
    try:
        content = parse_json(path.read_bytes())
        elements = [element for element in content["elements"] if _is_element(element)]
        remark = " ".join(str(content.get("remark", "")).split())
        # The remark becomes a part of a sentence.
        return Document(elements, remark.rstrip(".").replace(". ", ", ")[:LONGEST_REMARK])
    except OSError as error:
        raise SourceError(
            f"{where} cannot be read ({error.strerror}); give a JSON file of an Overpass server."
        ) from error
    except (AttributeError, KeyError, RecursionError, TypeError, ValueError) as error:
        raise SourceError(
            f"{where} is not JSON as Overpass servers send it; download it again."
        ) from error


def _is_element(element: dict[str, Any]) -> bool:
    """Whether an item is a node, way or relation; TypeError if it is a malformed one."""
    if element["type"] not in KIND_BY_LETTER.values():
        return False  # for example a count
    tags = element.get("tags", {})
    if isinstance(element["id"], int) and all(isinstance(value, str) for value in tags.values()):
        return True
    raise TypeError


def read_layers(
    path: str | Path | Sequence[Path],
    specs: Sequence[LayerSpec],
    *,
    filters: bool = True,
    crs: str | None = None,
) -> tuple[RawLayer, ...]:
    """Read the layers of `specs` from a file of Overpass JSON, or from the tiles of an area.

    The layers are the same as those of `sources.osm.file.read_layers`; an element in several tiles
    counts once. SourceError if a file is not Overpass JSON or is incomplete by its own remark.
    """
    paths = [Path(path)] if isinstance(path, str | Path) else list(path)
    where = str(paths[0]) if len(paths) == 1 else f"{len(paths)} tiles"
    layers = element_layers(specs, filters=filters, where=where)
    if not layers:
        return ()
    index = TagIndex(specs)
    known_elements: set[tuple[str, int]] = set()
    centre_counts: collections.Counter[str] = collections.Counter()
    for file in paths:
        document = load_document(file, where=str(file))
        if document.failed:
            raise SourceError(f"{file} is incomplete ({document.remark}); ask for a smaller area.")
        positions = _ElementPositions(document)
        for element in document.elements:
            name = kind, number = element["type"], element["id"]
            # Elements without tags are only there for the positions of others.
            if "tags" in element and name not in known_elements:
                known_elements.add(name)
                tags = element["tags"]
                for layer in (layers[place] for place in index.layers(tags)):
                    position = positions.position(element, layer.spec)
                    accepted = add_element(layer, kind, f"{kind}/{number}", tags, position)
                    centre_counts[layer.spec.name] += accepted and _has_only_centre(element)
    raw = [layer.layer(WGS84, requested=crs) for layer in layers]
    for number, raw_layer in enumerate(raw):
        centres = centre_counts[raw_layer.spec.name]
        if centres and raw_layer.spec.role == "objects":
            note = f"{centres:,} elements have only the middle of their box; ask for `out geom`"
            raw[number] = dataclasses.replace(raw_layer, notes=(*raw_layer.notes, note))
    return tuple(raw)


def _has_only_centre(element: dict[str, Any]) -> bool:
    parts = (element, *element.get("members", ()))
    return "center" in element and not any("geometry" in part for part in parts)


class _ElementPositions:
    """Geometries of the elements of a document.

    A way has the positions of its nodes (``out geom``), only its centre (``out center``), or the
    ids of nodes that are separate elements (``out; >; out skel``).
    """

    def __init__(self, document: Document) -> None:
        self._by_kind: dict[str, dict[int, dict[str, Any]]] = {"node": {}, "way": {}}
        for element in document.elements:
            if element["type"] in self._by_kind:
                self._by_kind[element["type"]][element["id"]] = element

    def position(self, element: dict[str, Any], spec: LayerSpec) -> Position | str:
        """Return the geometry of an element in a layer, or an error message."""
        try:
            return self._shape(element, spec)
        except BadFeatureError as error:
            return str(error)
        except (AttributeError, KeyError, TypeError):
            return "is not as Overpass servers send elements"

    def _shape(self, element: dict[str, Any], spec: LayerSpec) -> Position:
        if element["type"] == "node":
            return _point(element)
        if spec.role == "objects" and _has_only_centre(element):
            return _point(element["center"])
        if element["type"] == "way":
            return way_shape(self._line(element), spec.role)
        outer: list[NDArray[np.float64]] = []
        inner: list[NDArray[np.float64]] = []
        for member in element.get("members", ()):
            if member.get("type") == "way":
                way = member if "geometry" in member else self._by_kind["way"].get(member["ref"])
                lines = inner if member.get("role") == "inner" else outer
                lines.append(self._line(way or {}))
        return relation_shape(outer, inner)

    def _line(self, way: dict[str, Any]) -> NDArray[np.float64]:
        """Return longitude and latitude of the nodes of a way, shape (n, 2)."""
        nodes = way.get("geometry")
        if nodes is None:
            nodes = [self._by_kind["node"].get(number) for number in way.get("nodes", ())]
        missing = sum(node is None for node in nodes)
        if missing or not nodes:
            raise BadFeatureError(
                f"lacks {missing} of its {len(nodes)} nodes" if nodes else "has no positions"
            )
        return np.array([_point(node) for node in nodes])


def _point(place: dict[str, Any]) -> tuple[float, float]:
    try:
        return float(place["lon"]), float(place["lat"])
    except (KeyError, TypeError, ValueError) as error:
        raise BadFeatureError("has no valid position") from error


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
