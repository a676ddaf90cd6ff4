"""Overpass and Nominatim servers, played on the loopback, and the files that they send."""

from __future__ import annotations

import dataclasses
import itertools
import json
import math
import re
from typing import TYPE_CHECKING, Any

import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from sentences import refused
from servers import Answer, Server

from semsig_gis.core.errors import CatalogError, InputError, SourceError
from semsig_gis.sources.area import Area, parse_area
from semsig_gis.sources.catalog import load_catalog
from semsig_gis.sources.http.cache import Cache
from semsig_gis.sources.http.fetch import HttpError, HttpSpec, NotCachedError
from semsig_gis.sources.layers import ANY_VALUE, LayerSpec
from semsig_gis.sources.osm import file as osm_file
from semsig_gis.sources.osm.overpass import (
    fetch_layers,
    find_place,
    overpass_query,
    read_layers,
    waiting_time,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from servers import Seen

    Get = Callable[..., list[Path]]

AREA = parse_area("2,48,2.2,48.1")  # two tiles
TIMED_OUT = 'runtime error: Query timed out in "query" at line 3 after 91 seconds.'
NO_MEMORY = "runtime error: Query run out of memory using about 512 MB of RAM."
NOT_READY = "runtime error: open64: 0 Success /osm3s_osm_base Dispatcher_Client::1. Probably down."
FREE = (
    "Connected as: 1\nCurrent time: 2026-01-01T00:00:00Z\nRate limit: 2\n2 slots available now.\n"
)
BUSY = (
    "Rate limit: 2\n"
    "Slot available after: 2026-01-01T00:01:00Z, in 60 seconds.\n"
    "Slot available after: 2026-01-01T00:00:07Z, in 7 seconds.\n"
    "Currently running queries (pid, space limit, time limit, start time):\n"
)


def spec_of(**what: Any) -> LayerSpec:  # noqa: ANN401 - any field of a LayerSpec
    return LayerSpec(
        **{"name": "t", "class_name": "bench", "tags": ((("amenity", ("bench",)),),), **what}
    )


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


def box_of(seen: Seen) -> tuple[float, float, float, float]:
    """Return west, south, east and north of a query."""
    found = re.search(r"\[bbox:(.*?)\]", seen.form["data"])
    assert found is not None
    south, west, north, east = map(float, found[1].split(","))
    return west, south, east, north


def in_box(seen: Seen) -> Answer:
    """Answer as a server does that knows the benches."""
    west, south, east, north = box_of(seen)
    inside = [b for b in BENCHES if west <= b["lon"] <= east and south <= b["lat"] <= north]
    return Answer(sent(inside))


def wider_than(limit: float, answer: Answer) -> Callable[[Seen], Answer]:
    """Play a server for which wide tiles are too much."""

    def script(seen: Seen) -> Answer:
        west, _, east, _ = box_of(seen)
        return answer if east - west > limit + 1e-6 else in_box(seen)

    return script


@pytest.fixture
def server() -> Iterator[Server]:
    with Server() as running:
        running.on("/api/status", Answer(FREE.encode(), type="text/plain"))
        running.on("/api/interpreter", in_box)
        yield running


@pytest.fixture
def slept() -> list[float]:
    return []


@pytest.fixture
def get(server: Server, tmp_path: Path, slept: list[float]) -> Get:
    """Fetch the benches of the area; keywords change the specification or those of the call."""
    fields = {field.name for field in dataclasses.fields(HttpSpec)}

    def call(**what: Any) -> list[Path]:  # noqa: ANN401 - see above
        own = {name: what.pop(name) for name in fields & what.keys()}
        spec = HttpSpec(timeout=(2.0, 2.0), attempts=2, backoff_s=1.0, sleep=slept.append)
        given = {
            "area": AREA,
            "endpoints": [f"{server.url}/api"],
            "cache": Cache(tmp_path / "cache"),
            "spec": dataclasses.replace(spec, **own),
        }
        return fetch_layers([spec_of()], **{**given, **what})

    return call


def asked(server: Server) -> int:
    """Return how many queries the server was asked."""
    return sum(path.endswith("/interpreter") for path in server.paths())


def ids(paths: list[Path]) -> list[str]:
    (layer,) = read_layers(paths, [spec_of()])
    assert layer.counts.unreadable == 0
    return sorted(layer.table["source_id"])


ALL = [f"node/{bench['id']}" for bench in BENCHES]


# --- The query ----------------------------------------------------------------------------------


def test_the_query_asks_for_exact_tags() -> None:
    crossings = spec_of(
        tags=(
            (("highway", ("crossing",)), ("crossing", ("marked", "a.b;c"))),
            (("crossing:markings", ("*",)),),
        ),
        elements=("node",),
    )
    areas = spec_of(tags=((("na\\me", ('a"b',)),),), elements=("way", "relation"))
    query = overpass_query([crossings, areas, crossings], (1, 2, 3, 4), timeout=25)
    assert query.splitlines() == [
        "[out:json][timeout:25][bbox:2.0000000,1.0000000,4.0000000,3.0000000];",
        "(",
        r'node["highway"="crossing"]["crossing"~"^(marked|a\\.b;c)$"];',
        'node["crossing:markings"]["crossing:markings"!="no"];',
        r'way["na\\me"="a\"b"];',
        r'relation["na\\me"="a\"b"]["type"="multipolygon"];',
        ");",
        "out body geom;",
    ]


def test_the_query_of_a_layer_without_tags_is_refused() -> None:
    with refused(CatalogError, "has no tags"):
        overpass_query([spec_of(tags=())], (1, 2, 3, 4))


# The star is no value: it stands for all of them.
TAG_VALUES = st.text(st.characters(min_codepoint=32, max_codepoint=126), min_size=1, max_size=8)


@given(TAG_VALUES.filter(lambda value: value != ANY_VALUE))
def test_a_list_of_values_matches_exactly_those(value: str) -> None:
    query = overpass_query(
        [spec_of(tags=((("k", (value, "other")),),), elements=("node",))], (1, 2, 3, 4)
    )
    found = re.search(r'^node\["k"~"(.*)"\];$', query, re.MULTILINE)
    assert found is not None
    pattern = re.sub(r"\\(.)", r"\1", found[1])  # as the server reads a text
    assert re.search(pattern, value)
    assert not re.search(pattern, f"{value}x")
    assert not re.search(pattern, f"x{value}") or value.startswith("x")


def test_the_builtin_catalogue_can_be_asked_for() -> None:
    query = overpass_query(load_catalog("openstreetmap").layers, (1, 2, 3, 4))
    assert 'node["natural"="tree"];' in query
    assert 'way["building"]["building"!="no"];' in query
    assert len(set(query.splitlines())) == len(query.splitlines())


# --- Fetching -----------------------------------------------------------------------------------


def test_an_area_is_fetched_in_tiles(server: Server, get: Get, slept: list[float]) -> None:
    steps: list[tuple[int, int]] = []
    paths = get(progress=lambda *step: steps.append(step))
    assert len(paths) == 2
    assert ids(paths) == ALL  # those on the border of the tiles are in both, and count once
    assert steps == [(1, 2), (2, 2)]
    assert server.paths() == ["/api/status", "/api/interpreter"] * 2
    assert all("semsig_gis/" in seen.headers["user-agent"] for seen in server.seen)
    assert slept == []


def test_tiles_outside_the_polygon_are_not_asked_for(server: Server, get: Get) -> None:
    corner = shapely.Polygon([(2, 48), (2.05, 48), (2.2, 48.1), (2.2, 48.1), (2.0, 48.05)])
    get(area=Area(corner, "corner"), tile_deg=0.05)
    assert 0 < asked(server) < 8


def test_a_second_run_needs_no_server(server: Server, get: Get) -> None:
    first = get()
    assert get() == first
    assert get(offline=True) == first
    assert asked(server) == 2
    assert len(server.seen) == 4
    with refused(NotCachedError, "is not in the cache"):
        get(offline=True, area=parse_area("1,1,2,2"))


def test_an_interrupted_run_goes_on(server: Server, get: Get) -> None:
    server.on("/api/interpreter", in_box, Answer(b"bad", status=400))
    with pytest.raises(SourceError):
        get()
    server.on("/api/interpreter", in_box)
    assert ids(get()) == ALL
    assert asked(server) == 3


@pytest.mark.parametrize("remark", [TIMED_OUT, NO_MEMORY])
def test_a_tile_that_is_too_much_is_split(server: Server, get: Get, remark: str) -> None:
    # A time-out comes with what was found so far, inside an answer 200.
    server.on("/api/interpreter", wider_than(0.05, Answer(sent(BENCHES[:1], remark))))
    steps: list[tuple[int, int]] = []
    paths = get(progress=lambda *step: steps.append(step))
    assert ids(paths) == ALL
    assert len(paths) == 8
    assert steps[-1] == (8, 8)
    assert asked(server) == 2 + 8
    # What was too much once is not asked for again.
    assert get() == paths
    assert get(offline=True) == paths
    assert asked(server) == 2 + 8


def test_a_tile_that_a_gateway_gives_up_is_split(server: Server, get: Get) -> None:
    server.on("/api/interpreter", wider_than(0.05, Answer(status=504)))
    paths = get()
    assert ids(paths) == ALL
    assert get(offline=True) == paths


def test_a_tile_of_too_many_bytes_is_split(server: Server, get: Get) -> None:
    assert ids(get(max_bytes=len(sent(BENCHES[:2])) + 5)) == ALL
    assert asked(server) > 2


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (Answer(sent([], TIMED_OUT)), "even for the smallest tile"),
        (Answer(status=504), "504 Gateway Timeout"),
    ],
)
def test_splitting_ends(server: Server, get: Get, answer: Answer, words: str) -> None:
    server.on("/api/interpreter", answer)
    with refused(SourceError, words, f"127.0.0.1:{server.port}"):
        get()


