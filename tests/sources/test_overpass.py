"""Overpass and Nominatim, simulated by a local server, and files of Overpass."""

from __future__ import annotations

import dataclasses
import itertools
import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from sentences import refused
from servers import Answer

from semsig_gis.core import CatalogError, InputError, SourceError
from semsig_gis.sources import (
    ANY_VALUE,
    Area,
    HttpError,
    HttpSpec,
    LayerSpec,
    NotCachedError,
    RowCounts,
    find_place,
    load_catalog,
    overpass_query,
    parse_area,
    waiting_time,
)
from semsig_gis.sources.osm import file as osm_file
from semsig_gis.sources.osm.documents import read_layers
from semsig_gis.sources.osm.overpass import fetch_layers

if TYPE_CHECKING:
    from collections.abc import Callable

    from servers import Request, Server

    from semsig_gis.sources import Cache

    Get = Callable[..., list[Path]]

DATA = Path(__file__).with_name("data")
AREA = parse_area("2,48,2.2,48.1")  # two tiles
TIMED_OUT = 'runtime error: Query timed out in "query" at line 3 after 91 seconds.'
NO_MEMORY = "runtime error: Query run out of memory using about 512 MB of RAM."
NOT_READY = "runtime error: open64: 0 Success /osm3s_osm_base Dispatcher_Client::1. Probably down."
FREE = Answer(b"Connected as: 1\nRate limit: 2\n2 slots available now.\n", type="text/plain")
BUSY = (
    "Rate limit: 2\n"
    "Slot available after: 2026-01-01T00:01:00Z, in 60 seconds.\n"
    "Slot available after: 2026-01-01T00:00:07Z, in 7 seconds.\n"
    "Currently running queries (pid, space limit, time limit, start time):\n"
)


BENCH = LayerSpec(name="t", class_name="bench", tags=((("amenity", ("bench",)),),))


def node(number: int, lon: float, lat: float, **tags: str) -> dict[str, Any]:
    element = {"type": "node", "id": number, "lat": lat, "lon": lon}
    return element | ({"tags": tags} if tags else {})


def line(*xy: tuple[float, float] | None) -> list[dict[str, float] | None]:
    return [place and {"lat": place[1], "lon": place[0]} for place in xy]


def sent(elements: list[Any], remark: str = "") -> bytes:
    document = {"version": 0.6, "generator": "Overpass API", "elements": elements}
    return json.dumps(document | ({"remark": remark} if remark else {})).encode()


BENCHES = [
    node(n, lon, lat, amenity="bench")
    for n, (lon, lat) in enumerate(itertools.product((2.05, 2.1, 2.15), (48.02, 48.07)), start=1)
]


def box_of(request: Request) -> tuple[float, float, float, float]:
    """Return west, south, east and north of a query."""
    match = re.search(r"\[bbox:(.*?)\]", request.form["data"])
    assert match is not None
    south, west, north, east = map(float, match[1].split(","))
    return west, south, east, north


def in_box(request: Request) -> Answer:
    """Answer with the benches in the box of the query."""
    west, south, east, north = box_of(request)
    inside = [b for b in BENCHES if west <= b["lon"] <= east and south <= b["lat"] <= north]
    return Answer(sent(inside))


def wider_than(limit: float, answer: Answer) -> Callable[[Request], Answer]:
    """Return a script that answers a wider tile with `answer`."""

    def script(request: Request) -> Answer:
        west, _, east, _ = box_of(request)
        return answer if east - west > limit + 1e-6 else in_box(request)

    return script


@pytest.fixture
def server(server: Server) -> Server:
    server.on("/api/status", FREE)
    server.on("/api/interpreter", in_box)
    return server


@pytest.fixture
def get(server: Server, cache: Cache, quick: HttpSpec) -> Get:
    """Fetch the benches of the area; keywords replace arguments or fields of the spec."""
    fields = {field.name for field in dataclasses.fields(HttpSpec)}

    def call(**what: Any) -> list[Path]:  # noqa: ANN401 - see above
        own = {name: what.pop(name) for name in fields & what.keys()}
        spec = replace(quick, **{"attempts": 2, **own})
        options = {"area": AREA, "endpoints": [f"{server.url}/api"], "cache": cache, "spec": spec}
        return fetch_layers([BENCH], **{**options, **what})

    return call


