from __future__ import annotations

import fnmatch
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING

import pyogrio
import pytest
import shapely
from pyproj import CRS
from sentences import refused

from semsig_gis.core.crs import require_metric_crs
from semsig_gis.core.errors import CatalogError, InputError, UnknownNameError
from semsig_gis.core.taxonomy import ObjectClass
from semsig_gis.sources import catalog as catalog_module
from semsig_gis.sources.catalog import (
    Catalog,
    catalog_names,
    combine_catalogs,
    load_catalog,
    paper_taxonomy,
)
from semsig_gis.sources.layers import ClassBy, LayerSpec, WidthBy

if TYPE_CHECKING:
    from collections.abc import Callable

# Codes and symbols are written into every saved database, so they stay what they are.
PAPER = [
    (1, "B", "alignment_tree"),
    (2, "C", "water_fountain"),
    (3, "D", "street_light"),
    (4, "E", "indicator"),
    (5, "G", "traffic_light"),
    (6, "H", "bike_station"),
    (7, "I", "automatic_wc"),
    (8, "J", "car_station"),
    (9, "K", "taxi_station"),
    (10, "L", "bench"),
    (11, "M", "bus_stop"),
]
OWN = {
    "montpellier": [
        (12, "X", "pedestrian_crossing"),
        (13, "P", "parking_meter"),
        (14, "R", "reserved_bay"),
        (15, "W", "disabled_bay"),
        (16, "U", "car_park"),
        (17, "V", "camera"),
        (18, "N", "notice_board"),
    ],
    "opendata_paris": [],
    "openstreetmap": [
        (12, "X", "pedestrian_crossing"),
        (13, "P", "parking_meter"),
        (17, "V", "camera"),
        (19, "F", "fire_hydrant"),
        (20, "O", "post_box"),
        (21, "Z", "waste_basket"),
        (22, "Y", "bollard"),
        (23, "A", "advertising_column"),
        (24, "S", "monument"),
        (25, "T", "telephone"),
        (26, "Q", "vending_machine"),
        (27, "c", "clock"),
        (28, "f", "flagpole"),
        (29, "s", "street_cabinet"),
    ],
}
MONTPELLIER = [
    "trees",
    "fountains",
    "drinking_taps",
    "street_lights",
    "notice_boards",
    "traffic_lights",
    "parking_meters",
    "disabled_bays",
    "car_parks",
    "reserved_bays",
    "cameras",
    "crossings",
]
CENTRE_LINES = ["streets"]
GEOMETRY = {
    "point": {"Point", "MultiPoint"},
    "line": {"LineString", "MultiLineString"},
    "polygon": {"Polygon", "MultiPolygon"},
}

TOWN = """\
name = "town"
title = "Town open data"
url = "https://town.example"
license = "CC0"
attribution = "Town of Ville-Élan"
metric_crs = "EPSG:2154"

[[classes]]
code = 30
symbol = "Z"
name = "kiosk"
title = "Kiosk"

[[layers]]
name = "trees"
class = "alignment_tree"
files = ["trees*.geojson", "arbres.zip"]

[[layers]]
name = "posts"
class = "street_light"
files = ["posts.gpkg"]
layer = "posts_2014"
id_field = "ID"
geometry = "polygon"
crs = "EPSG:4326"
rows = [1, 10]
x_field = "X"
y_field = "Y"
license = "ODbL"
attribution = "Lighting of Town"
where = { STATE = ["ok", 1, 2.5, true], KIND = "big" }
class_by = { field = "KIND", values = { Kiosk = "kiosk", "Bus/Tram" = "bus_stop" } }
"""


@pytest.fixture
def town(tmp_path: Path) -> Callable[..., Path]:
    """Return a writer of the catalogue above in which one text is replaced by another."""

    def write(old: str = "", new: str = "") -> Path:
        assert not old or TOWN.count(old) == 1
        path = tmp_path / "town.toml"
        path.write_text(TOWN.replace(old, new) if old else TOWN, encoding="utf-8")
        return path

    return write