def test_a_remark_that_is_no_error_is_no_error(server: Server, get: Get) -> None:
    server.on("/api/interpreter", Answer(sent(BENCHES, "data is a minute old")))
    assert ids(get()) == ALL


def test_slots_are_waited_for(server: Server, get: Get, slept: list[float]) -> None:
    server.on("/api/status", Answer(BUSY.encode(), type="text/plain"), Answer(FREE.encode()))
    assert ids(get()) == ALL
    assert slept == [8.0]


def test_slots_that_are_far_away_are_not_waited_for(
    server: Server, get: Get, slept: list[float]
) -> None:
    later = BUSY.replace("in 7 s", "in 700 s").replace("in 60 s", "in 900 s")
    server.on("/api/status", Answer(later.encode(), type="text/plain"))
    with refused(HttpError, "no free slot for 700 s"):
        get()
    assert slept == []
    assert asked(server) == 0


def test_a_server_without_status_is_asked_all_the_same(
    server: Server, get: Get, slept: list[float]
) -> None:
    server.on("/api/status", Answer(status=404))
    server.on("/api/interpreter", Answer(status=429, headers={"Retry-After": "5"}), in_box)
    assert ids(get()) == ALL
    assert slept == [5.0]


@pytest.mark.parametrize(
    ("status", "seconds"),
    [
        (FREE, 0),
        (BUSY, 7),
        ("Rate limit: 0\n", 0),
        ("Rate limit: 2\n0 slots available now.\nSlot available after: x, in 3 seconds.", 3),
        ("Slot available after: x, in -2 seconds.", 0),
        ("<html>", 0),
    ],
)
def test_the_status_says_how_long_to_wait(status: str, seconds: float) -> None:
    assert waiting_time(status) == seconds


