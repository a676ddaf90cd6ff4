"""OpenStreetMap elements, their geometry, and OpenStreetMap files."""

from __future__ import annotations

import itertools
import pickle
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import osmium
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from osm_xml import node, relation, way, write_osm
from osmium.osm.mutable import Node, Way
from sentences import refused

from semsig_gis.core import CatalogError, SourceError
from semsig_gis.sources import (
    LayerSpec,
    RowCounts,
    TagIndex,
    has_tags,
    read_layers,
    relation_shape,
    way_shape,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from numpy.typing import NDArray
    from shapely.geometry.base import BaseGeometry

    from semsig_gis.sources import RawLayer

    Read = Callable[..., Any]

TREE = {"natural": "tree"}
BENCH = {"amenity": "bench"}
HOUSE = {"building": "yes"}
STREET = {"highway": "residential"}


def tagged(key: str, *values: str) -> tuple[tuple[tuple[str, tuple[str, ...]], ...], ...]:
    return (((key, values),),)


BENCHES = LayerSpec(name="benches", class_name="bench", tags=tagged("amenity", "bench"))
POINTS = replace(BENCHES, elements=("node",))
TREES = replace(BENCHES, name="trees", class_name="alignment_tree", tags=tagged("natural", "tree"))
SHAPES = replace(BENCHES, class_name="", geometry="polygon")
BUILDINGS = replace(SHAPES, name="buildings", role="buildings", tags=tagged("building", "*"))
STREETS = replace(
    SHAPES,
    name="streets",
    role="streets",
    geometry="line",
    elements=("way",),
    tags=tagged("highway", "residential"),
)

KEYS = st.sampled_from("abc")
VALUES = st.sampled_from(["x", "y", "no", "*"])
ALTERNATIVES = st.dictionaries(
    KEYS, st.lists(VALUES, min_size=1, max_size=2).map(tuple), min_size=1, max_size=2
).map(lambda alternative: tuple(alternative.items()))
SPECS = st.lists(ALTERNATIVES, min_size=1, max_size=3).map(
    lambda tags: LayerSpec(name="things", class_name="bench", tags=tuple(tags))
)
TAGS = st.dictionaries(KEYS, st.sampled_from(["x", "y", "z", "no"]), max_size=3)


@pytest.mark.parametrize(
    ("tags", "expected"),
    [
        ({"natural": "tree"}, True),
        ({"natural": "tree", "name": "Old oak"}, True),
        ({"natural": "tree_row"}, False),
        ({"natural": "Tree"}, False),
        ({"natural": "tree;shrub"}, False),
        ({"denotation": "tree"}, False),
        ({"sign": "stop"}, True),
        ({"sign": "no"}, False),
        ({"building": "no"}, True),
        ({"public_transport": "platform", "bus": "yes"}, True),
        ({"public_transport": "platform", "bus": "designated"}, True),
        ({"public_transport": "platform", "bus": "no"}, False),
        ({"public_transport": "platform"}, False),
        ({"bus": "yes"}, False),
        ({}, False),
    ],
)
def test_values_are_compared_exactly(tags: dict[str, str], *, expected: bool) -> None:
    tree, sign, building = (("natural", ("tree",)),), (("sign", ("*",)),), (("building", ("no",)),)
    stop = (("public_transport", ("platform",)), ("bus", ("yes", "designated")))
    spec = LayerSpec(name="things", class_name="bench", tags=(tree, sign, stop, building))
    assert has_tags(tags, spec) is expected
    assert TagIndex([spec]).layers(tags) == (0,) * expected


@given(st.lists(SPECS, min_size=1, max_size=4), TAGS)
def test_tag_index_equals_linear_search(specs: list[LayerSpec], tags: dict[str, str]) -> None:
    index = TagIndex(specs)
    expected = tuple(number for number, spec in enumerate(specs) if has_tags(tags, spec))
    assert index.layers(tags) == expected
    if expected:
        assert set(index.keys) & set(tags)


def xy(*places: tuple[float, float]) -> NDArray[np.float64]:
    return np.array(places, dtype=float).reshape(-1, 2)


def square(size: float, x: float = 0.0, y: float = 0.0) -> NDArray[np.float64]:
    return xy((x, y), (x + size, y), (x + size, y + size), (x, y + size), (x, y))


@pytest.mark.parametrize(
    ("line", "kind"),
    [
        (xy((0, 0), (4, 0)), "LineString"),
        (xy((0, 0), (3, 0), (3, 3), (0, 3), (0, 0)), "Polygon"),
        (xy((0, 0), (2, 0), (4, 0), (0, 0)), "LineString"),
    ],
    ids=["open", "area", "closed without area"],
)
def test_way_of_an_object_is_a_line_or_an_area(line: NDArray[np.float64], kind: str) -> None:
    assert way_shape(line, "objects").geom_type == kind
    street = way_shape(line, "streets")  # a line even if closed
    assert isinstance(street, shapely.LineString)
    assert len(street.coords) == len(line)


BOW = xy((0, 0), (2, 2), (2, 0), (0, 2), (0, 0))


@pytest.mark.parametrize(
    ("shape", "kind", "area"),
    [
        (way_shape(square(2), "buildings"), "Polygon", 4),
        (way_shape(BOW, "buildings"), "MultiPolygon", 2),
        (
            relation_shape([square(10), square(2, 4, 4)], [square(6, 2, 2)]),
            "MultiPolygon",
            100 - 36 + 4,
        ),
        (relation_shape([square(2), square(2, 2)], []), "Polygon", 8),
        (relation_shape([square(4)], [square(2)]), "Polygon", 12),
    ],
    ids=["outline", "crossed", "island in a hole", "adjoining", "hole at the edge"],
)
def test_building_is_the_area_of_its_outlines(shape: BaseGeometry, kind: str, area: float) -> None:
    assert (shape.geom_type, shape.is_valid) == (kind, True)
    assert shape.area == pytest.approx(area)


@given(
    st.lists(st.integers(1, 11), min_size=0, max_size=5, unique=True),
    st.randoms(use_true_random=False),
)
def test_pieces_of_a_ring_join_in_any_order_and_direction(cuts: list[int], random: object) -> None:
    angles = np.linspace(0, 2 * np.pi, 13)
    ring = np.round(np.stack([np.cos(angles), np.sin(angles)], axis=1), 7)
    ring[-1] = ring[0]
    ends = [0, *sorted(cuts), 12]
    pieces = [ring[i : j + 1] for i, j in itertools.pairwise(ends)]
    pieces = [piece[::-1] if number % 2 else piece for number, piece in enumerate(pieces)]
    random.shuffle(pieces)  # type: ignore[attr-defined]
    shape = relation_shape(pieces, [])
    assert isinstance(shape, shapely.Polygon)
    assert shape.area == pytest.approx(shapely.Polygon(ring).area)


CORNERS = [node(1, 0, 0), node(2, 1, 0), node(3, 1, 1), node(4, 0, 1)]


def shapes_by_id(layer: RawLayer) -> dict[str, str]:
    assert layer.counts.kept == len(layer.table)
    return dict(zip(layer.table.source_id, layer.table.geometry.to_wkt(), strict=True))


@pytest.fixture
def read(tmp_path: Path) -> Read:
    """Write a file of elements, and read one layer of it or several."""

    def call(specs: LayerSpec | list[LayerSpec], *elements: str, **options: Any) -> Any:  # noqa: ANN401
        path = write_osm(tmp_path / "city.osm", *elements)
        layers = read_layers(path, specs if isinstance(specs, list) else [specs], **options)
        return layers if isinstance(specs, list) else layers[0]

    return call


def write_pbf(path: Path, elements: Iterable[Any]) -> Path:
    with osmium.SimpleWriter(str(path)) as writer:
        for element in elements:
            writer.add(element)
    return path


def test_layers_are_read_in_the_requested_order(read: Read) -> None:
    layers = read(
        [STREETS, BENCHES, TREES, BUILDINGS],
        *CORNERS,
        node(5, 2.5, 48.5, TREE),
        node(6, 2.6, 48.6, BENCH),
        node(10, 2, 48, {**TREE, **BENCH}),
        way(7, [1, 2], BENCH),
        way(8, [1, 2, 3, 4, 1], HOUSE),
        way(9, [1, 3], STREET),
    )
    assert [layer.spec.name for layer in layers] == ["streets", "benches", "trees", "buildings"]
    streets, benches, trees, buildings = layers
    both = {"node/10": "POINT (2 48)"}
    assert shapes_by_id(trees) == {"node/5": "POINT (2.5 48.5)"} | both
    assert (
        shapes_by_id(benches)
        == {"node/6": "POINT (2.6 48.6)", "way/7": "LINESTRING (0 0, 1 0)"} | both
    )
    assert shapes_by_id(buildings) == {"way/8": "POLYGON ((0 0, 1 0, 1 1, 0 1, 0 0))"}
    assert shapes_by_id(streets) == {"way/9": "LINESTRING (0 0, 1 1)"}
    assert benches.table.class_name.tolist() == ["bench"] * 3
    assert buildings.table.class_name.tolist() == [""]
    assert all(layer.table.crs == "EPSG:4326" and layer.notes == () for layer in layers)


# Elements in two extracts and the expected result, in either order.
OVERLAPS: dict[str, tuple[list[str], list[str], dict[str, str]]] = {
    "the same node": ([node(1, 1, 2, BENCH)], [node(1, 1, 2, BENCH)], {"node/1": "POINT (1 2)"}),
    "a node and a way of one number": (
        [node(5, 1, 2, BENCH)],
        [*CORNERS[:2], way(5, [1, 2], BENCH)],
        {"node/5": "POINT (1 2)", "way/5": "POINT (0.5 0)"},
    ),
    "a node that was moved": (
        [node(1, 1, 2, BENCH, version=2)],
        [node(1, 5, 6, BENCH, version=3)],
        {"node/1": "POINT (5 6)"},
    ),
    "a node that is a bench no more": (
        [node(1, 1, 2, BENCH, version=2), node(2, 1, 2, BENCH, version=9)],
        [node(1, 1, 2, TREE, version=3), node(2, 1, 2, version=10)],
        {},
    ),
    "a node that was deleted": (
        [node(1, 1, 2, BENCH, version=2)],
        ['<node id="1" version="3" visible="false"/>'],
        {},
    ),
    "a way with a moved node": (
        [node(1, 0, 0, version=1), node(2, 1, 0), way(7, [1, 2], BENCH, version=1)],
        [node(1, 0, 4, version=2), node(2, 1, 0), way(7, [1, 2], BENCH, version=1)],
        {"way/7": "POINT (0.5 2)"},
    ),
    "a way that lacks nodes in one": (
        [CORNERS[0], way(7, [1, 2], BENCH, version=1)],
        [*CORNERS[:2], way(7, [1, 2], BENCH, version=1)],
        {"way/7": "POINT (0.5 0)"},
    ),
    "a way that lacks a node in each": (
        [*CORNERS[:2], way(7, [1, 2, 3], BENCH)],
        [*CORNERS[1:3], way(7, [1, 2, 3], BENCH)],
        {"way/7": "POINT (0.75 0.25)"},
    ),
    "a way that was cut short in one": (
        [*CORNERS[:2], way(7, [1, 2], BENCH, version=1)],
        [*CORNERS[:3], way(7, [1, 2, 3], BENCH, version=1)],
        {"way/7": "POINT (0.75 0.25)"},
    ),
    "a multipolygon that lacks a way in one": (
        [*CORNERS, way(7, [1, 2, 3]), relation(9, {7: "outer"}, {"type": "multipolygon", **BENCH})],
        [
            *CORNERS,
            way(7, [1, 2, 3]),
            way(8, [3, 4, 1]),
            relation(9, {7: "outer", 8: "outer"}, {"type": "multipolygon", **BENCH}),
        ],
        {"relation/9": "POINT (0.5 0.5)"},
    ),
}


@pytest.mark.parametrize("case", OVERLAPS)
def test_element_in_several_extracts_counts_once(tmp_path: Path, case: str) -> None:
    *extracts, expected = OVERLAPS[case]
    paths = [write_osm(tmp_path / f"{n}.osm", *some) for n, some in enumerate(extracts)]
    for order in (paths, paths[::-1]):
        (layer,) = read_layers(order, [BENCHES])
        middles = shapely.centroid(layer.table.geometry.array)
        assert dict(zip(shapes_by_id(layer), shapely.to_wkt(middles), strict=True)) == expected
        assert not layer.errors


@pytest.mark.parametrize("suffix", ["osm", "osh", "osh.pbf"])
@pytest.mark.parametrize("case", OVERLAPS)
def test_newest_version_in_a_history_counts(tmp_path: Path, case: str, suffix: str) -> None:
    *extracts, expected = OVERLAPS[case]
    elements = sorted(
        itertools.chain(*extracts),
        key=lambda text: ("nwr".index(text[1]), int(text.split('"')[1]), len(text)),
    )
    path = write_osm(tmp_path / "xml", *elements)
    xml, path = path, tmp_path / f"history.{suffix}"
    if suffix == "osh.pbf":
        with osmium.SimpleWriter(str(path)) as writer:
            for element in osmium.FileProcessor(osmium.io.File(str(xml), "xml")):
                writer.add(element)
    else:
        xml.rename(path)
    (layer,) = read_layers(path, [BENCHES])
    middles = shapely.centroid(layer.table.geometry.array)
    assert dict(zip(shapes_by_id(layer), shapely.to_wkt(middles), strict=True)) == expected
    assert not layer.errors


def test_merging_extracts_keeps_tags(tmp_path: Path) -> None:
    strange = {"name": 'Bänke, "alt" = 100 % @\n木 \U0001f333', "amenity": "bench", "a:b": " x "}
    path = write_osm(tmp_path / "a.osm", node(-5, -1.2345678, 2.0000001, strange))
    other = write_osm(tmp_path / "b.osm", node(2, 0, 0, BENCH))
    spec = replace(BENCHES, where=tuple((key, (value,)) for key, value in strange.items()))
    single, merged = (read_layers(some, [spec])[0] for some in (path, [path, other]))
    assert single.table.source_id.tolist() == merged.table.source_id.tolist() == ["node/-5"]
    assert single.table.geometry.equals(merged.table.geometry)


def test_extracts_of_different_days_are_noted_and_a_damaged_one_is_named(tmp_path: Path) -> None:
    paths = [tmp_path / name for name in ("old.osm.pbf", "new.pbf")]
    for path, year in zip(paths, (2021, 2022), strict=True):
        header = osmium.io.Header()
        header.set("osmosis_replication_timestamp", f"{year}-04-21T20:21:46Z")
        with osmium.SimpleWriter(str(path), header=header) as writer:
            writer.add_node(Node(id=year, location=(1, 2), tags=BENCH))
    (layer,) = read_layers(paths, [BENCHES])
    assert layer.counts.kept == 2
    assert "from 2021-04-21 to 2022-04-21" in layer.notes[0]
    paths[1].write_bytes(b"no elements")
    with refused(SourceError, str(paths[1]), "damaged"):
        read_layers(paths, [BENCHES])


BOUNDS = '<bounds minlat="{1}" minlon="{0}" maxlat="{3}" maxlon="{2}"/>'


@pytest.mark.parametrize(
    ("boxes", "extent"),
    [
        ([(1, 2, 3, 4)], shapely.box(1, 2, 3, 4)),
        ([(1, 2, 3, 4), (3, 2, 5, 4)], shapely.box(1, 2, 5, 4)),
        ([(1, 2, 3, 4), None], None),
        ([(1, 2, 1, 2)], None),
        ([(-180, -90, 180, 90)], None),
        ([(179, 2, -179, 4)], shapely.box(179, 2, 180, 4) | shapely.box(-180, 2, -179, 4)),
    ],
    ids=["one", "two extracts", "one of two", "empty", "all", "across the 180th meridian"],
)
def test_extent_is_the_box_in_the_headers(
    tmp_path: Path, boxes: list[tuple[int, ...] | None], extent: shapely.Geometry | None
) -> None:
    paths = [
        write_osm(
            tmp_path / f"{n}.osm", BOUNDS.format(*box) if box else "", node(n + 1, 1, 2, BENCH)
        )
        for n, box in enumerate(boxes)
    ]
    (layer,) = read_layers(paths, [BENCHES])
    assert (layer.extent is None) == (extent is None)
    assert extent is None or layer.extent.polygon.equals(extent)  # type: ignore[union-attr]


def test_elements_of_another_kind_are_filtered(read: Read) -> None:
    relations = [
        relation(7 + n, {6: ""}, {**kind, **BENCH})
        for n, kind in enumerate([{}, {"type": "site"}, {"type": "building"}, {"type": "boundary"}])
    ]
    points, anything, streets = read(
        [POINTS, BENCHES, STREETS],
        *CORNERS,
        node(5, 2, 48, BENCH),
        way(6, [1, 2, 3, 1], {"area": "yes", **BENCH}),
        way(11, [1, 2, 3, 1], STREET),
        way(12, [1, 2, 3, 1], {"area": "no", **STREET}),
        way(13, [1, 2, 3, 1], {"area": "yes", **STREET}),
        *relations,
    )
    assert (points.counts, list(shapes_by_id(points))) == (
        RowCounts(read=6, filtered=5),
        ["node/5"],
    )
    assert anything.counts == RowCounts(read=6, filtered=4)
    assert list(shapes_by_id(anything)) == ["node/5", "way/6"]
    assert list(shapes_by_id(streets)) == ["way/11", "way/12"]


def test_multipolygons_with_untagged_members(read: Read) -> None:
    hole = [node(10 + n, *place) for n, place in enumerate([(0.2, 0.2), (0.4, 0.2), (0.2, 0.4)])]
    buildings, benches = read(
        [BUILDINGS, BENCHES],
        *CORNERS,
        *hole,
        way(20, [1, 2, 3]),
        way(21, [1, 4, 3]),
        way(22, [10, 11, 12, 10]),
        relation(30, {20: "outer", 21: "", 22: "inner"}, {"type": "multipolygon", **HOUSE}),
        relation(31, {20: "outer", 21: "outer"}, {"type": "multipolygon", **BENCH}),
    )
    assert buildings.table.source_id.tolist() == ["relation/30"]
    house = buildings.table.geometry[0]
    assert (house.area, len(house.interiors)) == (pytest.approx(1 - 0.02), 1)
    assert list(shapes_by_id(benches)) == ["relation/31"]
    assert benches.table.geometry[0].equals(shapely.box(0, 0, 1, 1))


def test_ways_before_nodes_out_of_order_and_with_negative_numbers(read: Read) -> None:
    ways = [way(7, [9, 5], BENCH), way(8, [-1, 5], BENCH), way(-9, [-1, -2], BENCH)]
    benches = read(BENCHES, *ways, node(9, 0, 0), node(-2, 3, 3), node(5, 2, 0), node(-1, 2, 2))
    assert shapes_by_id(benches) == {
        "way/7": "LINESTRING (0 0, 2 0)",
        "way/8": "LINESTRING (2 2, 2 0)",
        "way/-9": "LINESTRING (2 2, 3 3)",
    }


def test_deleted_elements_are_omitted(read: Read) -> None:
    deleted_tree = '<node id="2" visible="false" lat="1" lon="1"><tag k="natural" v="tree"/></node>'
    trees = read(TREES, node(1, 2, 48, TREE), deleted_tree)
    assert (trees.counts.read, list(shapes_by_id(trees))) == (1, ["node/1"])


def test_other_crs_of_an_empty_layer_is_noted(read: Read) -> None:
    trees = read(TREES, crs="EPSG:2154")
    assert (trees.counts.read, len(trees.table), trees.table.crs) == (0, 0, "EPSG:4326")
    assert any("EPSG:2154" in note for note in trees.notes)


def test_user_metadata_is_dropped() -> None:
    (layer,) = read_layers(Path(__file__).with_name("data") / "mappers.osm", [BENCHES])
    assert layer.table.columns.tolist() == ["class_name", "source_id", "geometry"]
    assert (len(layer.table), layer.counts.unreadable) == (2, 1)
    content = pickle.dumps(layer) + repr(layer).encode()
    for secret in (b"Quasimodo", b"Esmeralda", b"987654321", b"876543210", b"2019", b"05:04"):
        assert secret not in content
    numbers = np.array([987654321, 876543210, 1562389443])
    assert all(number.tobytes() not in content for number in numbers)


AREA = {"type": "multipolygon", **HOUSE}
UNTAGGED = [
    node(5, 2, 0),
    way(6, [1, 2, 3, 4, 1]),
    way(7, [1, 2, 9]),
    way(8, [1, 2, 3]),
    way(9, [1]),
]


@pytest.mark.parametrize(
    ("element", "message"),
    [
        (node(10, 200, 95, HOUSE), "node/10 has no valid position"),
        (way(10, [1, 8, 9, 1], HOUSE), "way/10 lacks 2 of its 4 nodes, as where a file is clipped"),
        (way(10, [1, 2, 3], HOUSE), "way/10 is not closed, as the outline of a building is"),
        (way(10, [1, 2, 1], HOUSE), "way/10 is not closed, as the outline of a building is"),
        (way(10, [1, 2, 5, 1], HOUSE), "way/10 encloses no area"),
        (way(10, [1], HOUSE), "way/10 has less than two nodes"),
        (way(10, [], HOUSE), "way/10 has less than two nodes"),
        (relation(1, {6: "", 77: ""}, AREA), "relation/1 lacks 1 of its 2 ways, as where a file"),
        (relation(1, {6: "", 7: "inner"}, AREA), "relation/1 lacks 1 of its 8 nodes, as where a"),
        (relation(1, {8: "outer"}, AREA), "relation/1 has ways that do not join to rings"),
        (relation(1, {6: "", 8: ""}, AREA), "relation/1 has ways that do not join to rings"),
        (relation(1, {}, AREA), "relation/1 encloses no area"),
        (relation(1, {9: "outer"}, AREA), "relation/1 encloses no area"),
    ],
)
def test_incomplete_or_invalid_element_is_counted(read: Read, element: str, message: str) -> None:
    house = way(20, [1, 2, 3, 4, 1], HOUSE)
    buildings = read(BUILDINGS, *CORNERS, *UNTAGGED, house, element)
    assert list(shapes_by_id(buildings)) == ["way/20"]
    assert buildings.counts == RowCounts(read=2, unreadable=1)
    assert buildings.errors[0].partition(": ")[2].startswith(message)


@pytest.mark.parametrize("name", ["city.osm.xz", "city.geojson", "city.gz", "osm", "-"])
def test_unknown_suffix_is_refused(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(b"anything")
    with refused(SourceError, str(path), ".osm, .osm.gz, .osm.bz2, .pbf"):
        read_layers(path, [TREES])


def test_path_is_never_an_address_or_standard_input(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "http:" / "localhost" / "city.osm"
    path.parent.mkdir(parents=True)
    write_osm(path, node(1, 2, 48, TREE))
    (trees,) = read_layers("http:/localhost/city.osm", [TREES])
    assert list(shapes_by_id(trees)) == ["node/1"]
    for name in ("http://localhost/town.osm", "-"):
        with refused(SourceError, "does not exist"):
            read_layers(name, [TREES])


@pytest.mark.parametrize(
    ("change", "words"), [({"tags": ()}, "no tags"), ({"id_field": "ref"}, "id_field = 'ref'")]
)
def test_layer_without_tags_or_with_id_field_is_refused(
    read: Read, change: dict[str, Any], words: str
) -> None:
    with refused(CatalogError, "'benches'", words):
        read(replace(BENCHES, **change), node(1, 2, 48, BENCH))


MEASURE = """
import sys
from pathlib import Path
from semsig_gis.sources.layer_spec import LayerSpec
from semsig_gis.sources.osm.file import read_layers
tags = ((("natural", ("tree",)),),)
(layer,) = read_layers(sys.argv[1], [LayerSpec(name="t", class_name="bench", tags=tags)])
# Not getrusage, which includes the process that started this one.
lines = Path("/proc/self/status").read_text().splitlines()
(peak,) = (line.split()[1] for line in lines if line.startswith("VmHWM:"))
print(len(layer.table), int(peak) // 1024)
"""


def peak_megabytes(path: Path, nodes: int) -> int:
    """Return the peak memory of reading a file with 1,001 trees, one of them a way."""
    step = 12_500_000_000 // nodes  # as far as in the real map, where numbers are beyond that
    trees = (
        Node(
            id=number * step,
            version=1,
            location=(number % 1000 / 100, number / nodes),
            tags=TREE if number % (nodes // 1000) == 0 else {},
        )
        for number in range(1, nodes + 1)
    )
    tree = Way(id=1, version=1, nodes=[step, 2 * step], tags=TREE)
    write_pbf(path, itertools.chain(trees, [tree]))
    command = [sys.executable, "-c", MEASURE, str(path)]
    root = Path(__file__).parents[2]
    result = subprocess.run(command, check=True, capture_output=True, text=True, cwd=root)
    rows, peak = map(int, result.stdout.split())
    assert rows == 1001
    return peak


@pytest.mark.skipif(sys.platform != "linux", reason="asks Linux for the peak of its memory")
def test_memory_does_not_grow_with_the_file(tmp_path: Path) -> None:
    small = peak_megabytes(tmp_path / "small.osm.pbf", 5_000)
    large = peak_megabytes(tmp_path / "large.osm.pbf", 250_000)
    # A quarter of a million nodes held as Python objects would be more than 50 MB; the temporary
    # file of their places is 4 MB, and counted as long as the system has it in memory.
    assert large - small < 10
