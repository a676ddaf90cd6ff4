from __future__ import annotations

import tomllib
from pathlib import Path
from typing import TYPE_CHECKING
from unittest.mock import Mock

import pyogrio
import pytest
import shapely
from pyproj import CRS
from sentences import refused

from semsig_gis.core.crs import require_metric_crs
from semsig_gis.core.errors import CatalogError, InputError, UnknownNameError
from semsig_gis.core.taxonomy import ObjectClass
from semsig_gis.sources import catalog as catalog_module
from semsig_gis.sources import find_files
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

    from semsig_gis.core.taxonomy import Taxonomy

NAMES = ("montpellier", "opendata_paris", "openstreetmap")

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
    assert catalog == Catalog(
        name="town",
        title="Town open data",
        url="https://town.example",
        license="CC0",
        attribution="Town of Ville-Élan",
        metric_crs="EPSG:2154",
        taxonomy=paper_taxonomy().extended([ObjectClass(30, "Z", "kiosk", "Kiosk")]),
        layers=(
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
        ),
    )
    hash(catalog)


def ranges_of(taxonomy: Taxonomy) -> dict[str, float]:
    return {c.name: c.range_m for c in taxonomy.classes if c.range_m is not None}


def test_ranges_go_into_the_taxonomy(town: Callable[..., Path]) -> None:
    assert ranges_of(load_catalog(town()).taxonomy) == {}
    path = town('title = "Kiosk"', 'title = "Kiosk"\nrange_m = 60')
    assert ranges_of(load_catalog(path).taxonomy) == {"kiosk": 60.0}
    text = 'title = "T"\nranges = { bus_stop = 50, kiosk = 12.5 }'
    taxonomy = load_catalog(town('title = "Town open data"', text)).taxonomy
    assert ranges_of(taxonomy) == {"bus_stop": 50.0, "kiosk": 12.5}
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
    assert (spec.width_field, spec.has_width) == ("WIDTH", True)
    assert [field for key, field in spec.fields if key.startswith("width")] == ["KIND", "WIDTH"]
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
NAMED = {
    "LAYERS": TOWN[TOWN.index("[[layers]]") :],
    "REST": TOWN[TOWN.index("[[classes]]") :],
    "VALUES": ', values = { Kiosk = "kiosk", "Bus/Tram" = "bus_stop" }',
    "WHERE": '{ STATE = ["ok", 1, 2.5, true], KIND = "big" }',
    "HEAD": 'metric_crs = "EPSG:2154"\n\n[[classes]]',
    "TOP": TITLE,
    "POSTS": POSTS,
    "STREETS": f'{POSTS}\nclass = "street_light"',
}
# What is replaced (a text or one named above), by what or with what below it, words to expect.
MISTAKES = r"""
title = "Town -> titel = "Town | 'titel' | the nearest is 'title'
[[classes]] -> [[clases]] | 'clases' | the nearest is 'classes'
symbol = -> symbool = | class 1 | 'symbool' | is 'symbol'
id_field = "ID" -> idfield = "ID" | layer 'posts' | 'idfield' | the nearest is 'id_field'
license = "ODbL" -> licence = "ODbL" | layer 'posts' | 'license'
{ field =  -> { feild =  | 'posts', class_by | is 'field'
url = " -> zzz = " | 'zzz' | the keys are name, title
name = "town" ->  | lacks the key 'name'
title = "Town open data" ->  | lacks the key 'title'
LAYERS ->  | lacks the key 'layers'
REST -> layers = [] | no layer | [[layers]]
REST -> layers = "a" | write a list
REST -> layers = ["a"] | the layer 'a'
REST -> [layers]\nname = "a" | layers = {'name': 'a'} | write a list
REST -> classes = ["a"]\nlayers = [] | class 1 is 'a' | [[classes]]
code = 30\n ->  | class 1 | lacks the key 'code'
title = "Kiosk"\n ->  | class 1 | lacks the key 'title'
name = "posts"\n ->  | layer '?' | lacks the key 'name'
class = "street_light"\n ->  | 'posts' | the key 'class'
files = ["posts.gpkg"]\n ->  | 'posts' | files = []
VALUES ->  | 'posts', class_by | lacks the key 'values'
id_field = "ID" -> unique_id = true | unique_id | id_field
title = "Kiosk" -> title = "Kiosk"\nrange_m = -5 | class 1 | range_m = -5 | metres above 0
HEAD -> ranges = { kiosk = 60 }\n[[classes]]\nrange_m = 50 | a range_m of 'kiosk' | one in ranges
"street_light" -> "street_ligth" | layer 'posts' | 'street_ligth' | the nearest is 'street_light'
"bus_stop" -> "bus_stopp" | 'posts', class_by | 'bus_stopp' | the nearest is 'bus_stop'
"bus_stop" -> ["bus_stop"] | 'posts', class_by | 'Bus/Tram' = ['bus_stop'] | the name of a class
"KIND", values -> 7, values | field = 7 | a string
symbol = "Z" -> symbol = "B" | symbol 'B' | 'alignment_tree' and 'kiosk'
code = 30 -> code = 3 | code 3 | 'street_light'
"kiosk"\ntitle -> "bench"\ntitle | name 'bench'
name = "posts" -> name = "trees" | two layers named 'trees' | rename
code = 30 -> code = 256 | class 1 | 'kiosk' | 256 | 1 to 255
code = 30 -> code = 0 | class 1 | 'kiosk' | 1 to 255
code = 30 -> code = true | class 1 | code = True | whole number
code = 30 -> code = "30" | class 1 | code = '30' | whole number
code = 30 -> code = 30.0 | class 1 | 30.0 | whole number
symbol = "Z" -> symbol = "ZZ" | class 1 | 'kiosk' | 'ZZ' | one ASCII
symbol = "Z" -> symbol = "É" | class 1 | 'É' | one ASCII
"kiosk"\ntitle -> "Kiosk"\ntitle | class 1 | lower-case
name = "town" -> name = true | name = True | write a string
"Town open data" -> 2014 | title = 2014 | write a string
["posts.gpkg"] -> "posts.gpkg" | 'posts' | files | write a list
["posts.gpkg"] -> [] | 'posts' | files = [] | file names or patterns
["posts.gpkg"] -> [7] | 'posts' | files = [7] | list of texts
["posts.gpkg"] -> [""] | 'posts' | files = [''] | list of texts
"polygon" -> "area" | 'posts' | geometry = 'area' | 'line'
"EPSG:4326" -> "EPSG:99" | 'posts' | crs = 'EPSG:99' | 'EPSG:4326'
"EPSG:4326" -> 4326 | 'posts' | crs = 4326 | write a string
"EPSG:2154" -> "EPSG:4326" | WGS 84 is in degrees | projected CRS in metres
"EPSG:2154" -> "EPSG:3857" | Mercator | metres
"EPSG:2154" -> "Lambert" | 'Lambert' is unknown
"EPSG:2154" -> 2154 | metric_crs = 2154 | write a string
[1, 10] -> [10, 1] | 'posts' | rows = [10, 1] | [least, most]
[1, 10] -> [-1, 10] | 'posts' | rows = [-1, 10]
[1, 10] -> [10] | 'posts' | rows = [10]
[1, 10] -> [1, 5, 10] | 'posts' | rows = [1, 5, 10]
[1, 10] -> [1.5, 10] | 'posts' | rows = [1.5, 10]
[1, 10] -> [true, 10] | 'posts' | rows = [True, 10]
[1, 10] -> 10 | 'posts' | rows = 10 | write a list
KIND = "big" -> KIND = { a = 1 } | 'posts' | 'KIND' | {'a': 1}
KIND = "big" -> KIND = [] | 'posts' | 'KIND' | accepted value
KIND = "big" -> KIND = 2014-05-01 | 'posts' | 'KIND' | accepted
KIND = "big" -> KIND = [[1]] | 'posts' | 'KIND' | [[1]]
WHERE -> "STATE = 'ok'" | 'posts' | where = | write a table
rows = [1, 10] -> rows = [1, 10 | town.toml is not valid TOML | line 2
rows = [1, 10] -> rows = []\ncrs = "a" | not valid TOML
TOP + conflate = { street_light = 0 } | conflate | street_light = 0 | metres above 0
TOP + conflate = { street_light = 101 } | conflate | street_light = 101 | up to 100
TOP + ranges = { bus_stop = 0 } | ranges | bus_stop = 0 | metres above 0 and up to 6000
TOP + ranges = { bus_stop = nan } | ranges | bus_stop = nan | metres above 0
TOP + ranges = { bus_stop = true } | ranges | bus_stop = True | metres above 0
TOP + ranges = { bus_stop = "50 m" } | ranges | bus_stop = '50 m' | metres above 0
TOP + ranges = { bus_shelter = 50 } | ranges | 'bus_shelter'
TOP + ranges = 50 | ranges = 50 | write a table
TOP + conflate = { street_lamp = 5 } | conflate | 'street_lamp' | 'street_light'
POSTS + role = "buildings" | no class
POSTS + role = "building" | 'buildings'
POSTS + elements = ["nodes"] | 'node'
POSTS + tags = ["tree"] | the tags 'tree'
POSTS + tags = [{ lamps = 2 }] | tag 'lamps' | list of texts
POSTS + optional = 1 | true or false
POSTS + role = "streets" | layer 'posts' | needs no class
POSTS + width_by = {} | width_by | only streets
class = "street_light" -> role = "buildings"\nwidth_field = "W" | width_field | only streets
POSTS + width_field = "W" | 'posts' | width_field | only streets
STREETS + width_by = { field = "F", values = { A = 0 } } | width_by, values | 'A' = 0 | up to 200
STREETS + width_by = { field = "F", values = {}, default = "a" } | width_by | = 'a' | above 0
STREETS + width_by = { values = { A = 5 } } | 'posts', width_by | lacks the key 'field'
"""