def query_count(server: Server) -> int:
    """Return the number of queries that the server received."""
    return sum(path.endswith("/interpreter") for path in server.paths())


def ids(paths: list[Path]) -> list[str]:
    (layer,) = read_layers(paths, [BENCH])
    assert layer.counts.unreadable == 0
    return sorted(layer.table["source_id"])


ALL = [f"node/{bench['id']}" for bench in BENCHES]


def test_query_has_exact_tags(snapshot: Callable[[str, str], None]) -> None:
    marked = (("highway", ("crossing",)), ("crossing", ("marked", "a.b;c")))
    tags = (marked, (("crossing:markings", ("*",)),))
    crossings = replace(BENCH, tags=tags, elements=("node",))
    areas = replace(BENCH, tags=((("na\\me", ('a"b',)),),), elements=("way", "relation"))
    query = overpass_query([crossings, areas, crossings], (1, 2, 3, 4), timeout=25)
    snapshot("query.overpassql", f"{query}\n")
    with refused(CatalogError, "has no tags"):
        overpass_query([replace(BENCH, tags=())], (1, 2, 3, 4))
    # Servers send what is underground too, so that what is left out is counted.
    benches = load_catalog("openstreetmap").layer("benches")
    assert "level" not in overpass_query([benches], (1, 47, 3, 49))


# The star is not a value, it means any value.
TAG_VALUES = st.text(st.characters(min_codepoint=32, max_codepoint=126), min_size=1, max_size=8)


@given(TAG_VALUES.filter(lambda value: value != ANY_VALUE))
def test_pattern_for_several_values_matches_exactly_these(value: str) -> None:
    layer = replace(BENCH, tags=((("k", (value, "other")),),), elements=("node",))
    match = re.search(r'(?m)^node\["k"~"(.*)"\];$', overpass_query([layer], (1, 2, 3, 4)))
    assert match is not None
    pattern = re.sub(r"\\(.)", r"\1", match[1])  # as the server reads a text
    assert re.search(pattern, value)
    assert not re.search(pattern, f"{value}x")
    assert not re.search(pattern, f"x{value}") or value.startswith("x")


def test_area_is_fetched_in_tiles(server: Server, get: Get, slept: list[float]) -> None:
    steps: list[tuple[int, int]] = []
    paths = get(progress=lambda *step: steps.append(step))
    assert len(paths) == 2
    assert ids(paths) == ALL  # those on the border of the tiles are in both, and count once
    assert steps == [(1, 2), (2, 2)]
    assert server.paths() == ["/api/status", "/api/interpreter"] * 2
    assert all("semsig_gis/" in request.headers["user-agent"] for request in server.requests)
    assert slept == []


def test_tiles_outside_the_polygon_are_not_requested(server: Server, get: Get) -> None:
    corner = shapely.Polygon([(2, 48), (2.05, 48), (2.2, 48.1), (2.2, 48.1), (2.0, 48.05)])
    get(area=Area(corner, "corner"), tile_deg=0.05)
    assert 0 < query_count(server) < 8


def test_area_across_180_degrees_is_requested_on_both_sides(server: Server, get: Get) -> None:
    get(area=parse_area("179.95,-17,-179.9,-16.9"))
    boxes = sorted(
        box_of(request) for request in server.requests if request.path.endswith("/interpreter")
    )
    assert boxes == [(-180, -17, -179.9, -16.9), (179.95, -17, 180, -16.9)]


def test_second_run_needs_no_server(server: Server, get: Get) -> None:
    first = get()
    assert get() == get(offline=True) == first
    assert (query_count(server), len(server.requests)) == (2, 4)
    with refused(NotCachedError, "is not in the cache"):
        get(offline=True, area=parse_area("1,1,2,2"))


def test_interrupted_run_continues(server: Server, get: Get) -> None:
    server.on("/api/interpreter", in_box, Answer(b"bad", status=400), in_box)
    with pytest.raises(SourceError):
        get()
    assert ids(get()) == ALL
    assert query_count(server) == 3


