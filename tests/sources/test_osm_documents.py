"""Forms of OpenStreetMap's elements that servers, editors and programs write."""

from __future__ import annotations

import bz2
import gzip
import json
from typing import TYPE_CHECKING, Any

import pytest
import shapely
from osm_xml import node, relation, way
from sentences import refused

from semsig_gis.core import SourceError
from semsig_gis.objects import load
from semsig_gis.sources import load_catalog, reader
from semsig_gis.sources.files import file_reader

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from semsig_gis.sources import RawLayer

BENCH = {"amenity": "bench"}
BENCHES = load_catalog("openstreetmap").layer("benches")
NODE = node(1, 2, 48, BENCH)
TAGS = '<tag k="amenity" v="bench"/>'
AREA_TAGS = f'{TAGS}<tag k="type" v="multipolygon"/>'
CENTRE, BOUNDS = (
    '<center lat="48.5" lon="2.5"/>',
    '<bounds minlat="1" minlon="1" maxlat="2" maxlon="2"/>',
)
RING = [(2, 48), (2.2, 48), (2.2, 48.2), (2, 48.2), (2, 48)]
PLACES = "".join(f'<nd lat="{lat}" lon="{lon}"/>' for lon, lat in RING)
PLACED = "".join(f'<nd ref="{n % 4 + 1}" lat="{y}" lon="{x}"/>' for n, (x, y) in enumerate(RING))
OUTER = f'<member type="way" ref="7" role="outer">{PLACES}</member>'
# The elements of XML, and the middles of the benches in it.
XML: dict[str, tuple[list[str], dict[str, tuple[float, float]]]] = {
    "centre of a way": (
        [f'<way id="5">{CENTRE}<nd ref="1"/><nd ref="2"/>{TAGS}</way>'],
        {"way/5": (2.5, 48.5)},
    ),
    "centre of a relation, before a node": (
        [
            f'<relation id="5">{CENTRE}<member type="way" ref="7" role=""/>{AREA_TAGS}</relation>',
            NODE,
        ],
        {"relation/5": (2.5, 48.5), "node/1": (2, 48)},
    ),
    "geometry of a way": ([f'<way id="5">{BOUNDS}{PLACED}{TAGS}</way>'], {"way/5": (2.1, 48.1)}),
    "geometry of a way without bounds": (
        [f'<way id="5">{PLACED}{TAGS}</way>'],
        {"way/5": (2.1, 48.1)},
    ),
    "geometry of a multipolygon": (
        [NODE, f'<relation id="5">{BOUNDS}{OUTER}{AREA_TAGS}</relation>'],
        {"node/1": (2, 48), "relation/5": (2.1, 48.1)},
    ),
    "bounds and nodes": (
        [
            *(node(n + 1, *place) for n, place in enumerate(RING[:4])),
            way(5, [1, 2, 3, 4, 1], BENCH).replace("<nd", f"{BOUNDS}<nd", 1),
        ],
        {"way/5": (2.1, 48.1)},
    ),
    "deleted in an editor": (
        [
            node(-1, 2, 48, BENCH, action="modify", visible="true"),
            node(2, 2, 48, BENCH, action="delete", visible="true"),
            node(3, 2, 48, action="delete"),
            way(5, [3, 3], BENCH, action="delete"),
            "<relation id='6' action = 'delete'><tag k='amenity' v='bench'/></relation>",
        ],
        {"node/-1": (2, 48)},
    ),
    "deleted and newer": (
        [
            node(1, 3, 48, BENCH, version=1),
            node(1, 2, 48, BENCH, version=2),
            node(2, 2, 48, BENCH, version=1, action="delete"),
        ],
        {"node/1": (2, 48)},
    ),
    "changesets": (
        ['<changeset id="1"><tag k="amenity" v="bench"/></changeset>', NODE],
        {"node/1": (2, 48)},
    ),
}


def middles(layer: RawLayer) -> dict[str, tuple[float, float]]:
    assert layer.counts.kept == len(layer)
    xy = shapely.get_coordinates(shapely.centroid(layer.geometry)).round(9).tolist()
    return dict(zip(layer.columns["source_id"].to_pylist(), map(tuple, xy), strict=True))


