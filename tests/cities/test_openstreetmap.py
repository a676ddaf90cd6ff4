"""The catalogue of OpenStreetMap: its tags, and the real extracts against plain loops."""

from __future__ import annotations

import functools
from collections import Counter
from typing import TYPE_CHECKING

import numpy as np
import osmium
import pandas as pd
import pytest
import shapely
from osm_xml import node, relation, way, write_osm
from osmium.osm import WAY, Area, Node, Relation, Way

from semsig_gis.core.grid import GridSpec
from semsig_gis.database.build import build_database
from semsig_gis.database.viewpoints import ViewpointSpec, choose_viewpoints
from semsig_gis.evaluation.evaluate import evaluate
from semsig_gis.objects.clean import build_objects
from semsig_gis.objects.surroundings import read_surroundings
from semsig_gis.sources import find_files, reader
from semsig_gis.sources.catalog import load_catalog
from semsig_gis.sources.osm.file import read_layers

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from semsig_gis.sources import RawLayer
    from semsig_gis.sources.layers import LayerSpec

CATALOG = load_catalog("openstreetmap")
EXTRACTS = {
    "helsinki": "helsinki_2019.osm.pbf",
    "monaco": "monaco_2021.osm.pbf",
    "neukölln": "neukolln_2024.osm",
}

# --- Tags -------------------------------------------------------------------------------------