def test_a_catalogue_is_what_its_file_says(town: Callable[..., Path]) -> None:
    catalog = load_catalog(town())
    assert isinstance(catalog, Catalog)
    assert (catalog.name, catalog.title, catalog.metric_crs) == (
        "town",
        "Town open data",
        "EPSG:2154",
    )
    assert (catalog.url, catalog.license) == ("https://town.example", "CC0")
    assert catalog.attribution == "Town of Ville-Élan"
    assert catalog.taxonomy.classes[:11] == paper_taxonomy().classes
    assert catalog.taxonomy.by_code(30).name == "kiosk"
    assert catalog.layers == (
        LayerSpec(
            name="trees",
            class_name="alignment_tree",
            files=("trees*.geojson", "arbres.zip"),
            license="CC0",
            attribution="Town of Ville-Élan",
        ),
        LayerSpec(
            name="posts",
            class_name="street_light",
            files=("posts.gpkg",),
            layer="posts_2014",
            where=(("STATE", ("ok", 1, 2.5, True)), ("KIND", ("big",))),
            class_by=ClassBy("KIND", (("Kiosk", "kiosk"), ("Bus/Tram", "bus_stop"))),
            id_field="ID",
            geometry="polygon",
            crs="EPSG:4326",
            rows=(1, 10),
            x_field="X",
            y_field="Y",
            license="ODbL",
            attribution="Lighting of Town",
        ),
    )
    hash(catalog)


def test_ranges_go_into_the_taxonomy(town: Callable[..., Path]) -> None:
    assert all(item.range_m is None for item in load_catalog(town()).taxonomy.classes)
    path = town('title = "Kiosk"', 'title = "Kiosk"\nrange_m = 60')
    kiosk = load_catalog(path).taxonomy.by_name("kiosk")
    assert kiosk.range_m == 60.0
    text = 'title = "T"\nranges = { bus_stop = 50, kiosk = 12.5 }'
    taxonomy = load_catalog(town('title = "Town open data"', text)).taxonomy
    assert {c.name: c.range_m for c in taxonomy.classes if c.range_m is not None} == {
        "bus_stop": 50.0,
        "kiosk": 12.5,
    }
    ranges = taxonomy.ranges(30.0)
    assert (ranges[11], ranges[30], ranges[3]) == (50.0, 12.5, 30.0)


def test_streets_say_how_wide_they_are(town: Callable[..., Path]) -> None:
    old = 'name = "posts"\nclass = "street_light"'
    new = (
        'name = "posts"\nrole = "streets"\nwidth_field = "WIDTH"\n'
        'width_by = { field = "KIND", values = { Avenue = 24, "/R.*/" = 12.5 }, default = 16 }'
    )
    spec = load_catalog(town(old, new)).layer("posts")
    assert spec.width_by == WidthBy("KIND", (("Avenue", 24.0), ("/R.*/", 12.5)), 16.0)
    assert spec.width_field == "WIDTH"
    assert spec.has_width
    assert not load_catalog(town()).layer("posts").has_width


def test_a_path_may_be_text_and_the_file_may_have_a_mark(town: Callable[..., Path]) -> None:
    path = town()
    plain = load_catalog(str(path))
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    assert load_catalog(path) == plain


def test_a_layer_is_found_by_name(town: Callable[..., Path]) -> None:
    catalog = load_catalog(town())
    assert catalog.layer("posts").layer == "posts_2014"
    with refused(UnknownNameError, "'town'", "'tree'", "the nearest is 'trees'", "trees, posts"):
        catalog.layer("tree")