def read(path: Path) -> RawLayer:
    name = file_reader(path, sure=True)
    assert name is not None
    (layer,) = reader(name)(path, [BENCHES])
    return layer


@pytest.mark.parametrize("name", ["a.osm", "a.osm.gz", "a.osm.bz2", "export.xml", "map"])
@pytest.mark.parametrize("case", XML)
def test_xml_of_servers_and_editors_is_read(tmp_path: Path, case: str, name: str) -> None:
    elements, expected = XML[case]
    text = (
        f'<?xml version="1.0"?><osm version="0.6" upload="never">{"".join(elements)}</osm>'.encode()
    )
    packers: dict[str, Callable[[bytes], bytes]] = {"gz": gzip.compress, "bz2": bz2.compress}
    packed = packers.get(name.rpartition(".")[2], bytes)(text)
    path = tmp_path / name
    path.write_bytes(packed)
    layer = read(path)
    assert middles(layer) == expected
    assert layer.errors == ()


POINT = {"type": "node", "id": 1, "lat": 48, "lon": 2, "tags": BENCH}
WAY = {"type": "way", "id": 2, "center": {"lat": 48.5, "lon": 2.5}, "tags": BENCH}
GONE = {"type": "node", "id": 1, "version": 2, "visible": False}
EXPECTED = {"node/1": (2, 48), "way/2": (2.5, 48.5)}
JSON: dict[str, Any] = {
    "a list": [POINT, WAY],
    "elements without a version": {"elements": [POINT, WAY]},
    "a list of answers": [{"elements": [POINT]}, {"elements": [WAY]}],
    "lists by kind": {
        "nodes": [{key: value for key, value in POINT.items() if key != "type"}],
        "ways": [WAY],
        "relations": [],
    },
    "identifiers as other values": [POINT | {"id": "node/1"}, WAY | {"id": 2.0}],
    "tags as a list": [POINT | {"tags": [{"k": "amenity", "v": "bench"}]}, WAY],
    "tags that are no texts": [POINT | {"tags": {**BENCH, "seats": 3, "colour": None}}, WAY],
    "no tags": [{"type": "node", "id": 9, "lat": 1, "lon": 1, "tags": None}, POINT, WAY],
    "positions as texts": [POINT | {"lat": "48", "lon": "2.0"}, WAY],
    "versions": [POINT | {"version": 1, "lat": 7}, POINT | {"version": 2}, WAY],
    "lists by kind, with centres": {
        "nodes": [{"id": 1, "lat": "48", "lon": "2", "tags": BENCH}],
        "ways": [{"id": 2, "center_lat": 48.5, "center_lon": 2.5, "tags": BENCH}],
    },
    "elements inside others": {"result": {"osm": {"elements": [POINT, WAY]}}},
    "elements by identifier": {"a": POINT, "b": WAY},
    "other names of coordinates": [
        {"type": "node", "id": 1, "latitude": 48, "longitude": 2, "tags": BENCH}, WAY
    ],
    "tags as keys": [
        {"type": "node", "id": 1, "lat": 48, "lon": 2, "user": "bench", "amenity": "bench"},
        {"type": "way", "id": 2, "center": WAY["center"], "tags.amenity": "bench"},
    ],
    "tags as text": [POINT | {"tags": json.dumps(BENCH)}, WAY],
    "deleted in an editor": [POINT, WAY, POINT | {"id": 4, "action": "delete"}],
    "not visible": [POINT, WAY, POINT | {"id": 3, "visible": False}],
    "deleted last": [{**POINT, "id": 3, "version": 1}, GONE | {"id": 3}, POINT, WAY],
}  # fmt: skip