def mistake(row: str) -> tuple[str, str, list[str]]:
    """Return the text to replace, its replacement, and the words of a row."""
    change, *words = row.replace(r"\n", "\n").split(" | ")
    if " -> " in change:
        old, new = change.split(" -> ")
        return NAMED.get(old, old), new, words
    place, line = change.split(" + ")
    kept = f'{POSTS}\nrole = "streets"' if place == "STREETS" else NAMED[place]
    return NAMED[place], f"{kept}\n{line}", words


@pytest.mark.parametrize("row", MISTAKES.strip().splitlines())
def test_a_mistake_has_its_sentence(town: Callable[..., Path], row: str) -> None:
    old, new, words = mistake(row)
    with refused(CatalogError, "town.toml", *words):
        load_catalog(town(old, new))


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    for path in (tmp_path / "town.toml", "nowhere/town.toml"):
        with refused(CatalogError, str(path), "does not exist", "'montpellier'"):
            load_catalog(path)


def test_a_file_that_cannot_be_read_is_named(
    town: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = town()
    path.write_bytes(TOWN.encode("latin-1"))
    with refused(CatalogError, str(path), "is not UTF-8 text", "save it as UTF-8"):
        load_catalog(path)
    denied = Mock(side_effect=PermissionError(13, "Permission denied", str(path)))
    monkeypatch.setattr(Path, "read_text", denied)
    with refused(CatalogError, str(path), "cannot be read (Permission denied)"):
        load_catalog(path)


@pytest.mark.parametrize("name", ["montpelier", "Montpellier", "taxonomy", "", "town.tml"])
def test_an_unknown_catalogue_is_named(name: str) -> None:
    with refused(UnknownNameError, repr(name), "'montpellier'", "path of a .toml file"):
        load_catalog(name)


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


def test_the_first_radius_and_range_hold() -> None:
    kiosk = paper_taxonomy().extended([ObjectClass(30, "Z", "kiosk", "Kiosk")])
    ranges = {"bench": 25.0, "bus_stop": 50.0, "kiosk": 40.0}
    radii = (("bench", 9.0), ("bus_stop", 5.0))
    first = catalog_of(
        name="a", conflate=(("bench", 2.0),), taxonomy=kiosk.with_ranges({"bench": 20.0})
    )
    second = catalog_of(name="b", conflate=radii, taxonomy=kiosk.with_ranges(ranges))
    both = combine_catalogs([first, second])
    assert dict(both.conflate) == {"bench": 2.0, "bus_stop": 5.0}
    assert ranges_of(both.taxonomy) == {"bench": 20.0, "bus_stop": 50.0, "kiosk": 40.0}
    assert [item.name for item in both.taxonomy.classes] == [item.name for item in kiosk.classes]
    assert combine_catalogs([second, first]).taxonomy.by_name("bench").range_m == 25.0


def test_catalogues_that_do_not_go_together() -> None:
    clash = paper_taxonomy().extended([ObjectClass(12, "Q", "quay", "Quay")])
    with refused(CatalogError, "montpellier", "town", "12"):
        combine_catalogs([load_catalog("montpellier"), catalog_of(taxonomy=clash)])
    for catalogs in ([], [catalog_of(), catalog_of()]):
        with refused(InputError, "each once"):
            combine_catalogs(catalogs)


def test_classes_keep_their_codes_and_symbols_in_every_database(
    snapshot: Callable[[str, str], None],
) -> None:
    taxonomies = {name: load_catalog(name).taxonomy for name in NAMES}
    assert all(item.title for taxonomy in taxonomies.values() for item in taxonomy.classes)
    lines = [
        f"{name}: {item.code} {item.symbol} {item.name}\n"
        for name, taxonomy in ({"paper": paper_taxonomy()} | taxonomies).items()
        for item in taxonomy.classes
    ]
    snapshot("classes.txt", "".join(lines))


def test_every_catalogue_is_listed() -> None:
    assert list(catalog_names()) == sorted(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_every_layer_says_what_it_needs_to(name: str) -> None:
    catalog = load_catalog(name)
    assert catalog.name == name
    assert catalog.metric_crs is None or require_metric_crs(catalog.metric_crs).is_projected
    for spec in catalog.layers:
        assert spec.rows is not None or name != "montpellier", spec.name
        assert spec.license != "unknown", spec.name
        assert spec.attribution, spec.name
    # A class seen further than the build's range makes every search wider, if it occurs or not.
    assert all(metres < 30 for metres in ranges_of(catalog.taxonomy).values())
    paper = {item.name for item in paper_taxonomy().classes}
    assert not paper & ranges_of(catalog.taxonomy).keys()


def test_the_classes_of_all_catalogues_go_together() -> None:
    together = combine_catalogs([load_catalog(name) for name in NAMES])
    assert len(together.taxonomy.classes) == 11 + 7 + 11
    assert len(together.layers) == sum(len(load_catalog(name).layers) for name in NAMES)


MONTPELLIER = [spec.name for spec in load_catalog("montpellier").layers]


def test_the_layers_of_montpellier_are_complete(snapshot: Callable[[str, str], None]) -> None:
    snapshot("montpellier.txt", "\n".join(MONTPELLIER))


@pytest.mark.parametrize("layer", MONTPELLIER)
def test_a_layer_of_montpellier_is_as_its_publisher_left_it(layer: str, geodata: Path) -> None:
    spec = load_catalog("montpellier").layer(layer)
    (((_, path),), _) = find_files([spec], [geodata / "montpellier"])
    frame = pyogrio.read_dataframe(path)
    assert spec.rows is not None
    assert spec.rows[0] <= len(frame) <= spec.rows[1]
    kind = {"point": "Point", "line": "LineString", "polygon": "Polygon"}[spec.geometry]
    assert set(frame.geom_type) <= {kind, f"Multi{kind}"}
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
    assert {"taxonomy.toml", *(f"{name}.toml" for name in NAMES)} <= names
    content = tomllib.loads((folder / "montpellier.toml").read_text(encoding="utf-8"))
    assert content["name"] == "montpellier"
