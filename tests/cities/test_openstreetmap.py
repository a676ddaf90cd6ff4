"""The catalogue of OpenStreetMap: its tags, and real extracts compared with plain loops."""

from __future__ import annotations

import functools
import tomllib
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

import osmium
import pandas as pd
import pytest
import shapely
from osm_xml import node, relation, way, write_osm
from osmium.osm import WAY, Area, Node, Relation, Way

from semsig_gis.core import HEIGHT, TEXTS
from semsig_gis.database import build_database
from semsig_gis.evaluation import evaluate
from semsig_gis.objects import build_objects, choose_layers, read_surroundings
from semsig_gis.sources import find_files, load_catalog, read_layers

if TYPE_CHECKING:
    from collections.abc import Mapping

    from semsig_gis.sources import RawLayer

CATALOG = load_catalog("openstreetmap")
EXTRACTS = {
    "helsinki": "helsinki_2019.osm.pbf",
    "monaco": "monaco_2021.osm.pbf",
    "neukölln": "neukolln_2024.osm",
}

# --- Tags -------------------------------------------------------------------------------------

TABLE = tomllib.loads(Path(__file__).with_name("openstreetmap.toml").read_text(encoding="utf-8"))
# Layers of street furniture, buildings and streets; the others are in test_vocabulary.py.
LAYERS = TABLE["paper"] | TABLE["further"]
SPECS = [spec for spec in CATALOG.layers if spec.name in LAYERS]
# Corners of the ways and areas in the tests.
PLACES = [node(1, 0.0, 0.0), node(2, 0.001, 0.0), node(3, 0.001, 0.001)]


def tags_of(text: str) -> dict[str, str]:
    return dict(tag.split("=", 1) for tag in text.split(" "))


@pytest.fixture(scope="module")
def layers_by_tags(
    tmp_path_factory: pytest.TempPathFactory,
) -> Mapping[str, Mapping[str, set[str]]]:
    """Return, by tags, the layers that select them, with the kinds of elements."""
    tagged = [*(text for _, _, texts in LAYERS.values() for text in texts), *TABLE["near_misses"]]
    elements = [*PLACES]
    for number, tags in enumerate(map(tags_of, tagged), 10):
        elements += [
            node(number, 0.002, 0.002, tags),
            way(number, [1, 2, 3, 1], tags),
            relation(number, {number: "outer"}, {**tags, "type": "multipolygon"}),
        ]
    path = write_osm(tmp_path_factory.mktemp("tags") / "city.osm", *elements)
    layers: dict[str, dict[str, set[str]]] = {text: {} for text in tagged}
    for layer in read_layers(path, SPECS):
        assert layer.counts.unreadable == 0
        for kind, number in layer.table.source_id.str.split("/"):
            layers[tagged[int(number) - 10]].setdefault(layer.spec.name, set()).add(kind)
    return layers


def test_the_table_has_every_layer_and_tag_of_the_catalogue() -> None:
    class_names = {name for spec in CATALOG.layers for name in spec.classes}
    assert class_names == {item.name for item in CATALOG.taxonomy.classes}
    assert all(address.startswith("https://") for address in CATALOG.endpoints)
    assert {spec.name: (spec.class_name or spec.role) for spec in SPECS} == {
        name: meaning for name, (meaning, *_) in LAYERS.items()
    }
    for spec in SPECS:
        _, kinds, texts = LAYERS[spec.name]
        assert spec.optional == (spec.name in TABLE["optional"])
        assert spec.elements == tuple(kinds.split(" "))
        listed = {
            (key, value)
            for tags in spec.tags
            for key, values in tags
            for value in values
            if value != "*"
        }
        tested = {tag for text in texts for tag in tags_of(text).items()}
        assert listed <= tested, spec.name


@pytest.mark.parametrize(
    ("name", "text"),
    [(name, text) for name, (_, _, texts) in LAYERS.items() for text in texts],
)
def test_every_tag_belongs_to_one_layer(
    layers_by_tags: Mapping[str, Mapping[str, set[str]]], name: str, text: str
) -> None:
    assert layers_by_tags[text] == {name: set(LAYERS[name][1].split(" "))}


@pytest.mark.parametrize("text", TABLE["near_misses"])
def test_near_misses_belong_to_no_layer(
    layers_by_tags: Mapping[str, Mapping[str, set[str]]], text: str
) -> None:
    assert layers_by_tags[text] == {}


def test_a_bus_stop_is_one_point(tmp_path: Path) -> None:
    """A stop on a way is filtered and counted; a stop that is also a platform is read once."""
    tags = {"highway": "bus_stop", "public_transport": "platform", "bus": "yes"}
    path = write_osm(
        tmp_path / "city.osm",
        *PLACES,
        *(node(4, 2.0, 48.0, tags), way(5, [1, 2], {"highway": "bus_stop"})),
    )
    stops, platforms = read_layers(
        path, [CATALOG.layer(name) for name in ("bus_stops", "bus_platforms")]
    )
    assert (stops.counts.read, stops.counts.filtered, len(stops.table)) == (2, 1, 1)
    assert len(platforms.table) == 0