# Class or role of every layer, whether it is read only when named, the kinds of element that
# count, and its tags.
N, NWR, W, WR = "node", "node way relation", "way", "way relation"
PAPER, FURTHER = False, True
LAYERS = {
    "trees": ("alignment_tree", PAPER, N, ["natural=tree"]),
    "drinking_water": ("water_fountain", PAPER, NWR, ["amenity=drinking_water"]),
    "fountains": ("water_fountain", PAPER, NWR, ["amenity=fountain"]),
    "street_lights": ("street_light", PAPER, N, ["highway=street_lamp"]),
    "signs": (
        "indicator",
        PAPER,
        N,
        ["traffic_sign=DE:239", "traffic_sign=city_limit", "information=guidepost"],
    ),
    "information_boards": ("indicator", PAPER, NWR, ["information=board"]),
    "traffic_lights": ("traffic_light", PAPER, N, ["highway=traffic_signals"]),
    "bike_stations": ("bike_station", PAPER, NWR, ["amenity=bicycle_rental"]),
    "toilets": ("automatic_wc", PAPER, NWR, ["amenity=toilets"]),
    "car_sharing": ("car_station", PAPER, NWR, ["amenity=car_sharing"]),
    "taxi_ranks": ("taxi_station", PAPER, NWR, ["amenity=taxi"]),
    "benches": ("bench", PAPER, NWR, ["amenity=bench"]),
    "bus_stops": ("bus_stop", PAPER, N, ["highway=bus_stop"]),
    "bus_platforms": (
        "bus_stop",
        PAPER,
        WR,
        ["highway=platform bus=yes", "public_transport=platform bus=yes"],
    ),
    "fire_hydrants": ("fire_hydrant", FURTHER, N, ["emergency=fire_hydrant"]),
    "post_boxes": ("post_box", FURTHER, N, ["amenity=post_box"]),
    "waste_baskets": ("waste_basket", FURTHER, N, ["amenity=waste_basket"]),
    "bollards": ("bollard", FURTHER, N, ["barrier=bollard"]),
    "advertising_columns": ("advertising_column", FURTHER, NWR, ["advertising=column"]),
    "monuments": ("monument", FURTHER, NWR, ["historic=monument"]),
    "crossings": (
        "pedestrian_crossing",
        FURTHER,
        N,
        [
            "highway=crossing crossing=marked",
            "highway=crossing crossing=traffic_signals",
            "highway=crossing crossing=uncontrolled",
            "highway=crossing crossing=zebra",
            "highway=crossing crossing:markings=yes",
            "highway=crossing crossing:markings=lines",
        ],
    ),
    "cameras": ("camera", FURTHER, N, ["man_made=surveillance"]),
    "telephones": ("telephone", FURTHER, N, ["amenity=telephone"]),
    "parking_meters": (
        "parking_meter",
        FURTHER,
        N,
        ["amenity=parking_meter", "amenity=vending_machine vending=parking_tickets"],
    ),
    "vending_machines": (
        "vending_machine",
        FURTHER,
        N,
        [
            f"amenity=vending_machine vending={sold}"
            for sold in (
                "beverages",
                "bicycle_tube",
                "books",
                "bread",
                "chewing_gums",
                "cigarettes",
                "coffee",
                "condoms",
                "drinks",
                "eggs",
                "excrement_bags",
                "food",
                "ice_cream",
                "milk",
                "newspapers",
                "parcel_mail_in;parcel_pickup",
                "parcel_pickup",
                "parcel_pickup;parcel_mail_in",
                "photos",
                "pizza",
                "public_transport_tickets",
                "stamps",
                "sweets",
                "toys",
                "water",
            )
        ],
    ),
    "clocks": ("clock", FURTHER, N, ["amenity=clock"]),
    "flagpoles": ("flagpole", FURTHER, N, ["man_made=flagpole"]),
    "street_cabinets": ("street_cabinet", FURTHER, NWR, ["man_made=street_cabinet"]),
    "buildings": ("buildings", FURTHER, WR, ["building=yes", "building=church"]),
    "streets": (
        "streets",
        FURTHER,
        W,
        [
            f"highway={kind}"
            for kind in (
                "living_street",
                "pedestrian",
                "primary",
                "primary_link",
                "residential",
                "road",
                "secondary",
                "secondary_link",
                "tertiary",
                "tertiary_link",
                "trunk",
                "trunk_link",
                "unclassified",
            )
        ],
    ),
}
# Tags of no layer, whatever the kind of element.
NEAR_MISSES = [
    "amenity=public_bookcase",
    "natural=tree_row",
    "natural=tree_stump",
    "natural=shrub",
    "man_made=tree",
    "natural=Tree",
    "amenity=toilets;bench",
    "amenity=water_point",
    "amenity=watering_place",
    "emergency=drinking_water",
    "drinking_water=yes",
    "man_made=water_well",
    "support=street_lamp",
    "man_made=utility_pole",
    "traffic_sign=no",
    "information=office",
    "information=map",
    "tourism=information",
    "crossing=traffic_signals",
    "highway=stop",
    "highway=give_way",
    "amenity=bicycle_parking",
    "amenity=car_rental",
    "amenity=bus_station",
    "amenity=shelter",
    "amenity=lounger",
    "public_transport=stop_position bus=yes",
    "public_transport=platform",
    "public_transport=platform tram=yes",
    "public_transport=platform bus=no",
    "public_transport=station",
    "railway=platform",
    "railway=tram_stop",
    "disused:highway=bus_stop",
    "emergency=no",
    "emergency=phone",
    "amenity=recycling",
    "amenity=waste_disposal",
    "amenity=letter_box",
    "barrier=block",
    "advertising=poster_box",
    "historic=memorial",
    "highway=crossing",
    "highway=crossing crossing=no",
    "highway=crossing crossing=unmarked",
    "highway=crossing crossing:markings=no",
    "footway=crossing crossing=marked",
    "amenity=vending_machine",
    "vending=parking_tickets",
    "amenity=parking",
    "man_made=mast",
    "man_made=manhole",
    "building=no",
    "building:part=yes",
    "highway=motorway",
    "highway=footway",
    "highway=service",
    "highway=track",
    "highway=construction",
]
# The corners of what the ways and areas of the tests are drawn with.
PLACES = [node(1, 0.0, 0.0), node(2, 0.001, 0.0), node(3, 0.001, 0.001)]


def tags_of(text: str) -> dict[str, str]:
    return dict(tag.split("=", 1) for tag in text.split(" "))


def found(path: Path, text: str) -> dict[str, set[str]]:
    """Return the layers that find something with these tags, and as which kinds of element."""
    tags = tags_of(text)
    write_osm(
        path,
        *PLACES,
        node(4, 0.002, 0.002, tags),
        way(5, [1, 2, 3, 1], tags),
        relation(6, {5: "outer"}, {**tags, "type": "multipolygon"}),
    )
    kinds = {}
    for layer in read_layers(path, CATALOG.layers):
        assert layer.counts.unreadable == 0
        if len(layer.table):
            kinds[layer.spec.name] = set(layer.table.source_id.str.split("/").str[0])
    return kinds


