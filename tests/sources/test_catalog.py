"""Catalogues: content of their files, errors in them, and the files of their layers."""

from __future__ import annotations

import dataclasses
import json
import unicodedata
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest.mock import Mock

import pyogrio
import pytest
import shapely
from pyproj import CRS
from raw_layers import BENCHES, catalog_of
from sentences import refused
from town_catalog import MISTAKES, TOWN, mistake

from semsig_gis.core import (
    FAMILIES,
    OWN_CODES,
    CatalogError,
    InputError,
    ObjectClass,
    SourceError,
    UnknownNameError,
)
from semsig_gis.sources import (
    DRIVERS,
    FILE_SUFFIXES,
    LayerSpec,
    WidthBy,
    built_in_taxonomy,
    catalog_names,
    combine_catalogs,
    find_files,
    load_catalog,
    paper_taxonomy,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from semsig_gis.core import Taxonomy

    Town = Callable[..., Path]
    Snapshot = Callable[[str, str], None]

NAMES = (
    "barcelona",
    "gbfs",
    "gtfs",
    "hamburg",
    "mapillary",
    "melbourne",
    "montpellier",
    "new_york",
    "opendata_paris",
    "openstreetmap",
    "overture",
    "vienna",
    "washington",
)


@pytest.fixture
def town(tmp_path: Path) -> Town:
    """Return a function that writes the catalogue ``town.toml`` with one text replaced."""

    def write(old: str = "", new: str = "") -> Path:
        assert not old or TOWN.count(old) == 1
        path = tmp_path / "town.toml"
        path.write_text(TOWN.replace(old, new) if old else TOWN, encoding="utf-8")
        return path

    return write


def test_catalogue_has_the_values_of_its_file(town: Town, snapshot: Snapshot) -> None:
    path = town()
    catalog = load_catalog(path)
    hash(catalog)
    kiosk = ObjectClass(30, "Z", "kiosk", "Kiosk")
    assert catalog.taxonomy == paper_taxonomy().extended([kiosk])
    values = dataclasses.asdict(catalog) | {"taxonomy": "the one above"}
    snapshot("town.json", json.dumps(values, indent=1, ensure_ascii=False))
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    assert load_catalog(str(path)) == catalog
    assert catalog.layer("posts") is catalog.layers[1]
    with refused(UnknownNameError, "'town'", "'tree'", "the nearest is 'trees'", "trees, posts"):
        catalog.layer("tree")


def ranges_of(taxonomy: Taxonomy) -> dict[str, float]:
    return {c.name: c.range_m for c in taxonomy.classes if c.range_m is not None}


def test_taxonomy_has_the_ranges_of_the_catalogue(town: Town) -> None:
    assert ranges_of(load_catalog(town()).taxonomy) == {}
    path = town('title = "Kiosk"', 'title = "Kiosk"\nrange_m = 60')
    assert ranges_of(load_catalog(path).taxonomy) == {"kiosk": 60.0}
    text = 'title = "T"\nranges = { bus_stop = 50, kiosk = 12.5 }'
    taxonomy = load_catalog(town('title = "Town open data"', text)).taxonomy
    assert ranges_of(taxonomy) == {"bus_stop": 50.0, "kiosk": 12.5}
    ranges = taxonomy.ranges(30.0)
    assert (ranges[11], ranges[30], ranges[3]) == (50.0, 12.5, 30.0)


def test_classes_have_the_titles_of_the_catalogue(town: Town) -> None:
    text = 'title = "T"\ntitles = { bus_stop = "Halt" }'
    ours = load_catalog(town('title = "Town open data"', text))
    assert ours.taxonomy.words([11, 30, 1]) == "halt, kiosk, tree"
    openstreetmap = load_catalog("openstreetmap").taxonomy
    assert openstreetmap.words([1, 7, 4, 12]) == "tree, toilets, sign, crossing"
    montpellier = load_catalog("montpellier")
    both = combine_catalogs([ours, montpellier]).taxonomy
    assert both.words([11, 12]) == "halt, pedestrian crossing"
    assert combine_catalogs([montpellier, ours]).taxonomy.words([11]) == "bus stop"


def test_taxonomy_has_the_heights_of_the_catalogue(town: Town) -> None:
    text = 'title = "Kiosk"\nheight_m = 3\nheight_sigma = 0.5'
    kiosk = load_catalog(town('title = "Kiosk"', text)).taxonomy.by_name("kiosk")
    assert (kiosk.height_m, kiosk.height_sigma) == (3.0, 0.5)


def test_layer_of_streets_has_widths(town: Town) -> None:
    old = 'name = "posts"\nclass = "street_light"'
    new = (
        'name = "posts"\nrole = "streets"\nwidth_field = "WIDTH"\nname_field = "NAME"\n'
        'width_by = { field = "TYPE", values = { Avenue = 24, "/R.*/" = 12.5 }, default = 16 }'
    )
    spec = load_catalog(town(old, new)).layer("posts")
    assert spec.width_by == WidthBy("TYPE", (("Avenue", 24.0), ("/R.*/", 12.5)), 16.0)
    assert (spec.width_field, spec.has_width) == ("WIDTH", True)
    assert spec.fields == (
        ("where", "STATE"),
        ("where", "KIND"),
        ("not", "LEVEL"),
        ("not", "GONE"),
        ("class_by", "KIND"),
        ("width_by", "TYPE"),
        ("width_field", "WIDTH"),
        ("name_field", "NAME"),
        ("id_field", "ID"),
    )
    assert not load_catalog(town()).layer("posts").has_width


@pytest.mark.parametrize("row", MISTAKES)
def test_invalid_catalogue_is_refused(town: Town, row: str) -> None:
    old, new, words = mistake(row)
    with refused(CatalogError, "town.toml", *words):
        load_catalog(town(old, new))


def test_unreadable_catalogue_file_is_refused(town: Town, monkeypatch: pytest.MonkeyPatch) -> None:
    path = town()
    for nowhere in (path.with_name("city.toml"), "nowhere/town.toml"):
        with refused(CatalogError, str(nowhere), "does not exist", "'montpellier'"):
            load_catalog(nowhere)
    path.write_bytes(TOWN.encode("latin-1"))
    with refused(CatalogError, str(path), "is not UTF-8 text", "save it as UTF-8"):
        load_catalog(path)
    denied = Mock(side_effect=PermissionError(13, "Permission denied", str(path)))
    monkeypatch.setattr(Path, "read_bytes", denied)
    with refused(CatalogError, str(path), "cannot be read (Permission denied)"):
        load_catalog(path)


@pytest.mark.parametrize("name", ["montpelier", "Montpellier", "taxonomy", "", "town.tml"])
def test_unknown_catalogue_is_refused(name: str) -> None:
    with refused(UnknownNameError, repr(name), "'montpellier'", "path of a .toml file"):
        load_catalog(name)


def test_catalogues_are_combined() -> None:
    both = combine_catalogs([load_catalog("openstreetmap"), load_catalog("montpellier")])
    assert both.name == "openstreetmap+montpellier"
    assert both.metric_crs == "EPSG:2154"
    assert both.layer("montpellier/trees").reader == "vector_file"
    assert both.layer("openstreetmap/trees").reader == "osm_file"
    assert dict(both.conflate)["bench"] == 4
    assert both.taxonomy.by_name("pedestrian_crossing").code == 12
    assert combine_catalogs([load_catalog("montpellier")]) == load_catalog("montpellier")


def test_first_catalogue_decides_radius_and_range() -> None:
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


def test_first_catalogue_decides_height() -> None:
    sizes: list[dict[str, Any]] = [{}, {"height_m": 3.0, "height_sigma": 0.5}]
    sizes += [{"range_m": 9.0, "height_m": 2.0, "height_sigma": 0.1}]
    kiosks = [dataclasses.replace(ObjectClass(30, "Z", "kiosk", "Kiosk"), **size) for size in sizes]
    catalogs = [
        catalog_of(name=f"c{number}", taxonomy=paper_taxonomy().extended([kiosk]))
        for number, kiosk in enumerate(kiosks)
    ]
    both = combine_catalogs(catalogs).taxonomy.by_name("kiosk")
    assert (both.range_m, both.height_m, both.height_sigma) == (9.0, 3.0, 0.5)


def test_contradictory_catalogues_are_refused() -> None:
    clash = paper_taxonomy().extended([ObjectClass(12, "Q", "quay", "Quay")])
    with refused(CatalogError, "montpellier", "town", "12"):
        combine_catalogs([load_catalog("montpellier"), catalog_of(taxonomy=clash)])
    for catalogs in ([], [catalog_of(), catalog_of()]):
        with refused(InputError, "each once"):
            combine_catalogs(catalogs)


def test_codes_and_symbols_of_classes_do_not_change(snapshot: Snapshot) -> None:
    taxonomies = {name: load_catalog(name).taxonomy for name in NAMES}
    assert all(item.title for taxonomy in taxonomies.values() for item in taxonomy.classes)
    lines = [
        f"{name}: {item.code} {item.symbol} {item.name}\n"
        for name, taxonomy in ({"paper": paper_taxonomy()} | taxonomies).items()
        for item in taxonomy.classes
    ]
    snapshot("classes.txt", "".join(lines))


@pytest.mark.parametrize("name", NAMES)
def test_built_in_layers_are_complete(name: str) -> None:
    catalog = load_catalog(name)
    assert catalog.name == name
    for spec in catalog.layers:
        assert spec.rows is not None or name != "montpellier", spec.name
        assert spec.license != "unknown", spec.name
        assert spec.attribution, spec.name
    paper = {item.name for item in paper_taxonomy().classes}
    assert not paper & ranges_of(catalog.taxonomy).keys()


def test_all_built_in_catalogues_can_be_combined() -> None:
    assert list(catalog_names()) == sorted(NAMES)
    together = combine_catalogs([load_catalog(name) for name in NAMES])
    built_in = {item.name for item in built_in_taxonomy().classes}
    assert {item.name for item in together.taxonomy.classes} == built_in
    assert len(together.layers) == sum(len(load_catalog(name).layers) for name in NAMES)


def test_built_in_classes_fit_their_families() -> None:
    """Codes leave room, no class is named as a family, and only landmarks are seen from far."""
    classes = built_in_taxonomy().classes
    assert [item.code for item in classes] == list(range(1, len(classes) + 1))
    assert 200 <= len(classes) <= OWN_CODES - 6
    assert built_in_taxonomy().classes[:11] == paper_taxonomy().classes
    families = {item.family for item in classes}
    assert families == FAMILIES.keys()
    assert not families & {item.name for item in classes}
    for item in classes:
        assert item.tall == (item.family == "landmark")
        assert (item.range_m or 30.0) <= (2000.0 if item.tall else 150.0)
        assert not item.tall or (item.range_m or 0.0) >= 1000.0
        # Symbols are stored as they are typed, and digits are numbers in a requirement.
        assert unicodedata.normalize("NFC", item.symbol) == item.symbol
        assert item.symbol.isalpha()


def test_a_class_is_named_without_its_table(tmp_path: Path) -> None:
    """A layer uses a built-in class by its name, and the catalogue's own one has priority."""
    head = 'name = "town"\ntitle = "Town"\n'
    changes = '[titles]\nbakery = "Bread"\n[ranges]\nbakery = 20\n'
    own = '[[classes]]\ncode = 230\nsymbol = "9"\nname = "bakery"\ntitle = "Bread"\n'
    layer = '[[layers]]\nname = "bakeries"\nclass = "bakery"\nfiles = ["a.csv"]\n'
    path = tmp_path / "town.toml"
    path.write_text(head + changes + layer, "utf-8")
    bakery = dataclasses.replace(built_in_taxonomy().by_name("bakery"), range_m=20.0)
    taxonomy = load_catalog(path).taxonomy
    assert taxonomy.classes == (*paper_taxonomy().classes, bakery)
    assert taxonomy.by_name("bakery").title == "Bread"
    path.write_text(head + own + layer, "utf-8")
    assert [item.code for item in load_catalog(path).taxonomy.classes[11:]] == [230]


MONTPELLIER = [spec.name for spec in load_catalog("montpellier").layers]


def test_layers_of_montpellier_do_not_change(snapshot: Snapshot) -> None:
    snapshot("montpellier.txt", "\n".join(MONTPELLIER))


@pytest.mark.parametrize("layer", MONTPELLIER)
def test_layer_of_montpellier_matches_the_published_file(layer: str, geodata: Path) -> None:
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
    position = there.to_crs(CRS(spec.crs)).geometry.iloc[0]
    assert shapely.distance(position, there.iloc[0]) < 1e-3
    where = dict(spec.where)
    if spec.class_by is not None:
        where[spec.class_by.field] = tuple(value for value, _ in spec.class_by.classes)
    if spec.width_by is not None:
        where[spec.width_by.field] = tuple(value for value, _ in spec.width_by.widths)
    for field, accepted in where.items():
        assert set(accepted) <= set(frame[field]), field
    if spec.id_field is not None:
        assert frame[spec.id_field].notna().any()


TREES = LayerSpec(name="trees", class_name="alignment_tree", files=("*trees*.zip", "*trees*"))
LIGHTS = LayerSpec(name="lights", class_name="street_light", files=("lights.*", "city.gpkg"))
SEATS = dataclasses.replace(BENCHES, files=("city.gpkg",))
SPECS = (TREES, LIGHTS, SEATS)


def touch(folder: Path, *names: str) -> list[Path]:
    folder.mkdir(exist_ok=True)
    paths = [folder / name for name in names]
    for path in paths:
        path.touch()
    return paths


def test_find_files_pairs_layers_with_files(tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    zipped, _, lights, *_ = touch(
        folder, "Trees_2014.ZIP", "trees.geojson", "lights.shp", "lights.dbf", "readme.txt"
    )
    assert find_files(SPECS, [folder]) == (((TREES, zipped), (LIGHTS, lights)), (SEATS,))
    # One file may hold several layers, and one that is given by itself goes first.
    city, mine = touch(tmp_path, "city.gpkg", "my_trees.geojson")
    assert find_files(SPECS, [str(city)]) == (((LIGHTS, city), (SEATS, city)), (TREES,))
    for paths in ([folder, mine], [mine, mine]):
        assert find_files(SPECS, paths)[0][0] == (TREES, mine)
    assert {*DRIVERS, ".zip"} - {".db", ".txt"} < FILE_SUFFIXES  # mostly no data


def test_find_files_pairs_a_layer_with_several_extracts(tmp_path: Path) -> None:
    files = ("*.osm", "*.pbf")
    spec = LayerSpec(name="trees", class_name="alignment_tree", files=files, reader="osm_file")
    extracts = touch(tmp_path, "east.osm.pbf", "west.osm")
    assert find_files([spec], [tmp_path]) == (tuple((spec, path) for path in extracts), ())


def test_find_files_refuses_unmatched_files(tmp_path: Path) -> None:
    first, second = touch(tmp_path, "trees_a.zip", "trees_b.zip")
    for paths in ([tmp_path], [first, second]):
        with refused(SourceError, f"'trees' is matched by {first} and {second}; give one"):
            find_files(SPECS, paths)
    with refused(SourceError, "none.zip does not exist"):
        find_files(SPECS, [tmp_path / "none.zip"])
    (other,) = touch(tmp_path / "folder", "cars.zip")
    layers = "the layers and their files are trees (*trees*.zip, *trees*), lights"
    with refused(SourceError, "cars.zip is not the file of any layer", layers):
        find_files(SPECS, [other])
    with refused(SourceError, "contains no file of any layer"):
        find_files(SPECS, [other.parent])