@pytest.mark.parametrize(
    ("answer", "tries"),
    [
        # After a time-out, the answer has status 200 and the elements up to then.
        (Answer(sent(BENCHES[:1], TIMED_OUT)), 1),
        (Answer(sent(BENCHES[:1], NO_MEMORY)), 1),
        (Answer(status=504), 2),
    ],
)
def test_tile_that_is_too_large_is_split(
    server: Server, get: Get, answer: Answer, tries: int
) -> None:
    server.on("/api/interpreter", wider_than(0.05, answer))
    steps: list[tuple[int, int]] = []
    paths = get(progress=lambda *step: steps.append(step))
    assert ids(paths) == ALL
    assert (len(paths), steps[-1], query_count(server)) == (8, (8, 8), 2 * tries + 8)
    assert get(offline=True) == paths
    if tries == 1:  # what was too much once is not asked for again
        assert get() == paths
        assert query_count(server) == 2 + 8


def test_tile_of_too_many_bytes_is_split(server: Server, get: Get) -> None:
    assert ids(get(max_bytes=len(sent(BENCHES[:2])) + 5)) == ALL
    assert query_count(server) > 2


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (Answer(sent([], TIMED_OUT)), "even for the smallest tile"),
        (Answer(status=504), "504 Gateway Timeout"),
    ],
)
def test_smallest_tile_is_not_split(server: Server, get: Get, answer: Answer, words: str) -> None:
    server.on("/api/interpreter", answer)
    with refused(SourceError, words, f"127.0.0.1:{server.port}"):
        get()


def test_remark_without_error_is_accepted(server: Server, get: Get) -> None:
    server.on("/api/interpreter", Answer(sent(BENCHES, "data is a minute old")))
    assert ids(get()) == ALL


def test_pause_until_a_slot_is_free_has_a_limit(
    server: Server, get: Get, slept: list[float]
) -> None:
    later = BUSY.replace("in 7 s", "in 700 s").replace("in 60 s", "in 900 s")
    server.on("/api/status", *(Answer(text.encode(), type="text/plain") for text in (later, BUSY)))
    with refused(HttpError, "no free slot for 700 s"):
        get()
    assert (slept, query_count(server)) == ([], 0)
    assert ids(get()) == ALL
    assert slept == [8.0, 8.0]  # before each of the tiles


def test_server_without_status_page_is_used(server: Server, get: Get, slept: list[float]) -> None:
    server.on("/api/status", Answer(status=404))
    server.on("/api/interpreter", Answer(status=429, headers={"Retry-After": "5"}), in_box)
    assert (ids(get()), slept) == (ALL, [5.0])


@pytest.mark.parametrize(
    ("status", "seconds"),
    [
        (FREE.body.decode(), 0),
        (BUSY, 7),
        ("Rate limit: 0\n", 0),
        ("Rate limit: 2\n0 slots available now.\nSlot available after: x, in 3 seconds.", 3),
        ("Slot available after: x, in -2 seconds.", 0),
        ("<html>", 0),
    ],
)
def test_waiting_time_is_read_from_the_status_page(status: str, seconds: float) -> None:
    assert waiting_time(status) == seconds


BROKEN = {
    "503": Answer(status=503),
    "html": Answer(b"<html>", type="text/html"),
    "cut": Answer(b'{"elements": ['),
    "list": Answer(b"[]"),
    "number": Answer(b'{"elements": [1]}'),
    "no id": Answer(b'{"elements": [{"type": "node"}]}'),
    "tags": Answer(b'{"elements": [{"type": "node", "id": 1, "tags": {"a": []}}]}'),
    "not ready": Answer(sent([], NOT_READY)),
    "redirect": Answer(status=302, headers={"Location": "http://localhost:1/api"}),
}


@pytest.mark.parametrize("bad", BROKEN.values(), ids=BROKEN)
def test_other_server_is_used_if_one_fails(server: Server, get: Get, bad: Answer) -> None:
    server.on("/broken/interpreter", bad)
    endpoints = [f"{server.url}/broken", f"{server.url}/api/interpreter/"]
    assert ids(get(endpoints=endpoints)) == ALL
    tries = server.paths().count("/broken/interpreter")
    assert tries == (2 if bad.status == 503 else 1)  # and not for every tile again
    with refused(SourceError, f"127.0.0.1:{server.port}"):
        get(endpoints=endpoints[:1], area=parse_area("3,48,3.1,48.1"))