def test_the_table_has_every_layer_and_tag_of_the_catalogue() -> None:
    assert {spec.name: (spec.class_name or spec.role) for spec in CATALOG.layers} == {
        name: meaning for name, (meaning, *_) in LAYERS.items()
    }
    for spec in CATALOG.layers:
        _, optional, kinds, texts = LAYERS[spec.name]
        assert spec.optional is optional
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
    [(name, text) for name, (_, _, _, texts) in LAYERS.items() for text in texts],
)
def test_every_tag_is_of_its_layer_alone(tmp_path: Path, name: str, text: str) -> None:
    kinds = set(LAYERS[name][2].split(" "))
    assert found(tmp_path / "city.osm", text) == {name: kinds}


@pytest.mark.parametrize("text", NEAR_MISSES)
def test_near_misses_are_of_no_layer(tmp_path: Path, text: str) -> None:
    assert found(tmp_path / "city.osm", text) == {}


def test_a_bus_stop_on_a_way_is_left_out_and_told(tmp_path: Path) -> None:
    path = write_osm(tmp_path / "city.osm", *PLACES, way(5, [1, 2], {"highway": "bus_stop"}))
    (layer,) = read_layers(path, [CATALOG.layer("bus_stops")])
    assert (layer.counts.read, layer.counts.filtered, len(layer.table)) == (1, 1, 0)


def test_a_pole_with_the_tags_of_a_platform_is_one_stop(tmp_path: Path) -> None:
    tags = {"highway": "bus_stop", "public_transport": "platform", "bus": "yes"}
    path = write_osm(tmp_path / "city.osm", node(1, 2.0, 48.0, tags))
    layers = read_layers(path, [CATALOG.layer("bus_stops"), CATALOG.layer("bus_platforms")])
    assert [len(layer.table) for layer in layers] == [1, 0]


def test_classes_are_the_same_in_every_catalogue() -> None:
    ours = {item.code: item for item in CATALOG.taxonomy.classes}
    others = {item.code: item for item in load_catalog("montpellier").taxonomy.classes}
    assert {code for code in ours if code in others} == {*range(1, 12), 12, 13, 17}
    assert all(others[code] == ours[code] for code in ours if code in others)
    assert {item.symbol for item in others.values()}.isdisjoint(
        item.symbol for code, item in ours.items() if code not in others
    )
    named = {spec.class_name for spec in CATALOG.layers if spec.role == "objects"}
    assert named == {item.name for item in ours.values()}


def test_licence_reader_and_files() -> None:
    assert (CATALOG.license, CATALOG.attribution) == ("ODbL 1.0", "OpenStreetMap contributors")
    assert reader(CATALOG.reader) is read_layers
    assert CATALOG.metric_crs is None
    assert all(address.startswith("https://") for address in CATALOG.endpoints)


# --- Real extracts ----------------------------------------------------------------------------

# Objects by layer and kind of element.
EXPECTED = {
    "helsinki": {
        "trees node": 649,
        "street_lights node": 586,
        "traffic_lights node": 135,
        "benches node": 162,
        "bus_stops node": 92,
        "bike_stations node": 15,
        "toilets node": 17,
        "toilets way": 1,
        "taxi_ranks node": 17,
        "car_sharing node": 2,
        "signs node": 1671,
        "information_boards node": 1,
        "fountains node": 8,
    },
    "monaco": {
        "trees node": 415,
        "street_lights node": 17,
        "traffic_lights node": 15,
        "benches node": 120,
        "benches way": 1,
        "bus_stops node": 104,
        "bike_stations node": 8,
        "toilets node": 29,
        "toilets way": 2,
        "taxi_ranks node": 4,
        "drinking_water node": 14,
        "fountains node": 7,
        "fountains way": 17,
        "signs node": 7,
        "information_boards node": 24,
    },
    "neukölln": {
        "trees node": 145,
        "street_lights node": 52,
        "traffic_lights node": 5,
        "benches node": 22,
        "bus_stops node": 2,
        "bike_stations node": 1,
        "toilets way": 1,
        "fountains way": 1,
        "signs node": 8,
        "information_boards node": 2,
    },
}
# Platforms of buses as ways and areas, which are merged with the stops near them.
PLATFORMS = {"helsinki": 0, "monaco": 2, "neukölln": 2}
# Building ways; of them incomplete ones, because the extract is clipped.
BUILDINGS = {"helsinki": (433, 48), "monaco": (1183, 0), "neukölln": (126, 0)}
BARE_TAGS: dict[str, Callable[[Mapping[str, str]], bool]] = {
    "trees": lambda tags: tags.get("natural") == "tree",
    "drinking_water": lambda tags: tags.get("amenity") == "drinking_water",
    "fountains": lambda tags: tags.get("amenity") == "fountain",
    "street_lights": lambda tags: tags.get("highway") == "street_lamp",
    "signs": lambda tags: "traffic_sign" in tags or tags.get("information") == "guidepost",
    "information_boards": lambda tags: tags.get("information") == "board",
    "traffic_lights": lambda tags: tags.get("highway") == "traffic_signals",
    "bike_stations": lambda tags: tags.get("amenity") == "bicycle_rental",
    "toilets": lambda tags: tags.get("amenity") == "toilets",
    "car_sharing": lambda tags: tags.get("amenity") == "car_sharing",
    "taxi_ranks": lambda tags: tags.get("amenity") == "taxi",
    "benches": lambda tags: tags.get("amenity") == "bench",
    "bus_stops": lambda tags: tags.get("highway") == "bus_stop",
    "buildings": lambda tags: "building" in tags,
}