TITLE = 'title = "Town open data"'
POSTS = 'name = "posts"'
REST = TOWN[TOWN.index("[[classes]]") :]
# Lines below the title that are mistakes.
TOP_MISTAKES = {
    "conflate = { street_light = 0 }": ["conflate", "street_light = 0", "metres above 0"],
    "conflate = { street_light = 101 }": ["conflate", "street_light = 101", "up to 100"],
    "ranges = { bus_stop = 0 }": ["ranges", "bus_stop = 0", "metres above 0 and up to 6000"],
    "ranges = { bus_stop = nan }": ["ranges", "bus_stop = nan", "metres above 0"],
    "ranges = { bus_stop = true }": ["ranges", "bus_stop = True", "metres above 0"],
    'ranges = { bus_stop = "50 m" }': ["ranges", "bus_stop = '50 m'", "metres above 0"],
    "ranges = { bus_shelter = 50 }": ["ranges", "'bus_shelter'"],
    "ranges = 50": ["ranges = 50", "write a table"],
    "conflate = { street_lamp = 5 }": ["conflate", "'street_lamp'", "'street_light'"],
}
# Lines of the layer "posts".
LAYER_MISTAKES = {
    'role = "buildings"': ["no class"],
    'role = "building"': ["'buildings'"],
    'elements = ["nodes"]': ["'node'"],
    'tags = ["tree"]': ["the tags 'tree'"],
    "tags = [{ lamps = 2 }]": ["tag 'lamps'", "list of texts"],
    "optional = 1": ["true or false"],
    'width_field = "W"': ["'posts'", "width_field", "only streets"],
}
# Lines of that layer where it is one of streets.
STREET_MISTAKES = {
    'width_by = { field = "F", values = { A = 0 } }': [
        "'posts', width_by, values",
        "'A' = 0",
        "metres above 0 and up to 200",
    ],
    'width_by = { field = "F", values = {}, default = "wide" }': [
        "'posts', width_by",
        "default = 'wide'",
        "metres above 0",
    ],
    "width_by = { values = { A = 5 } }": ["'posts', width_by", "lacks the key 'field'"],
}
# Texts, what they are replaced by, and words of the sentence.
MISTAKES = {
    "misspelt key": ('title = "Town', 'titel = "Town', ["'titel'", "the nearest is 'title'"]),
    "misspelt table": ("[[classes]]", "[[clases]]", ["'clases'", "the nearest is 'classes'"]),
    "misspelt key of a class": ("symbol =", "symbool =", ["class 1", "'symbool'", "is 'symbol'"]),
    "misspelt key of a layer": (
        'id_field = "ID"',
        'idfield = "ID"',
        ["layer 'posts'", "'idfield'", "the nearest is 'id_field'"],
    ),
    "British licence": ('license = "ODbL"', 'licence = "ODbL"', ["layer 'posts'", "'license'"]),
    "misspelt key of class_by": ("{ field = ", "{ feild = ", ["'posts', class_by", "is 'field'"]),
    "key far from any": ('url = "', 'zzz = "', ["'zzz'", "the keys are name, title"]),
    "no name": ('name = "town"', "", ["lacks the key 'name'"]),
    "no title": ('title = "Town open data"', "", ["lacks the key 'title'"]),
    "no layers": (TOWN[TOWN.index("[[layers]]") :], "", ["lacks the key 'layers'"]),
    "empty layers": (REST, "layers = []", ["no layer", "[[layers]]"]),
    "layers as text": (REST, 'layers = "a"', ["write a list"]),
    "layer as text": (REST, 'layers = ["a"]', ["the layer 'a'"]),
    "layers as one table": (
        REST,
        '[layers]\nname = "a"',
        ["layers = {'name': 'a'}", "write a list"],
    ),
    "class as text": (
        REST,
        'classes = ["a"]\nlayers = []',
        ["class 1 is 'a'", "[[classes]]"],
    ),
    "class without a code": ("code = 30\n", "", ["class 1", "lacks the key 'code'"]),
    "class without a title": ('title = "Kiosk"\n', "", ["class 1", "lacks the key 'title'"]),
    "layer without a name": ('name = "posts"\n', "", ["layer '?'", "lacks the key 'name'"]),
    "layer without a class": ('class = "street_light"\n', "", ["'posts'", "the key 'class'"]),
    "layer without files": ('files = ["posts.gpkg"]\n', "", ["'posts'", "files = []"]),
    "class_by without values": (
        ', values = { Kiosk = "kiosk", "Bus/Tram" = "bus_stop" }',
        "",
        ["'posts', class_by", "lacks the key 'values'"],
    ),
    "unique ids without a field": (
        'id_field = "ID"',
        "unique_id = true",
        ["unique_id", "id_field"],
    ),
    "range of an own class": (
        'title = "Kiosk"',
        'title = "Kiosk"\nrange_m = -5',
        ["class 1", "range_m = -5", "metres above 0"],
    ),
    "two ranges of one class": (
        'attribution = "Town of Ville-Élan"\nmetric_crs = "EPSG:2154"\n\n[[classes]]',
        "ranges = { kiosk = 60 }\n[[classes]]\nrange_m = 50",
        ["a range_m of 'kiosk'", "one in ranges", "remove one"],
    ),
    "unknown class": (
        '"street_light"',
        '"street_ligth"',
        ["layer 'posts'", "'street_ligth'", "the nearest is 'street_light'"],
    ),
    "unknown class in class_by": (
        '"bus_stop"',
        '"bus_stopp"',
        ["'posts', class_by", "'bus_stopp'", "the nearest is 'bus_stop'"],
    ),
    "class in class_by that is no name": (
        '"bus_stop"',
        '["bus_stop"]',
        ["'posts', class_by", "'Bus/Tram' = ['bus_stop']", "the name of a class"],
    ),
    "class_by field that is no name": ('"KIND", values', "7, values", ["field = 7", "a string"]),
    "doubled symbol": (
        'symbol = "Z"',
        'symbol = "B"',
        ["town.toml", "symbol 'B'", "'alignment_tree' and 'kiosk'"],
    ),
    "doubled code": ("code = 30", "code = 3", ["town.toml", "code 3", "'street_light'"]),
    "doubled class": ('"kiosk"\ntitle', '"bench"\ntitle', ["town.toml", "name 'bench'"]),
    "doubled layer": ('name = "posts"', 'name = "trees"', ["two layers named 'trees'", "rename"]),
    "code out of range": ("code = 30", "code = 256", ["class 1", "'kiosk'", "256", "1 to 255"]),
    "code of zero": ("code = 30", "code = 0", ["class 1", "'kiosk'", "1 to 255"]),
    "code of true": ("code = 30", "code = true", ["class 1", "code = True", "whole number"]),
    "code as text": ("code = 30", 'code = "30"', ["class 1", "code = '30'", "whole number"]),
    "code with a point": ("code = 30", "code = 30.0", ["class 1", "30.0", "whole number"]),
    "long symbol": ('symbol = "Z"', 'symbol = "ZZ"', ["class 1", "'kiosk'", "'ZZ'", "one ASCII"]),
    "accented symbol": ('symbol = "Z"', 'symbol = "É"', ["class 1", "'É'", "one ASCII"]),
    "class name in capitals": ('"kiosk"\ntitle', '"Kiosk"\ntitle', ["class 1", "lower-case"]),
    "name of true": ('name = "town"', "name = true", ["name = True", "write a string"]),
    "title as a number": ('"Town open data"', "2014", ["title = 2014", "write a string"]),
    "files as text": ('["posts.gpkg"]', '"posts.gpkg"', ["'posts'", "files", "write a list"]),
    "no files": ('["posts.gpkg"]', "[]", ["'posts'", "files = []", "file names or patterns"]),
    "file that is no name": ('["posts.gpkg"]', "[7]", ["'posts'", "files = [7]", "list of texts"]),
    "file without a name": ('["posts.gpkg"]', '[""]', ["'posts'", "files = ['']", "list of texts"]),
    "unknown geometry": ('"polygon"', '"area"', ["'posts'", "geometry = 'area'", "'line'"]),
    "unknown CRS": ('"EPSG:4326"', '"EPSG:99"', ["'posts'", "crs = 'EPSG:99'", "'EPSG:4326'"]),
    "CRS as a number": ('"EPSG:4326"', "4326", ["'posts'", "crs = 4326", "write a string"]),
    "metric CRS in degrees": (
        'metric_crs = "EPSG:2154"',
        'metric_crs = "EPSG:4326"',
        ["town.toml", "WGS 84 is in degrees", "projected CRS in metres"],
    ),
    "Web Mercator": ('"EPSG:2154"', '"EPSG:3857"', ["town.toml", "Mercator", "metres"]),
    "unknown metric CRS": ('"EPSG:2154"', '"Lambert"', ["town.toml", "'Lambert' is unknown"]),
    "metric CRS as a number": ('"EPSG:2154"', "2154", ["metric_crs = 2154", "write a string"]),
    "rows the wrong way": ("[1, 10]", "[10, 1]", ["'posts'", "rows = [10, 1]", "[least, most]"]),
    "rows below zero": ("[1, 10]", "[-1, 10]", ["'posts'", "rows = [-1, 10]"]),
    "one number of rows": ("[1, 10]", "[10]", ["'posts'", "rows = [10]"]),
    "three numbers of rows": ("[1, 10]", "[1, 5, 10]", ["'posts'", "rows = [1, 5, 10]"]),
    "rows with a point": ("[1, 10]", "[1.5, 10]", ["'posts'", "rows = [1.5, 10]"]),
    "rows of true": ("[1, 10]", "[true, 10]", ["'posts'", "rows = [True, 10]"]),
    "rows as a number": ("[1, 10]", "10", ["'posts'", "rows = 10", "write a list"]),
    "filter on a table": ('KIND = "big"', "KIND = { a = 1 }", ["'posts'", "'KIND'", "{'a': 1}"]),
    "filter on no value": ('KIND = "big"', "KIND = []", ["'posts'", "'KIND'", "accepted value"]),
    "filter on a date": ('KIND = "big"', "KIND = 2014-05-01", ["'posts'", "'KIND'", "accepted"]),
    "filter on lists": ('KIND = "big"', "KIND = [[1]]", ["'posts'", "'KIND'", "[[1]]"]),
    "filter as text": (
        '{ STATE = ["ok", 1, 2.5, true], KIND = "big" }',
        "\"STATE = 'ok'\"",
        ["'posts'", "where = ", "write a table"],
    ),
    "bad TOML": ("rows = [1, 10]", "rows = [1, 10", ["town.toml is not valid TOML", "line 2"]),
    "key given twice": ("rows = [1, 10]", 'rows = []\ncrs = "a"', ["not valid TOML"]),
    **{line: (TITLE, f"{TITLE}\n{line}", words) for line, words in TOP_MISTAKES.items()},
    **{line: (POSTS, f"{POSTS}\n{line}", words) for line, words in LAYER_MISTAKES.items()},
    **{
        line: (f'{POSTS}\nclass = "street_light"', f'{POSTS}\nrole = "streets"\n{line}', words)
        for line, words in STREET_MISTAKES.items()
    },
}