# --- Real extracts ----------------------------------------------------------------------------

# A tag of each layer; a key without a value matches any value.
BARE_TAGS = {
    "trees": "natural=tree",
    "drinking_water": "amenity=drinking_water",
    "fountains": "amenity=fountain",
    "street_lights": "highway=street_lamp",
    "signs": "traffic_sign information=guidepost",
    "information_boards": "information=board",
    "traffic_lights": "highway=traffic_signals",
    "bike_stations": "amenity=bicycle_rental",
    "toilets": "amenity=toilets",
    "car_sharing": "amenity=car_sharing",
    "taxi_ranks": "amenity=taxi",
    "benches": "amenity=bench",
    "bus_stops": "highway=bus_stop",
    "buildings": "building",
}


def bare_loop(path: Path) -> tuple[Counter[str], Counter[str]]:
    """Count elements by layer and kind, and ways with missing nodes."""
    kinds = {"n": "node", "w": "way", "r": "relation"}
    counts: Counter[str] = Counter()
    clipped: Counter[str] = Counter()
    for element in osmium.FileProcessor(str(path)).with_locations():
        assert isinstance(element, Node | Way | Relation)
        tags = {text for tag in element.tags for text in (tag.k, f"{tag.k}={tag.v}")}
        for name, texts in BARE_TAGS.items():
            if not tags.isdisjoint(texts.split(" ")):
                key = f"{name} {kinds[element.type_str()]}"
                counts[key] += 1
                if isinstance(element, Way) and not all(n.location.valid() for n in element.nodes):
                    clipped[key] += 1
    return counts, clipped


@functools.cache
def read_extract(geodata: Path, city: str, *, filters: bool = True) -> Mapping[str, RawLayer]:
    path = geodata / "osm" / EXTRACTS[city]
    specs = [spec for spec in CATALOG.layers if spec.derive is None]
    layers = read_layers(path, specs, filters=filters)
    return {layer.spec.name: layer for layer in layers}


def by_kind(layers: Mapping[str, RawLayer]) -> Counter[str]:
    counts: Counter[str] = Counter()
    for name, layer in layers.items():
        assert layer.counts.kept == len(layer.table)
        counts.update(name + " " + layer.table.source_id.str.split("/").str[0])
    return counts


@pytest.mark.parametrize("city", EXTRACTS)
def test_objects_of_the_classes_of_the_paper(geodata: Path, city: str) -> None:
    read = read_extract(geodata, city)
    layers = {spec.name: read[spec.name] for spec in choose_layers(CATALOG, selection="paper")}
    assert list(layers) == list(TABLE["paper"])
    assert all(layer.counts.unreadable == 0 for layer in layers.values())
    expected = TABLE["cities"][city]
    assert len(layers.pop("bus_platforms").table) == expected["platforms"]
    counts = (item.rsplit(" ", 1) for item in expected["objects"].replace("\n", " ").split(", "))
    assert by_kind(layers) == {kind: int(count) for kind, count in counts}


@pytest.mark.parametrize("city", EXTRACTS)
def test_objects_not_visible_from_the_street_are_excluded(geodata: Path, city: str) -> None:
    read = read_extract(geodata, city)
    layers = {name: layer for name, layer in read.items() if name in LAYERS}
    excluded = {
        name: note.removeprefix("left out by the catalogue's not: ")
        for name, layer in layers.items()
        for note in layer.notes
        if note.startswith("left out by the catalogue's not: ")
    }
    assert excluded == TABLE["cities"][city]["excluded"]
    assert {name for name, layer in layers.items() if layer.counts.excluded} == set(excluded)


@pytest.mark.parametrize("city", EXTRACTS)
def test_counts_equal_a_plain_loop(geodata: Path, city: str) -> None:
    layers = read_extract(geodata, city, filters=False)
    counts = by_kind(layers)
    expected, clipped = bare_loop(geodata / "osm" / EXTRACTS[city])
    assert expected["buildings way"] == TABLE["cities"][city]["buildings"][0]
    for name in BARE_TAGS:
        spec = layers[name].spec
        assert layers[name].counts.read == sum(
            expected[f"{name} {kind}"] for kind in ("node", "way", "relation")
        )
        for kind in ("node", "way"):
            complete = expected[f"{name} {kind}"] - clipped[f"{name} {kind}"]
            assert counts[f"{name} {kind}"] == (complete if kind in spec.elements else 0), (
                name,
                kind,
            )


@pytest.mark.parametrize("city", EXTRACTS)
def test_buildings_and_streets(geodata: Path, city: str) -> None:
    layers = read_extract(geodata, city)
    buildings, streets = layers["buildings"], layers["streets"]
    whole, clipped = TABLE["cities"][city]["buildings"]
    assert by_kind(layers)["buildings way"] == whole - clipped
    assert buildings.table.geometry.geom_type.isin(["Polygon", "MultiPolygon"]).all()
    assert buildings.table.geometry.is_valid.all()
    assert (streets.table.geometry.geom_type == "LineString").all()
    assert len(streets.table) > 30
    # Buildings are small, and nearly none of them overlap.
    metric = buildings.table.to_crs(buildings.table.estimate_utm_crs()).geometry
    assert 20 < metric.area.median() < 2000
    assert shapely.union_all(metric.array).area > 0.9 * metric.area.sum()


