"""OpenStreetMap files that the tests write and damage."""

from __future__ import annotations

import bz2
import pickle
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import osmium
import pytest
import shapely
from osm_xml import node, relation, way, write_osm
from osmium.osm.mutable import Node
from sentences import assert_sentence, refused

from semsig_gis.core.errors import CatalogError, SourceError
from semsig_gis.sources import RowCounts
from semsig_gis.sources.layers import ClassBy, LayerSpec
from semsig_gis.sources.osm.file import read_layers

if TYPE_CHECKING:
    from semsig_gis.sources import RawLayer

TREE = {"natural": "tree"}
BENCH = {"amenity": "bench"}
HOUSE = {"building": "yes"}


def spec_of(**what: Any) -> LayerSpec:  # noqa: ANN401 - any field of a LayerSpec
    tags = ((("amenity", ("bench",)),),)
    return LayerSpec(**{"name": "benches", "class_name": "bench", "tags": tags, **what})


TREES = spec_of(name="trees", class_name="alignment_tree", tags=((("natural", ("tree",)),),))
BENCHES = spec_of()
BUILDINGS = spec_of(
    name="buildings",
    class_name="",
    role="buildings",
    geometry="polygon",
    tags=((("building", ("*",)),),),
)
STREETS = spec_of(
    name="streets",
    class_name="",
    role="streets",
    geometry="line",
    elements=("way",),
    tags=((("highway", ("residential", "pedestrian")),),),
)
CORNERS = [node(1, 0, 0), node(2, 1, 0), node(3, 1, 1), node(4, 0, 1)]


def found(layer: RawLayer) -> dict[str, str]:
    assert layer.counts.read == len(layer.table) + layer.counts.filtered + layer.counts.unreadable
    return dict(zip(layer.table.source_id, layer.table.geometry.to_wkt(), strict=True))


# --- What is read -----------------------------------------------------------------------------


def test_one_pass_reads_every_layer_in_the_order_asked(tmp_path: Path) -> None:
    path = write_osm(
        tmp_path / "city.osm",
        *CORNERS,
        node(5, 2.5, 48.5, TREE),
        node(6, 2.6, 48.6, BENCH),
        way(7, [1, 2], BENCH),
        way(8, [1, 2, 3, 4, 1], HOUSE),
        way(9, [1, 3], {"highway": "residential"}),
    )
    layers = read_layers(path, [STREETS, BENCHES, TREES, BUILDINGS])
    assert [layer.spec.name for layer in layers] == ["streets", "benches", "trees", "buildings"]
    streets, benches, trees, buildings = layers
    assert found(trees) == {"node/5": "POINT (2.5 48.5)"}
    assert found(benches) == {"node/6": "POINT (2.6 48.6)", "way/7": "POINT (0.5 0)"}
    assert found(buildings) == {"way/8": "POLYGON ((0 0, 1 0, 1 1, 0 1, 0 0))"}
    assert found(streets) == {"way/9": "LINESTRING (0 0, 1 1)"}
    assert benches.table.class_name.tolist() == ["bench", "bench"]
    assert buildings.table.class_name.tolist() == [""]
    assert all(layer.table.crs == "EPSG:4326" and layer.notes == () for layer in layers)


@pytest.mark.parametrize("suffix", [".osm", ".osm.pbf", ".osm.bz2", ".OSM", ".Osm.PBF"])
def test_every_format_reads_the_same(tmp_path: Path, suffix: str) -> None:
    plain = write_osm(
        tmp_path / "plain.osm", *CORNERS, way(7, [1, 2], BENCH), way(8, [1, 2, 3, 4, 1], HOUSE)
    )
    path = tmp_path / f"city{suffix}"
    if suffix.lower() == ".osm":
        plain.rename(path)
    elif suffix == ".osm.bz2":
        path.write_bytes(bz2.compress(plain.read_bytes()))
    else:
        written = tmp_path / "written.osm.pbf"
        with osmium.SimpleWriter(str(written)) as writer:
            for element in osmium.FileProcessor(str(plain)):
                writer.add(element)
        written.rename(path)
    benches, buildings = read_layers(str(path), [BENCHES, BUILDINGS])
    assert found(benches) == {"way/7": "POINT (0.5 0)"}
    assert found(buildings) == {"way/8": "POLYGON ((0 0, 1 0, 1 1, 0 1, 0 0))"}