@pytest.mark.parametrize(
    "bad",
    [
        Answer(status=503),
        Answer(b"<html>", type="text/html"),
        Answer(b'{"elements": ['),
        Answer(b"[]"),
        Answer(b'{"elements": [1]}'),
        Answer(b'{"elements": [{"type": "node"}]}'),
        Answer(b'{"elements": [{"type": "node", "id": 1, "tags": {"a": []}}]}'),
        Answer(sent([], NOT_READY)),
        Answer(status=302, headers={"Location": "http://localhost:1/api"}),
    ],
    ids=["503", "html", "cut", "list", "number", "no id", "tags", "not ready", "redirect"],
)
def test_another_server_is_asked_where_one_fails(server: Server, get: Get, bad: Answer) -> None:
    server.on("/broken/interpreter", bad)
    endpoints = [f"{server.url}/broken", f"{server.url}/api/interpreter/"]
    assert ids(get(endpoints=endpoints)) == ALL
    tries = server.paths().count("/broken/interpreter")
    assert tries == (2 if bad.status == 503 else 1)  # and not for every tile again
    with refused(SourceError, f"127.0.0.1:{server.port}"):
        get(endpoints=endpoints[:1], area=parse_area("3,48,3.1,48.1"))


def test_where_all_servers_fail_each_is_told(server: Server, get: Get) -> None:
    server.on("/a/interpreter", Answer(status=503))
    with refused(SourceError, "no Overpass server", "503", "localhost", "404"):
        get(endpoints=[f"{server.url}/a", f"{server.other_host}/b"])