def test_error_names_each_failing_server(server: Server, get: Get) -> None:
    server.on("/a/interpreter", Answer(status=503))
    with refused(SourceError, "no Overpass server", "503", "localhost", "404"):
        get(endpoints=[f"{server.url}/a", f"{server.other_host}/b"])
    with refused(InputError, "tile_deg is 0"):
        get(tile_deg=0)
    with refused(InputError, "requests, and at most 10,000 are sent", "smaller one", "extract"):
        get(tile_deg=1e-7)


def read(path: Path, *specs: LayerSpec, **options: Any) -> Any:  # noqa: ANN401
    layers = read_layers(path, specs, **options)
    assert all(layer.counts.kept == len(layer.table) for layer in layers)
    return layers[0] if len(layers) == 1 else layers


def test_nodes_and_ways_become_objects() -> None:
    path = DATA / "overpass_objects.json"
    layer = read(path, BENCH)
    assert layer.table["source_id"].tolist() == ["node/1", "way/1", "way/2", "way/3", "way/4"]
    expected = [(2.5, 48.5), (2.1, 48.0), (2.001, 48.001), (2.25, 48.25), (2.1, 49.0)]
    places = shapely.get_coordinates(shapely.centroid(layer.table.geometry.array))
    assert places == pytest.approx(np.array(expected))
    assert layer.notes == ("1 elements have only the middle of their box; ask for `out geom`",)
    assert list(layer.table.columns) == ["class_name", "source_id", "geometry"]
    assert layer.table.crs == "EPSG:4326"
    nodes = replace(BENCH, elements=("node",), where=(("user", ("nobody",)),))
    assert read(path, nodes).counts == RowCounts(read=5, filtered=5)
    assert read(path, nodes, filters=False).table["source_id"].tolist() == ["node/1"]


def test_buildings_and_streets_keep_their_shape() -> None:
    shaped = replace(BENCH, class_name="", role="buildings", geometry="polygon")
    buildings = replace(shaped, tags=((("building", ("*",)),),))
    streets = replace(shaped, role="streets", geometry="line", tags=((("highway", ("*",)),),))
    footprints, lines = read(DATA / "overpass_shapes.json", buildings, streets)
    assert footprints.table["source_id"].tolist() == ["way/1", "relation/5"]
    areas = footprints.table.geometry.map(lambda shape: shape.area).tolist()
    assert areas == pytest.approx([0.002**2, 0.002**2 - 0.0005**2 / 2])  # a triangle is left out
    assert footprints.counts.filtered == 1  # the site
    assert footprints.errors == ("row 4: way/10 has no positions",)
    assert lines.table.geometry.geom_type.tolist() == ["LineString"]


@pytest.mark.parametrize(
    ("element", "words"),
    [
        (node(1, 2, 48) | {"lat": None}, "node/1 has no valid position"),
        ({"type": "node", "id": 1}, "node/1 has no valid position"),
        ({"type": "way", "id": 1, "geometry": line((2, 48), None)}, "way/1 lacks 1 of its 2 nodes"),
        ({"type": "way", "id": 1, "nodes": [5, 6, 7]}, "way/1 lacks 3 of its 3 nodes"),
        ({"type": "way", "id": 1, "geometry": 5}, "way/1 is not as Overpass servers send"),
        ({"type": "way", "id": 1, "center": []}, "way/1 has no valid position"),
        ({"type": "relation", "id": 1, "members": [{"type": "way"}]}, "relation/1 is not as"),
        ({"type": "relation", "id": 1}, "relation/1 encloses no area"),
    ],
)
def test_incomplete_element_is_counted(tmp_path: Path, element: dict[str, Any], words: str) -> None:
    tags = {"amenity": "bench", "type": "multipolygon"}
    path = tmp_path / "tile.json"
    path.write_bytes(sent([BENCHES[0], element | {"tags": tags, "id": 99}]))
    layer = read(path, BENCH)
    assert layer.counts.unreadable == 1
    assert len(layer.table) == 1
    assert words.replace("/1 ", "/99 ") in layer.errors[0]


def test_no_layers_need_no_request(cache: Cache) -> None:
    assert fetch_layers([], area=AREA, endpoints=["http://x"], cache=cache) == []