def test_an_element_may_be_of_two_layers(tmp_path: Path) -> None:
    path = write_osm(tmp_path / "city.osm", node(1, 2, 48, {**TREE, **BENCH}))
    trees, benches = read_layers(path, [TREES, BENCHES])
    assert found(trees) == found(benches) == {"node/1": "POINT (2 48)"}


def test_elements_of_another_kind_are_filtered(tmp_path: Path) -> None:
    path = write_osm(
        tmp_path / "city.osm",
        *CORNERS,
        node(5, 2, 48, BENCH),
        way(6, [1, 2], BENCH),
        relation(7, {6: ""}, {"type": "site", **BENCH}),
    )
    points, anything = read_layers(path, [spec_of(elements=("node",)), BENCHES])
    assert (points.counts, list(found(points))) == (RowCounts(read=3, filtered=2), ["node/5"])
    assert anything.counts == RowCounts(read=3, filtered=1)
    assert list(found(anything)) == ["node/5", "way/6"]


def test_squares_are_no_streets(tmp_path: Path) -> None:
    path = write_osm(
        tmp_path / "city.osm",
        *CORNERS,
        way(5, [1, 2, 3, 1], {"highway": "pedestrian"}),
        way(6, [1, 2, 3, 1], {"highway": "pedestrian", "area": "yes"}),
    )
    (streets,) = read_layers(path, [STREETS])
    assert found(streets) == {"way/5": "LINESTRING (0 0, 1 0, 1 1, 0 0)"}
    assert streets.counts.filtered == 1


def test_multipolygons_with_untagged_members(tmp_path: Path) -> None:
    hole = [node(10 + n, *place) for n, place in enumerate([(0.2, 0.2), (0.4, 0.2), (0.2, 0.4)])]
    path = write_osm(
        tmp_path / "city.osm",
        *CORNERS,
        *hole,
        way(20, [1, 2, 3]),
        way(21, [1, 4, 3]),
        way(22, [10, 11, 12, 10]),
        relation(30, {20: "outer", 21: "", 22: "inner"}, {"type": "multipolygon", **HOUSE}),
        relation(31, {20: "outer", 21: "outer"}, {"type": "multipolygon", **BENCH}),
    )
    buildings, benches = read_layers(path, [BUILDINGS, BENCHES])
    assert buildings.table.source_id.tolist() == ["relation/30"]
    house = buildings.table.geometry[0]
    assert (house.area, len(house.interiors)) == (pytest.approx(1 - 0.02), 1)
    assert found(benches) == {"relation/31": "POINT (0.5 0.5)"}


def test_ways_before_nodes_out_of_order_and_with_negative_numbers(tmp_path: Path) -> None:
    path = write_osm(
        tmp_path / "city.osm",
        way(7, [9, 5], BENCH),
        way(8, [-1, 5], BENCH),
        way(-9, [-1, -2], BENCH),
        node(9, 0, 0),
        node(-2, 3, 3),
        node(5, 2, 0),
        node(-1, 2, 2),
    )
    (benches,) = read_layers(path, [BENCHES])
    assert found(benches) == {
        "way/7": "POINT (1 0)",
        "way/8": "POINT (2 1)",
        "way/-9": "POINT (2.5 2.5)",
    }


def test_deleted_elements_are_not_there(tmp_path: Path) -> None:
    gone = '<node id="2" visible="false" lat="1" lon="1"><tag k="natural" v="tree"/></node>'
    path = write_osm(tmp_path / "city.osm", node(1, 2, 48, TREE), gone)
    (trees,) = read_layers(path, [TREES])
    assert (trees.counts.read, list(found(trees))) == (1, ["node/1"])