@pytest.mark.parametrize(("old", "new", "words"), MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_has_its_sentence(
    town: Callable[..., Path], old: str, new: str, words: list[str]
) -> None:
    with refused(CatalogError, "town.toml", *words):
        load_catalog(town(old, new))


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    for path in (tmp_path / "town.toml", "nowhere/town.toml"):
        with refused(CatalogError, str(path), "does not exist", "'montpellier'"):
            load_catalog(path)


def test_a_file_that_is_not_utf8_is_named(tmp_path: Path) -> None:
    path = tmp_path / "town.toml"
    path.write_bytes(TOWN.encode("latin-1"))
    with refused(CatalogError, str(path), "is not UTF-8 text", "save it as UTF-8"):
        load_catalog(path)


def test_a_file_that_may_not_be_read_is_named(
    town: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = town()

    def refuse(*_: object, **__: object) -> str:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "read_text", refuse)
    with refused(CatalogError, str(path), "cannot be read (Permission denied)"):
        load_catalog(path)


@pytest.mark.parametrize("name", ["montpelier", "Montpellier", "taxonomy", "", "town.tml"])
def test_an_unknown_catalogue_is_named(name: str) -> None:
    with refused(UnknownNameError, repr(name), "'montpellier'", "path of a .toml file"):
        load_catalog(name)


# --- Several together ----------------------------------------------------------------------------


BENCH = LayerSpec(name="benches", class_name="bench")


def catalog_of(**values: object) -> Catalog:
    plain = {"name": "town", "title": "Town", "taxonomy": paper_taxonomy(), "layers": (BENCH,)}
    return Catalog(**{**plain, **values})  # type: ignore[arg-type]


def test_several_catalogues_become_one() -> None:
    both = combine_catalogs([load_catalog("openstreetmap"), load_catalog("montpellier")])
    assert both.name == "openstreetmap+montpellier"
    assert both.metric_crs == "EPSG:2154"
    assert both.layer("montpellier/trees").reader == "vector_file"
    assert both.layer("openstreetmap/trees").reader == "osm_file"
    assert dict(both.conflate)["bench"] == 4
    assert both.taxonomy.by_name("pedestrian_crossing").code == 12
    assert combine_catalogs([load_catalog("montpellier")]) == load_catalog("montpellier")


def test_the_first_radius_holds() -> None:
    first = catalog_of(name="a", conflate=(("bench", 2.0),))
    second = catalog_of(name="b", conflate=(("bench", 9.0), ("bus_stop", 5.0)))
    assert dict(combine_catalogs([first, second]).conflate) == {"bench": 2.0, "bus_stop": 5.0}


def test_the_first_range_holds() -> None:
    kiosk = paper_taxonomy().extended([ObjectClass(30, "Z", "kiosk", "Kiosk")])
    first = catalog_of(name="a", taxonomy=kiosk.with_ranges({"bench": 20.0}))
    second = catalog_of(
        name="b", taxonomy=kiosk.with_ranges({"bench": 25.0, "bus_stop": 50.0, "kiosk": 40.0})
    )
    both = combine_catalogs([first, second]).taxonomy
    assert {c.name: c.range_m for c in both.classes if c.range_m is not None} == {
        "bench": 20.0,
        "bus_stop": 50.0,
        "kiosk": 40.0,
    }
    assert [item.name for item in both.classes] == [item.name for item in kiosk.classes]
    assert combine_catalogs([second, first]).taxonomy.by_name("bench").range_m == 25.0


def test_catalogues_that_do_not_go_together() -> None:
    clash = paper_taxonomy().extended([ObjectClass(12, "Q", "quay", "Quay")])
    with refused(CatalogError, "montpellier", "town", "12"):
        combine_catalogs([load_catalog("montpellier"), catalog_of(taxonomy=clash)])
    for catalogs in ([], [catalog_of(), catalog_of()]):
        with refused(InputError, "each once"):
            combine_catalogs(catalogs)


# --- What is built in -------------------------------------------------------------------------


def test_the_classes_of_the_paper_keep_their_codes_and_symbols() -> None:
    classes = paper_taxonomy().classes
    assert [(item.code, item.symbol, item.name) for item in classes] == PAPER


def test_every_catalogue_is_listed_and_every_listed_one_loads() -> None:
    assert set(catalog_names()) == set(OWN)
    assert list(catalog_names()) == sorted(catalog_names())


@pytest.mark.parametrize("name", OWN)
def test_the_classes_of_a_catalogue_keep_their_codes_and_symbols(name: str) -> None:
    classes = load_catalog(name).taxonomy.classes
    assert [(item.code, item.symbol, item.name) for item in classes] == PAPER + OWN[name]
    assert all(item.title for item in classes)


@pytest.mark.parametrize("name", OWN)
def test_every_layer_says_what_it_needs_to(name: str) -> None:
    catalog = load_catalog(name)
    assert catalog.name == name
    if catalog.metric_crs is not None:
        assert require_metric_crs(catalog.metric_crs).is_projected
    for spec in catalog.layers:
        if name == "montpellier":
            assert spec.rows is not None, spec.name
        assert spec.license != "unknown", spec.name
        assert spec.attribution, spec.name


@pytest.mark.parametrize("name", OWN)
def test_the_classes_of_the_paper_are_seen_from_the_range_of_the_build(name: str) -> None:
    classes = load_catalog(name).taxonomy.classes
    assert {item.range_m for item in classes[: len(PAPER)]} == {None}
    # One that were seen further would make every search wider, whether it occurs or not.
    assert all(item.range_m is None or item.range_m < 30 for item in classes)


def test_the_classes_of_all_catalogues_go_together() -> None:
    together = combine_catalogs([load_catalog(name) for name in OWN])
    assert len(together.taxonomy.classes) == 11 + 7 + 11
    assert len(together.layers) == sum(len(load_catalog(name).layers) for name in OWN)


def test_the_layers_of_montpellier_are_those_of_the_issue() -> None:
    layers = [spec.name for spec in load_catalog("montpellier").layers]
    assert layers == MONTPELLIER + CENTRE_LINES


@pytest.mark.parametrize("layer", MONTPELLIER + CENTRE_LINES)
def test_a_layer_of_montpellier_is_as_its_publisher_left_it(layer: str, geodata: Path) -> None:
    spec = load_catalog("montpellier").layer(layer)
    found = [
        path
        for path in (geodata / "montpellier").iterdir()
        if any(fnmatch.fnmatchcase(path.name, pattern) for pattern in spec.files)
    ]
    assert len(found) == 1
    frame = pyogrio.read_dataframe(found[0])
    assert spec.rows is not None
    assert spec.rows[0] <= len(frame) <= spec.rows[1]
    assert set(frame.geom_type) <= GEOMETRY[spec.geometry]
    # The files spell their CRS as ESRI does, so it is compared by what it does to a point.
    assert spec.crs is not None
    there = frame.geometry.head(1)
    moved = there.to_crs(CRS(spec.crs)).geometry.iloc[0]
    assert shapely.distance(moved, there.iloc[0]) < 1e-3
    for field, accepted in spec.where:
        assert set(accepted) <= set(frame[field]), field
    if spec.class_by is not None:
        assert {value for value, _ in spec.class_by.classes} <= set(frame[spec.class_by.field])
    if spec.id_field is not None:
        assert frame[spec.id_field].notna().any()
    if spec.width_by is not None:
        assert {value for value, _ in spec.width_by.widths} <= set(frame[spec.width_by.field])


def test_the_shipped_files_are_found() -> None:
    folder = catalog_module.data_folder()
    names = {item.name for item in folder.iterdir()}
    assert {"taxonomy.toml", *(f"{name}.toml" for name in OWN)} <= names
    content = tomllib.loads((folder / "montpellier.toml").read_text(encoding="utf-8"))
    assert content["name"] == "montpellier"