def bare_loop(path: Path) -> tuple[Counter[str], Counter[str]]:
    """Count elements by layer and kind; also those of ways that lack nodes."""
    kinds = {"n": "node", "w": "way", "r": "relation"}
    seen: Counter[str] = Counter()
    clipped: Counter[str] = Counter()
    for element in osmium.FileProcessor(str(path)).with_locations():
        assert isinstance(element, Node | Way | Relation)
        tags = {tag.k: tag.v for tag in element.tags}
        for name, meant in BARE_TAGS.items():
            if meant(tags):
                key = f"{name} {kinds[element.type_str()]}"
                seen[key] += 1
                if isinstance(element, Way) and not all(n.location.valid() for n in element.nodes):
                    clipped[key] += 1
    return seen, clipped


@functools.cache
def read_extract(geodata: Path, city: str) -> Mapping[str, RawLayer]:
    path = geodata / "osm" / EXTRACTS[city]
    return {layer.spec.name: layer for layer in read_layers(path, CATALOG.layers)}


def by_kind(layers: Mapping[str, RawLayer]) -> Counter[str]:
    kept: Counter[str] = Counter()
    for name, layer in layers.items():
        assert layer.counts.kept == len(layer.table)
        kept.update(name + " " + layer.table.source_id.str.split("/").str[0])
    return kept


@pytest.mark.parametrize("city", EXTRACTS)
def test_objects_of_the_classes_of_the_paper(geodata: Path, city: str) -> None:
    layers = read_extract(geodata, city)
    classes = {name: layer for name, layer in layers.items() if not layer.spec.optional}
    platforms = classes.pop("bus_platforms")
    assert len(platforms.table) == PLATFORMS[city]
    assert by_kind(classes) == EXPECTED[city]
    assert all(layer.counts.unreadable == 0 for layer in classes.values())


@pytest.mark.parametrize("city", EXTRACTS)
def test_a_bare_loop_counts_the_same(geodata: Path, city: str) -> None:
    layers = read_extract(geodata, city)
    kept = by_kind(layers)
    seen, clipped = bare_loop(geodata / "osm" / EXTRACTS[city])
    assert seen["buildings way"] == BUILDINGS[city][0]
    for name in BARE_TAGS:
        spec = layers[name].spec
        assert layers[name].counts.read == sum(
            seen[f"{name} {kind}"] for kind in ("node", "way", "relation")
        )
        for kind in ("node", "way"):
            wanted = seen[f"{name} {kind}"] - clipped[f"{name} {kind}"]
            assert kept[f"{name} {kind}"] == (wanted if kind in spec.elements else 0), (name, kind)


@pytest.mark.parametrize("city", EXTRACTS)
def test_buildings_and_streets(geodata: Path, city: str) -> None:
    layers = read_extract(geodata, city)
    buildings, streets = layers["buildings"], layers["streets"]
    whole, clipped = BUILDINGS[city]
    assert by_kind(layers)["buildings way"] == whole - clipped
    assert buildings.table.geometry.geom_type.isin(["Polygon", "MultiPolygon"]).all()
    assert buildings.table.geometry.is_valid.all()
    assert (streets.table.geometry.geom_type == "LineString").all()
    assert len(streets.table) > 30
    # Houses are small, and nearly all of them on land of their own.
    metric = buildings.table.to_crs(buildings.table.estimate_utm_crs()).geometry
    assert 20 < metric.area.median() < 2000
    assert shapely.union_all(metric.array).area > 0.9 * metric.area.sum()