def test_where_and_class_by_are_by_tag(tmp_path: Path) -> None:
    spec = spec_of(
        where=(("backrest", ("yes",)),),
        class_by=ClassBy("colour", (("red", "taxi_station"),)),
    )
    path = write_osm(
        tmp_path / "city.osm",
        node(1, 2, 48, {**BENCH, "backrest": "yes"}),
        node(2, 2, 48, {**BENCH, "backrest": "no"}),
        node(3, 2, 48, BENCH),
        node(4, 2, 48, {**BENCH, "backrest": "yes", "colour": "red"}),
    )
    (layer,) = read_layers(path, [spec])
    assert list(found(layer)) == ["node/1", "node/4"]
    assert layer.table.class_name.tolist() == ["bench", "taxi_station"]
    assert layer.counts.filtered == 2
    (everything,) = read_layers(path, [spec], filters=False)
    assert (len(everything.table), everything.counts.filtered) == (4, 0)


def test_no_layers_and_no_elements(tmp_path: Path) -> None:
    path = write_osm(tmp_path / "city.osm")
    assert read_layers(path, []) == ()
    (trees,) = read_layers(path, [TREES])
    assert (trees.counts.read, len(trees.table)) == (0, 0)
    assert trees.table.crs == "EPSG:4326"


def test_another_crs_is_only_noted(tmp_path: Path) -> None:
    path = write_osm(tmp_path / "city.osm", node(1, 2, 48, TREE))
    (trees,) = read_layers(path, [TREES], crs="EPSG:2154")
    assert found(trees) == {"node/1": "POINT (2 48)"}
    assert any("EPSG:2154" in note for note in trees.notes)


def test_no_user_metadata_is_kept(tmp_path: Path) -> None:
    who = 'user="Quasimodo" uid="987654321" changeset="876543210" version="77"'
    when = 'timestamp="2019-07-06T05:04:03Z"'
    path = write_osm(
        tmp_path / "city.osm",
        f'<node id="1" lat="0" lon="0" {who} {when}/>',
        f'<node id="2" lat="0" lon="1" {who} {when}><tag k="amenity" v="bench"/>'
        '<tag k="name" v="Esmeralda"/></node>',
        f'<way id="3" {who} {when}><nd ref="1"/><nd ref="2"/><tag k="amenity" v="bench"/></way>',
        f'<way id="4" {who} {when}><nd ref="1"/><nd ref="9"/><tag k="amenity" v="bench"/></way>',
    )
    (layer,) = read_layers(path, [BENCHES])
    assert layer.table.columns.tolist() == ["class_name", "source_id", "geometry"]
    assert (len(layer.table), layer.counts.unreadable) == (2, 1)
    kept = pickle.dumps(layer) + repr(layer).encode()
    for secret in (b"Quasimodo", b"Esmeralda", b"987654321", b"876543210", b"2019", b"05:04"):
        assert secret not in kept
    numbers = np.array([987654321, 876543210, 1562389443])
    assert all(number.tobytes() not in kept for number in numbers)


# --- What is wrong ----------------------------------------------------------------------------