def test_street_widths_follow_the_highway_tag(geodata: Path) -> None:
    """Widths equal the widths in the catalogue for the tag, read by a plain loop."""
    path = geodata / "osm" / EXTRACTS["helsinki"]
    table = read_extract(geodata, "helsinki")["streets"].table
    highways = {
        f"way/{element.id}": element.tags["highway"]
        for element in osmium.FileProcessor(str(path), WAY)
        if "highway" in element.tags
    }
    by = CATALOG.layer("streets").width_by
    assert by is not None
    half = {value: width / 2 for value, width in by.widths}
    assert table["half_width"].tolist() == [half[highways[name]] for name in table["source_id"]]
    assert half["primary"] > half["residential"] > half["living_street"]
    # As read by `semsig build --streets FILE.osm.pbf`.
    streets = read_surroundings(path, role="streets", crs="EPSG:32635")
    assert streets["half_width"].tolist() == table["half_width"].tolist()


def test_areas_equal_pyosmium(geodata: Path) -> None:
    """The areas of multipolygons equal those assembled by libosmium."""
    path = geodata / "osm" / EXTRACTS["monaco"]
    factory = osmium.geom.WKBFactory()
    expected = {
        f"relation/{area.orig_id()}": shapely.from_wkb(factory.create_multipolygon(area))
        for area in osmium.FileProcessor(str(path)).with_areas()
        if isinstance(area, Area) and not area.from_way() and "building" in area.tags
    }
    table = read_extract(geodata, "monaco")["buildings"].table
    ours = dict(zip(table.source_id, table.geometry, strict=True))
    assert len(expected) == 24
    for name, shape in expected.items():
        assert ours[name].symmetric_difference(shape).area < 1e-9 * shape.area, name


@pytest.mark.parametrize(
    ("file", "counts"),
    [
        ("monaco_2022.osm.pbf", {"trees": 524, "bus_stops": 125}),
        (
            "paris_marais_routing.osm.pbf",
            {"traffic_lights": 146, "bus_stops": 88, "bike_stations": 46},
        ),
    ],
)
def test_other_extracts(geodata: Path, file: str, counts: dict[str, int]) -> None:
    layers = read_layers(geodata / "osm" / file, [CATALOG.layer(name) for name in counts])
    assert {layer.spec.name: len(layer.table) for layer in layers} == counts


def test_no_tags_and_no_users_are_kept(geodata: Path) -> None:
    for layer in read_extract(geodata, "neukölln").values():
        # Texts, heights and widths are all that is read of the tags.
        columns = {"class_name", "source_id", "half_width", HEIGHT, *TEXTS, "geometry"}
        assert columns.issuperset(layer.table.columns)
        assert layer.table.source_id.str.fullmatch(r"(node|way|relation)/\d+").all()


@pytest.mark.parametrize(
    ("city", "crs", "extent"),
    [
        ("helsinki", "EPSG:32635", 1650),
        ("monaco", "EPSG:32632", 4000),
        ("neukölln", "EPSG:32633", 1000),
    ],
)
def test_a_database_is_built_and_evaluated(
    geodata: Path, city: str, crs: str, extent: float
) -> None:
    # Of Helsinki only street furniture, because all classes take half a minute.
    names = () if city != "helsinki" else [spec.name for spec in SPECS if not spec.optional]
    specs = [spec for spec in choose_layers(CATALOG, names) if spec.derive is None]
    pairs, missing = find_files(specs, [geodata / "osm" / EXTRACTS[city]])
    assert not missing
    assert len({path for _, path in pairs}) == 1
    layers = [read_extract(geodata, city)[spec.name] for spec, _ in pairs]
    places = pd.concat([layer.table.geometry for layer in layers])
    assert places.estimate_utm_crs() == crs
    objects, report = build_objects(layers, taxonomy=CATALOG.taxonomy, crs=crs)
    assert sum(layer.counts.kept + layer.counts.collapsed for layer in report.layers) == len(places)
    assert all(layer.counts.missing == layer.counts.misplaced == 0 for layer in report.layers)
    assert tuple(map(str, objects.licenses)) == (
        f"OpenStreetMap contributors (ODbL 1.0): {', '.join(spec.name for spec in specs)}",
    )
    assert (objects.xy.max(axis=0) - objects.xy.min(axis=0) < 1.3 * extent).all()
    database = build_database(objects)
    evaluation = evaluate(database, queries=20, distortion="none", method="edit+edit", seed=1)
    # Without distortion, the true cell is among the best.
    assert (evaluation.queries.rank_low == 1).all()