def test_what_cannot_be_asked_is_said(get: Get) -> None:
    with refused(InputError, "tile_deg is 0"):
        get(tile_deg=0)


def test_no_layers_need_no_server(tmp_path: Path) -> None:
    assert fetch_layers([], area=AREA, endpoints=["http://x"], cache=Cache(tmp_path)) == []


# --- Reading ------------------------------------------------------------------------------------


def read(folder: Path, elements: list[Any], *specs: LayerSpec) -> Any:  # noqa: ANN401
    path = folder / "tile.json"
    path.write_bytes(sent(elements))
    layers = read_layers(path, specs)
    for layer in layers:
        assert layer.counts.kept == len(layer.table)
    return layers[0] if len(layers) == 1 else layers


SQUARE = [(2.0, 48.0), (2.002, 48.0), (2.002, 48.002), (2.0, 48.002), (2.0, 48.0)]


def test_nodes_and_ways_become_objects(tmp_path: Path) -> None:
    tags = {"amenity": "bench", "user": "kept by no one"}
    elements = [
        node(1, 2.5, 48.5, **tags) | {"user": "me", "uid": 7},
        {"type": "way", "id": 1, "tags": tags, "geometry": line((2, 48), (2.2, 48))},
        {"type": "way", "id": 2, "tags": tags, "geometry": line(*SQUARE)},
        {"type": "way", "id": 3, "tags": tags, "center": {"lon": 2.25, "lat": 48.25}},
        {"type": "way", "id": 4, "tags": tags, "nodes": [91, 92]},
        node(91, 2.0, 49.0),
        node(92, 2.2, 49.0),
        node(2, 2.5, 48.5, amenity="public_bookcase"),
    ]
    layer = read(tmp_path, elements, spec_of())
    places = dict(zip(layer.table["source_id"], layer.table.geometry, strict=True))
    expected = {
        "node/1": (2.5, 48.5),
        "way/1": (2.1, 48.0),
        "way/2": (2.001, 48.001),
        "way/3": (2.25, 48.25),
        "way/4": (2.1, 49.0),
    }
    assert places.keys() == expected.keys()
    for name, xy in expected.items():
        assert (places[name].x, places[name].y) == pytest.approx(xy)
    assert list(layer.table.columns) == ["class_name", "source_id", "geometry"]
    assert layer.table.crs == "EPSG:4326"


def test_buildings_and_streets_keep_their_shape(tmp_path: Path) -> None:
    hole = [(2.0005, 48.0005), (2.001, 48.0005), (2.001, 48.001), (2.0005, 48.0005)]
    yes = {"building": "yes"}
    multipolygon = {
        "type": "relation",
        "id": 5,
        "tags": yes | {"type": "multipolygon"},
        "members": [
            {"type": "way", "ref": 1, "role": "outer", "geometry": line(*SQUARE[:3])},
            {"type": "way", "ref": 2, "role": "outer"},
            {"type": "way", "ref": 3, "role": "inner", "geometry": line(*hole)},
            {"type": "node", "ref": 4, "role": "entrance"},
        ],
    }
    elements = [
        {"type": "way", "id": 1, "tags": yes, "geometry": line(*SQUARE)},
        {"type": "way", "id": 2, "geometry": line(*SQUARE[2:])},
        {"type": "way", "id": 3, "tags": {"building": "no"}, "geometry": line(*SQUARE)},
        multipolygon,
        {"type": "relation", "id": 6, "tags": yes | {"type": "site"}, "members": []},
        {"type": "way", "id": 9, "tags": {"highway": "residential"}, "geometry": line(*SQUARE)},
        {"type": "way", "id": 10, "tags": yes, "center": {"lon": 2.0, "lat": 48.0}},
    ]
    buildings = spec_of(
        class_name="", role="buildings", geometry="polygon", tags=((("building", ("*",)),),)
    )
    streets = spec_of(
        class_name="", role="streets", geometry="line", tags=((("highway", ("residential",)),),)
    )
    footprints, lines = read(tmp_path, elements, buildings, streets)
    assert footprints.table["source_id"].tolist() == ["way/1", "relation/5"]
    whole, holed = footprints.table.geometry
    assert whole.area == pytest.approx(0.002**2)
    assert holed.area == pytest.approx(0.002**2 - shapely.Polygon(hole).area)
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
def test_an_incomplete_element_is_counted(
    tmp_path: Path, element: dict[str, Any], words: str
) -> None:
    tags = {"amenity": "bench", "type": "multipolygon"}
    layer = read(tmp_path, [BENCHES[0], element | {"tags": tags, "id": 99}], spec_of())
    assert layer.counts.unreadable == 1
    assert len(layer.table) == 1
    assert words.replace("/1 ", "/99 ") in layer.errors[0]