def as_overpass(path: Path) -> bytes:
    """Return the content of an OpenStreetMap XML file as a server sends it with ``out geom``."""
    import xml.etree.ElementTree as ET

    root = ET.parse(path).getroot()  # noqa: S314 - a file of our own
    places = {
        n.get("id"): (float(n.get("lon", 0)), float(n.get("lat", 0))) for n in root.iter("node")
    }
    shapes = {
        w.get("id"): line(*(places.get(nd.get("ref")) for nd in w.iter("nd")))
        for w in root.iter("way")
    }
    elements = []
    for item in root:
        tags = {tag.get("k"): tag.get("v") for tag in item.iter("tag")}
        element: dict[str, Any] = {"type": item.tag, "id": int(item.get("id", 0)), "tags": tags}
        if item.tag == "node":
            element["lon"], element["lat"] = places[item.get("id")]
        elif item.tag == "way":
            element["geometry"] = shapes[item.get("id")]
        elif item.tag == "relation":
            element["members"] = [
                {"type": m.get("type"), "ref": int(m.get("ref", 0)), "role": m.get("role")}
                | ({"geometry": shapes[m.get("ref")]} if m.get("ref") in shapes else {})
                for m in item.iter("member")
            ]
        else:
            continue
        elements.append(element)
    return sent(elements)


def test_server_and_file_give_the_same_city(geodata: Path, tmp_path: Path) -> None:
    file = geodata / "osm" / "neukolln_2024.osm"
    answer = tmp_path / "neukolln.json"
    answer.write_bytes(as_overpass(file))
    specs = [spec for spec in load_catalog("openstreetmap").layers if spec.derive is None]
    pairs = zip(read_layers(answer, specs), osm_file.read_layers(file, specs), strict=True)
    rows = 0
    for ours, theirs in pairs:
        mine = ours.table.set_index("source_id").sort_index()
        other = theirs.table.set_index("source_id").sort_index()
        assert mine.index.tolist() == other.index.tolist(), ours.spec.name
        assert mine.geometry.geom_equals_exact(other.geometry, 1e-7).all(), ours.spec.name
        assert ours.counts == theirs.counts

        rows += len(mine)
    assert rows > 300


def test_place_has_its_outline(server: Server, cache: Cache) -> None:
    outline = json.loads(shapely.to_geojson(shapely.box(13.4, 52.4, 13.5, 52.5)))
    answer = [
        {"display_name": "a statue", "geojson": {"type": "Point", "coordinates": [13, 52]}},
        {"display_name": "nowhere"},
        {"display_name": "Neukölln, Berlin", "geojson": outline},
    ]
    server.on("/search", Answer(json.dumps(answer).encode()))
    where: dict[str, Any] = {"endpoint": f"{server.url}/", "cache": cache}
    area = find_place(" Neukölln  Berlin", **where)
    assert (area.name, area.bounds) == ("Neukölln, Berlin", (13.4, 52.4, 13.5, 52.5))
    (request,) = server.requests
    query = {"q": "Neukölln Berlin", "polygon_geojson": "1", "format": "jsonv2"}
    assert query.items() <= request.query.items()
    assert request.headers["user-agent"].startswith("semsig_gis/")
    again = find_place("Neukölln Berlin", **where, spec=HttpSpec(offline=True))
    assert math.isclose(again.polygon.area, area.polygon.area)
    assert len(server.requests) == 1


@pytest.mark.parametrize(
    ("answer", "kind", "words"),
    [
        (b"[]", InputError, "'Nowhere' is unknown at 127.0.0.1"),
        (b'[{"display_name": "a tree", "geojson": null}]', InputError, "has no outline (a tree)"),
        (b'[{"geojson": {"type": "Polygon", "coordinates": 5}}]', InputError, "has no outline"),
        (b'{"error": "x"}', SourceError, "did not answer as a Nominatim server"),
        (b"[1]", SourceError, "did not answer as a Nominatim server"),
        (b"[{", SourceError, "did not answer as a Nominatim server"),
    ],
)
def test_unknown_place_is_an_error(
    server: Server, cache: Cache, answer: bytes, kind: type[Exception], words: str
) -> None:
    server.on("/search", Answer(answer))
    with refused(kind, words):
        find_place("Nowhere", endpoint=server.url, cache=cache)