def test_what_is_incomplete_or_broken_is_skipped_and_counted(tmp_path: Path) -> None:
    path = write_osm(
        tmp_path / "city.osm",
        *CORNERS,
        node(5, 200, 95, HOUSE),
        way(6, [1, 2, 98, 99, 1], HOUSE),
        way(7, [1, 2, 3], HOUSE),
        way(8, [1], HOUSE),
        way(9, [], HOUSE),
        way(10, [1, 2, 3, 4, 1], HOUSE),
        relation(11, {10: "outer", 77: "inner"}, {"type": "multipolygon", **HOUSE}),
        relation(12, {6: "outer"}, {"type": "multipolygon", **HOUSE}),
        relation(13, {7: "outer"}, {"type": "multipolygon", **HOUSE}),
        relation(14, {}, {"type": "multipolygon", **HOUSE}),
    )
    (buildings,) = read_layers(path, [BUILDINGS])
    assert list(found(buildings)) == ["way/10"]
    assert (buildings.counts.read, buildings.counts.unreadable) == (10, 9)
    assert buildings.errors == (
        "row 1: node/5 has no valid position",
        "row 2: way/6 lacks 2 of its 5 nodes, as where a file is clipped",
        "row 3: way/7 is not closed, as the outline of a building is",
        "row 4: way/8 has less than two nodes",
        "row 5: way/9 has less than two nodes",
        "row 7: relation/11 lacks 1 of its 2 ways, as where a file is clipped",
        "row 8: relation/12 lacks 2 of its 5 nodes, as where a file is clipped",
        "row 9: relation/13 has ways that do not join to rings",
        "row 10: relation/14 encloses no area",
    )