def test_the_kinds_and_filters_of_a_layer_hold(tmp_path: Path) -> None:
    stops = spec_of(elements=("node",), where=(("shelter", ("yes",)),))
    elements = [
        node(1, 2, 48, amenity="bench", shelter="yes"),
        node(2, 2, 48, amenity="bench"),
        {"type": "way", "id": 3, "tags": {"amenity": "bench"}, "geometry": line(*SQUARE)},
    ]
    layer = read(tmp_path, elements, stops)
    assert layer.table["source_id"].tolist() == ["node/1"]
    assert (layer.counts.read, layer.counts.filtered) == (3, 2)
    (unfiltered,) = read_layers(tmp_path / "tile.json", [stops], filters=False)
    assert unfiltered.table["source_id"].tolist() == ["node/1", "node/2"]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is not what Overpass servers send"),
        (b"\xff\xfe", "is not what Overpass servers send"),
        (b"null", "is not what Overpass servers send"),
        (b"[" * 100_000, "is not what Overpass servers send"),
        (sent(BENCHES, TIMED_OUT), "is incomplete (runtime error: Query timed out"),
        (None, "cannot be read (No such file"),
    ],
)
def test_a_file_that_is_no_answer_is_said(
    tmp_path: Path, content: bytes | None, words: str
) -> None:
    path = tmp_path / "tile.json"
    if content is not None:
        path.write_bytes(content)
    with refused(SourceError, words):
        read_layers(path, [spec_of()])


def test_no_layers_are_none(tmp_path: Path) -> None:
    assert read_layers(tmp_path / "nowhere.json", []) == ()


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


def test_a_server_and_a_file_say_the_same_of_a_city(geodata: Path, tmp_path: Path) -> None:
    file = geodata / "osm" / "neukolln_2024.osm"
    answer = tmp_path / "neukolln.json"
    answer.write_bytes(as_overpass(file))
    specs = load_catalog("openstreetmap").layers
    pairs = zip(read_layers(answer, specs), osm_file.read_layers(file, specs), strict=True)
    found = 0
    for ours, theirs in pairs:
        mine = ours.table.set_index("source_id").sort_index()
        other = theirs.table.set_index("source_id").sort_index()
        assert mine.index.tolist() == other.index.tolist(), ours.spec.name
        assert mine.geometry.geom_equals_exact(other.geometry, 1e-7).all(), ours.spec.name
        assert ours.counts == theirs.counts

        found += len(mine)
    assert found > 300


# --- Places -------------------------------------------------------------------------------------


def test_a_place_is_found_with_its_outline(server: Server, tmp_path: Path) -> None:
    outline = json.loads(shapely.to_geojson(shapely.box(13.4, 52.4, 13.5, 52.5)))
    answer = [
        {"display_name": "a statue", "geojson": {"type": "Point", "coordinates": [13, 52]}},
        {"display_name": "nowhere"},
        {"display_name": "Neukölln, Berlin", "geojson": outline},
    ]
    server.on("/search", Answer(json.dumps(answer).encode()))
    cache = Cache(tmp_path)
    area = find_place(" Neukölln  Berlin", endpoint=f"{server.url}/", cache=cache)
    assert area.name == "Neukölln, Berlin"
    assert area.bounds == (13.4, 52.4, 13.5, 52.5)
    (seen,) = server.seen
    assert seen.query["q"] == "Neukölln Berlin"
    assert seen.query["polygon_geojson"] == "1"
    assert seen.query["format"] == "jsonv2"
    assert seen.headers["user-agent"].startswith("semsig_gis/")
    again = find_place(
        "Neukölln Berlin", endpoint=f"{server.url}/", cache=cache, spec=HttpSpec(offline=True)
    )
    assert math.isclose(again.polygon.area, area.polygon.area)
    assert len(server.seen) == 1


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
def test_a_place_that_is_not_found_is_said(
    server: Server, tmp_path: Path, answer: bytes, kind: type[Exception], words: str
) -> None:
    server.on("/search", Answer(answer))
    with refused(kind, words):
        find_place("Nowhere", endpoint=server.url, cache=Cache(tmp_path))