@pytest.mark.parametrize("case", [*JSON, "lines", "records", "byte order mark"])
def test_json_of_elements_is_read(tmp_path: Path, case: str) -> None:
    texts = {
        "lines": f"{json.dumps(POINT)}\n{json.dumps(WAY)}\n",
        "records": f"\x1e{json.dumps(POINT)}\n\x1e{json.dumps(WAY)}\n",
        "byte order mark": f"\ufeff{json.dumps([POINT, WAY])}",
    }
    for suffix in ("json", "ndjson", "geojson"):
        path = tmp_path / f"dump.{suffix}"
        path.write_text(texts.get(case) or json.dumps(JSON[case]), encoding="utf-8")
        assert middles(read(path)) == EXPECTED


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.osc", "<osmChange/>", ["osmium apply-changes", "a.osc"]),
        ("a.osc.gz", "", ["osmium apply-changes"]),
        ("a.osm", f"<osmChange version='0.6'><create>{NODE}</create></osmChange>", ["changes"]),
        ("a.xml", f"<osmAugmentedDiff><action>{NODE}</action></osmAugmentedDiff>", ["changes"]),
        ("a.osm", f"<osm><action type='delete'><old>{NODE}</old></action></osm>", ["changes"]),
        ("a.json", '[{"type": "node", "id": 1, "tags": 5}]', ["save it as GeoJSON"]),
        ("a.osm", f"<osm>{NODE}<remark>runtime error: timed out.</remark></osm>", ["smaller area"]),
        ("a.osm", f"<osm><way id='1'>{CENTRE}", ["not whole XML"]),
        ("a.osm", f"<!DOCTYPE osm []><osm><way id='1'>{CENTRE}</way></osm>", ["document type"]),
    ],
)  # fmt: skip
def test_changes_and_incomplete_answers_are_refused(
    tmp_path: Path, name: str, text: str, words: list[str]
) -> None:
    path = tmp_path / name
    path.write_text(text)
    with refused(SourceError, *words):
        load(path)


@pytest.mark.parametrize("mark", ["\t", "|", ";", ","])
@pytest.mark.parametrize("kinds", [True, False])
def test_table_of_a_server_is_read(tmp_path: Path, mark: str, *, kinds: bool) -> None:
    rows = [
        ["@id", "@lat", "@lon", "amenity", "name"],
        ["1", "48", "2", "bench", ""],
        ["2", "48.5", "2.5", "bench", "Long"],
        ["3", "48.5", "2.5", "cafe", ""],
    ]
    if kinds:
        rows = [
            [kind, *row] for kind, row in zip(["@type", "node", "way", "node"], rows, strict=True)
        ]
    path = tmp_path / "answer.csv"
    path.write_text("".join(f"{mark.join(row)}\n" for row in rows))
    assert middles(read(path)) == {
        "node/1": (2, 48),
        f"{'way' if kinds else 'node'}/2": (2.5, 48.5),
    }


def test_editor_file_is_read_with_an_extract(tmp_path: Path) -> None:
    extract, edited = tmp_path / "town.osm", tmp_path / "edited.osm"
    extract.write_text(f"<osm version='0.6'>{NODE}{node(2, 2.001, 48, BENCH)}</osm>")
    new = node(-1, 2.002, 48, BENCH, action="modify")
    deleted = relation(9, {5: "outer"}, BENCH).replace("<relation", "<relation action='delete'")
    edited.write_text(f"<osm version='0.6'>{NODE}{new}{deleted}</osm>")
    objects = load([extract, edited], collapse=False).objects
    new, *others = sorted(objects.table["source_id"])
    assert others == ["node/1", "node/2"]
    assert new.startswith("node/-1")


@pytest.mark.parametrize("edits", [("", ""), ("", "deleted"), ("deleted", "deleted")])
def test_numbers_below_zero_are_those_of_a_file(tmp_path: Path, edits: tuple[str, str]) -> None:
    paths = []
    for number, edit in enumerate(edits):
        corners = [node(-n - 2, 2 + number + n / 1000, 48) for n in range(2)]
        new = [node(-1, 2.5 + number, 48, BENCH), *corners, way(-9, [-2, -3], BENCH)]
        removed = [node(99, 0, 0, action="delete")] if edit else []
        path = tmp_path / f"{number}.osm"
        path.write_text(f"<osm version='0.6'>{''.join((*new, *removed))}</osm>")
        paths.append(path)
    layers = reader("osm_file")(paths, [BENCHES])
    places = [place for layer in layers for place in middles(layer).values()]
    assert sorted(places) == [(2.0005, 48), (2.5, 48), (3.0005, 48), (3.5, 48)]
    names = [name for layer in layers for name in middles(layer)]
    assert len({*names}) == 4