@pytest.fixture(scope="module")
def big(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """Return the bytes of a file of many nodes in every format."""
    folder = tmp_path_factory.mktemp("big")
    # Places that do not compress, so that blocks are long and the file is not cut between two.
    places = np.random.default_rng(0).uniform(0, 80, (20_000, 2)).round(7).tolist()
    nodes = (node(number, x, y, TREE) for number, (x, y) in enumerate(places, start=1))
    plain = write_osm(folder / "city.osm", *nodes)
    packed = folder / "city.osm.pbf"
    with osmium.SimpleWriter(str(packed)) as writer:
        for element in osmium.FileProcessor(str(plain)):
            writer.add(element)
    return {
        ".osm": plain.read_bytes(),
        ".osm.bz2": bz2.compress(plain.read_bytes()),
        ".osm.pbf": packed.read_bytes(),
    }


@pytest.mark.parametrize("suffix", [".osm", ".osm.bz2", ".osm.pbf"])
@pytest.mark.parametrize("part", [0.0, 0.001, 0.4, 0.9, 0.999])
def test_a_cut_file_is_refused(
    big: dict[str, bytes], tmp_path: Path, suffix: str, part: float
) -> None:
    path = tmp_path / f"cut{suffix}"
    path.write_bytes(big[suffix][: int(part * len(big[suffix]))])
    with refused(SourceError, str(path), "get it again"):
        read_layers(path, [TREES])


@pytest.mark.parametrize("suffix", [".osm", ".osm.bz2", ".osm.pbf"])
@pytest.mark.parametrize("other", [".osm", ".osm.bz2", ".osm.pbf", ".json", ".gpx"])
def test_a_file_of_another_kind_than_its_name_says_is_refused(
    big: dict[str, bytes], tmp_path: Path, suffix: str, other: str
) -> None:
    if suffix == other:
        return
    content = {**big, ".json": b'{"elements": []}', ".gpx": b"<gpx></gpx>"}[other]
    path = tmp_path / f"other{suffix}"
    path.write_bytes(content)
    with refused(SourceError, str(path), "get it again"):
        read_layers(path, [TREES])


def test_bad_coordinates_are_refused(tmp_path: Path) -> None:
    path = write_osm(tmp_path / "city.osm", '<node id="1" lat="north" lon="2"/>')
    with refused(SourceError, str(path), "north"):
        read_layers(path, [TREES])


def test_an_entity_bomb_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "bomb.osm"
    path.write_text('<!DOCTYPE osm [<!ENTITY a "aaaa">]><osm version="0.6">&a;</osm>')
    with refused(SourceError, str(path)):
        read_layers(path, [TREES])


@pytest.mark.parametrize("name", ["city.osm.gz", "city.geojson", "city.pbf", "osm", "-"])
def test_another_suffix_is_refused(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(b"anything")
    with refused(SourceError, str(path), ".osm, .osm.bz2, .osm.pbf"):
        read_layers(path, [TREES])


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="is a folder"):
        read_layers(tmp_path, [TREES])
    for nowhere in (tmp_path / "nowhere.osm", "http://localhost/city.osm", "-"):
        with pytest.raises(SourceError, match="does not exist") as caught:
            read_layers(nowhere, [TREES])
        assert_sentence(caught.value)


def test_a_name_is_never_an_address_or_standard_input(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "http:" / "localhost" / "city.osm"
    path.parent.mkdir(parents=True)
    write_osm(path, node(1, 2, 48, TREE))
    (trees,) = read_layers("http:/localhost/city.osm", [TREES])
    assert list(found(trees)) == ["node/1"]


@pytest.mark.parametrize(
    ("spec", "words"),
    [(spec_of(tags=()), "no tags"), (spec_of(id_field="ref"), "id_field = 'ref'")],
)
def test_a_specification_that_does_not_fit_is_refused(
    tmp_path: Path, spec: LayerSpec, words: str
) -> None:
    path = write_osm(tmp_path / "city.osm", node(1, 2, 48, BENCH))
    with refused(CatalogError, "'benches'", words):
        read_layers(path, [spec])


# --- Memory -----------------------------------------------------------------------------------

MEASURE = """
import sys
from pathlib import Path
from semsig_gis.sources.layers import LayerSpec
from semsig_gis.sources.osm.file import read_layers
tags = ((("natural", ("tree",)),),)
(layer,) = read_layers(sys.argv[1], [LayerSpec(name="t", class_name="bench", tags=tags)])
# Not getrusage, which includes the process that started this one.
lines = Path("/proc/self/status").read_text().splitlines()
(peak,) = (line.split()[1] for line in lines if line.startswith("VmHWM:"))
print(len(layer.table), int(peak) // 1024)
"""


def peak_megabytes(path: Path, nodes: int) -> int:
    """Return the peak memory of reading a file with 1,000 trees, one of them a way."""
    with osmium.SimpleWriter(str(path)) as writer:
        for number in range(1, nodes + 1):
            tags = TREE if number < 1000 else {}
            # Spread as far as in the real map, where numbers are beyond 12,000 million.
            spread = number * (12_500_000_000 // nodes)
            place = (number % 1000 / 100, number / nodes)
            writer.add_node(Node(id=spread, version=1, location=place, tags=tags))
        ends = [12_500_000_000 // nodes, 2 * (12_500_000_000 // nodes)]
        writer.add_way(osmium.osm.mutable.Way(id=1, version=1, nodes=ends, tags=TREE))
    result = subprocess.run(
        [sys.executable, "-c", MEASURE, str(path)],
        check=True,
        capture_output=True,
        text=True,
        cwd=Path(__file__).parents[2],
    )
    kept, peak = map(int, result.stdout.split())
    assert kept == 1000
    return peak


@pytest.mark.skipif(sys.platform != "linux", reason="asks Linux for the peak of its memory")
def test_memory_does_not_grow_with_the_file(tmp_path: Path) -> None:
    small = peak_megabytes(tmp_path / "small.osm.pbf", 5_000)
    large = peak_megabytes(tmp_path / "large.osm.pbf", 500_000)
    # Half a million nodes held as Python objects would be more than 100 MB; the temporary file
    # of their places is 8 MB, and counted as long as the system has it in memory.
    assert large - small < 20


def test_a_pbf_of_many_blocks_reads_whole(tmp_path: Path) -> None:
    path = tmp_path / "city.osm.pbf"
    with osmium.SimpleWriter(str(path)) as writer:
        for number in range(1, 50_001):
            tags = TREE if number % 100 == 0 else {"name": "x"}
            writer.add_node(Node(id=number, version=1, location=(number / 1000, 1), tags=tags))
    (trees,) = read_layers(path, [TREES])
    assert trees.table.source_id.tolist() == [f"node/{100 * n}" for n in range(1, 501)]
    xy = shapely.get_coordinates(trees.table.geometry.array)
    assert xy[:, 0] == pytest.approx(np.arange(1, 501) / 10)