def test_a_street_is_as_wide_as_its_class_is(geodata: Path) -> None:
    """Widths are those of the catalogue by the tag, read by a plain loop."""
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
    # What `semsig build --streets FILE.osm.pbf` looks at.
    streets = read_surroundings(path, role="streets", crs="EPSG:32635")
    assert streets["half_width"].tolist() == table["half_width"].tolist()
    assert streets["half_width"].between(6, 15).all()


def test_wide_streets_have_more_viewpoints(geodata: Path) -> None:
    streets = read_surroundings(
        geodata / "osm" / EXTRACTS["helsinki"], role="streets", crs="EPSG:32635"
    )
    west, south, east, north = streets.total_bounds // 10
    columns, rows = np.meshgrid(np.arange(west, east), np.arange(south, north), indexing="ij")
    cells = columns.ravel().astype(np.int64), rows.ravel().astype(np.int64)
    lines, half = streets.geometry.to_numpy(), streets["half_width"].to_numpy()
    found = choose_viewpoints(
        *cells, grid=GridSpec(), spec=ViewpointSpec(mode="streets"), streets=lines, widths=half
    )
    area = shapely.union_all(shapely.buffer(lines, half))
    centres = GridSpec().viewpoints(*cells)
    assert (
        np.mean(found == shapely.contains_xy(area, *centres.T)) > 0.999
    )  # round ends are polygons
    alike = choose_viewpoints(
        *cells, grid=GridSpec(), spec=ViewpointSpec(mode="streets"), streets=lines
    )
    assert (alike & ~found).any()
    assert found.sum() > alike.sum()


def test_areas_are_those_of_pyosmium(geodata: Path) -> None:
    """The areas of multipolygons are those that libosmium assembles."""
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


def test_a_year_later_the_city_has_changed(geodata: Path) -> None:
    path = geodata / "osm" / "monaco_2022.osm.pbf"
    trees, stops = read_layers(path, [CATALOG.layer("trees"), CATALOG.layer("bus_stops")])
    assert (len(trees.table), len(stops.table)) == (524, 125)
    before = read_extract(geodata, "monaco")["trees"].table.source_id
    assert before.isin(trees.table.source_id).mean() > 0.9


def test_an_extract_for_routing(geodata: Path) -> None:
    path = geodata / "osm" / "paris_marais_routing.osm.pbf"
    names = ("traffic_lights", "bus_stops", "bike_stations")
    layers = read_layers(path, [CATALOG.layer(name) for name in names])
    assert [len(layer.table) for layer in layers] == [146, 88, 46]


def test_no_tags_and_no_users_are_kept(geodata: Path) -> None:
    for layer in read_extract(geodata, "neukölln").values():
        width = ["half_width"] if layer.spec.role == "streets" else []
        assert layer.table.columns.tolist() == ["class_name", "source_id", *width, "geometry"]
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
    specs: list[LayerSpec] = [spec for spec in CATALOG.layers if not spec.optional]
    pairs, missing = find_files(specs, [geodata / "osm" / EXTRACTS[city]])
    assert not missing
    assert len({path for _, path in pairs}) == 1
    layers = [read_extract(geodata, city)[spec.name] for spec, _ in pairs]
    places = pd.concat([layer.table.geometry for layer in layers])
    system = places.estimate_utm_crs()
    assert system == crs
    objects, report = build_objects(layers, taxonomy=CATALOG.taxonomy, crs=system)
    assert sum(layer.counts.kept + layer.counts.collapsed for layer in report.layers) == len(places)
    assert all(layer.counts.missing == layer.counts.misplaced == 0 for layer in report.layers)
    assert tuple(map(str, objects.licenses)) == (
        f"OpenStreetMap contributors (ODbL 1.0): {', '.join(spec.name for spec in specs)}",
    )
    assert (objects.xy.max(axis=0) - objects.xy.min(axis=0) < 1.3 * extent).all()
    database = build_database(objects)
    evaluation = evaluate(database, queries=20, distortion="none", seed=1)
    # Nothing is distorted, so that the true cell is among the best.
    assert (evaluation.queries.rank_low == 1).all()
    distorted = evaluate(database, queries=20, distortion="medium", seed=1)
    assert len(distorted.queries) == 20
