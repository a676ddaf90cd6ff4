"""Drafts of catalogues: keywords, guesses, and what is suggested for a file."""

from __future__ import annotations

import json
import re
import tomllib
from collections import Counter
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import pandas as pd
import pyogrio
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from sentences import refused

from semsig_gis.core.errors import CatalogError, SourceError
from semsig_gis.objects.draft import (
    Column,
    Sample,
    columns_of,
    guess_class,
    guess_class_by,
    guess_position,
    suggest_catalog,
)
from semsig_gis.objects.keywords import Keywords, Match, keywords, words_of
from semsig_gis.sources import reader
from semsig_gis.sources.catalog import catalog_names, load_catalog, paper_taxonomy
from semsig_gis.sources.vector import LayerInfo

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.core.taxonomy import ObjectClass
    from semsig_gis.sources import RawLayer
    from semsig_gis.sources.catalog import Catalog

SUGGESTION = re.compile(r"# (?=(?:where|class_by|id_field|unique_id) = )")


def load(draft: str, folder: Path) -> Catalog:
    path = folder / "draft.toml"
    path.write_text(draft, encoding="utf-8")
    return load_catalog(path)


def read(draft: str, file: Path, folder: Path) -> tuple[RawLayer, ...]:
    catalog = load(draft, folder)
    return reader(catalog.reader)(file, catalog.layers)


def layers(draft: str) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = tomllib.loads(draft)["layers"]
    return found


def edited(draft: str) -> str:
    """Fill in what a person must."""
    draft = draft.replace('class = "EDIT"', 'class = "bench"')
    return re.sub(r"# EDIT: the file does not say its coordinate.*", 'crs = "EPSG:2154"', draft)


def write(
    path: Path, fields: dict[str, list[object]], *, crs: str = "EPSG:2154", layer: str = ""
) -> Path:
    size = len(next(iter(fields.values())))
    x, y, step = (3.88, 43.61, 1e-5) if crs == "EPSG:4326" else (770_000.0, 6_280_000.0, 1.0)
    places = shapely.points([(x + row * step, y) for row in range(size)])
    options = {"layer": layer} if layer else {}
    gpd.GeoDataFrame(fields, geometry=places, crs=crs).to_file(path, **options)
    return path


def test_a_sure_draft_loads_as_it_is(tmp_path: Path) -> None:
    states: list[object] = ["neuf", "usé", "neuf", None, "neuf", "usé"]
    numbers: list[object] = [f"b{row}" for row in range(6)]
    file = write(tmp_path / "Bancs_publics.gpkg", {"Numéro": numbers, "etat": states})
    draft = suggest_catalog(file)
    (layer,) = read(draft, file, tmp_path)
    spec = layer.spec
    assert (spec.name, spec.class_name, spec.id_field) == ("bancs_publics", "bench", "Numéro")
    assert (spec.files, spec.rows) == (("Bancs_publics.gpkg",), (3, 12))
    assert spec.crs == load(draft, tmp_path).metric_crs == "EPSG:2154"
    assert (layer.counts.read, len(layer.table), layer.notes) == (6, 6, ())
    assert '# where = { etat = ["neuf", "usé"] }  # rows: 3, 2; without: 1' in draft
    assert "# Fields: Numéro, etat" in draft
    assert draft.count("EDIT") == 3  # in the introduction, for the licence and the attribution


def test_a_draft_that_knows_no_class_does_not_load(tmp_path: Path) -> None:
    file = write(tmp_path / "stuff.gpkg", {"a": [1, 2]})
    draft = suggest_catalog(file)
    with refused(CatalogError, "'EDIT'"):
        load(draft, tmp_path)
    assert len(read(edited(draft), file, tmp_path)) == 1


@pytest.mark.parametrize(
    ("name", "fields", "line"),
    [
        (
            "layer1.geojson",
            {"amenity": ["post_box"] * 3},
            'class = "post_box"  # EDIT: from amenity = post_box; is it so?',
        ),
        (
            "signalisation.gpkg",
            {"a": [1]},
            'class = "indicator"  # EDIT: from the name: "signalisation"; or is it traffic_light?',
        ),
    ],
)
def test_a_doubtful_class_is_marked(
    tmp_path: Path, name: str, fields: dict[str, list[object]], line: str
) -> None:
    crs = "EPSG:4326" if name.endswith("json") else "EPSG:2154"
    draft = suggest_catalog(write(tmp_path / name, fields, crs=crs))
    assert line in draft
    assert load(draft, tmp_path).layers[0].class_name == line.split('"')[1]


def test_classes_that_the_paper_has_not_keep_their_code_or_get_a_free_one(tmp_path: Path) -> None:
    def drafted(file: str, name: str) -> ObjectClass:
        path = write(tmp_path / file, {"a": [1]})
        return load(suggest_catalog(path), tmp_path).taxonomy.by_name(name)

    montpellier = load_catalog("montpellier").taxonomy
    assert drafted("horodateurs.gpkg", "parking_meter") == montpellier.by_name("parking_meter")
    own = drafted("defibrillateurs.gpkg", "defibrillator")
    shipped = [item for name in catalog_names() for item in load_catalog(name).taxonomy.classes]
    assert own.code not in {item.code for item in shipped}
    assert own.symbol not in {item.symbol for item in shipped}


def test_every_layer_with_geometry_is_drafted(tmp_path: Path) -> None:
    file = tmp_path / "town.gpkg"
    for layer in ("Arbres", "arbres!", "Bancs"):
        write(file, {"a": [1]}, layer=layer)
    pyogrio.write_dataframe(pd.DataFrame({"text": ["x"]}), file, layer="legend", append=True)
    draft = suggest_catalog(file)
    assert '# Left out, because they have no geometry: "legend"' in draft
    names = [(item["name"], item["layer"]) for item in layers(draft)]
    assert names == [("arbres", "Arbres"), ("arbres_2", "arbres!"), ("bancs", "Bancs")]
    assert [layer.counts.read for layer in read(draft, file, tmp_path)] == [1, 1, 1]


def test_buildings_and_streets_get_their_role(tmp_path: Path) -> None:
    for name, shape, role in (
        ("batiments", shapely.box(0, 0, 1, 1), "buildings"),
        ("streets", shapely.LineString([(0, 0), (1, 1)]), "streets"),
    ):
        file = tmp_path / f"{name}.gpkg"
        gpd.GeoDataFrame({"a": [1]}, geometry=[shape], crs="EPSG:2154").to_file(file)
        (spec,) = load(suggest_catalog(file), tmp_path).layers
        assert (spec.role, spec.class_name) == (role, "")


def test_a_value_that_tells_another_class_is_offered(tmp_path: Path) -> None:
    kinds: list[object] = ["Livraison", "Taxi", "GIG/GIC"] * 3
    file = write(tmp_path / "PlacesReserv.gpkg", {"Type": kinds})
    draft = suggest_catalog(file)
    offered = SUGGESTION.sub("", draft).replace("# [[classes]]", "[[classes]]")
    offered = re.sub(r"# (code|symbol|name|title) = ", r"\1 = ", offered)
    (layer,) = read(offered, file, tmp_path)
    assert (
        layer.table["class_name"].tolist() == ["reserved_bay", "taxi_station", "disabled_bay"] * 3
    )


@pytest.mark.parametrize(
    ("values", "line", "unique"),
    [
        ({"code": ["a", "a", "b"], "x": [1, 2, 3]}, '"code"  # 2 values in 3 rows', True),
        (
            {"height": [1.5, 2.5, 3.25], "kind": ["a", "a", "b"], "baumnr": [17, 18, 21]},
            '"baumnr"',
            False,
        ),
    ],
)
def test_ids_that_come_again_or_have_another_name_are_offered(
    tmp_path: Path, *, values: dict[str, list[object]], line: str, unique: bool
) -> None:
    draft = suggest_catalog(write(tmp_path / "trees.gpkg", values))
    assert f"# id_field = {line}" in draft
    (spec,) = load(SUGGESTION.sub("", draft), tmp_path).layers
    assert (spec.id_field, spec.unique_id) == (line.split('"')[1], unique)


@pytest.mark.parametrize(
    ("content", "crs", "marked", "first"),
    [
        ("3.88;43.61\n3.89;43.62\n", "EPSG:4326", 'crs = "EPSG:4326"  # EDIT', (3.88, 43.61)),
        ("770000;6280000\n", None, "# EDIT: the file does not say its c", (770_000, 6_280_000)),
    ],
)
def test_a_crs_that_nobody_names_is_guessed_or_left_to_the_person(
    tmp_path: Path, content: str, crs: str | None, marked: str, first: tuple[float, float]
) -> None:
    file = tmp_path / "bancs.csv"
    file.write_text(f"X;Y\n{content}", encoding="utf-8")
    draft = suggest_catalog(file)
    assert layers(draft)[0].get("crs") == crs
    assert marked in draft
    (layer,) = read(edited(draft), file, tmp_path)
    assert (layer.spec.x_field, layer.spec.y_field) == ("X", "Y")
    assert layer.table.crs == (crs or "EPSG:2154")
    assert layer.table.geometry[0] == shapely.Point(first)


@pytest.mark.parametrize(
    ("suffix", "content"),
    [
        ("csv", "id;Geo point\na;43.61, 3.88\nb;43.62,3.89\n"),
        ("csv", 'id,geo_point_2d\na,"43.61, 3.88"\nb,"43.62, 3.89"\n'),
        ("json", [{"id": "a", "lng": 3.88, "lat": 43.61}, {"id": "b", "lng": 3.89, "lat": 43.62}]),
        ("json", [{"id": i, "geo_point_2d": {"lon": 3.88, "lat": 43.61}} for i in "ab"]),
        (
            "json",
            [{"recordid": i, "fields": {"id": i, "geo_point_2d": [43.61, 3.88]}} for i in "ab"],
        ),
    ],
)
def test_tables_of_portals_are_drafted(tmp_path: Path, suffix: str, content: object) -> None:
    file = tmp_path / f"sanisettes.{suffix}"
    text = content if isinstance(content, str) else json.dumps(content)
    file.write_text(text, encoding="utf-8")
    draft = suggest_catalog(file)
    (layer,) = read(draft, file, tmp_path)
    assert load(draft, tmp_path).reader == "opendatasoft"
    assert layer.spec.class_name == "automatic_wc"
    assert layer.table["source_id"].tolist() == ["a", "b"]
    assert layer.table.geometry[0] == shapely.Point(3.88, 43.61)


def test_strange_names_and_values_stay_within_their_quotes(tmp_path: Path) -> None:
    file = write(
        tmp_path / 'arbres [2] "x" # ü.geojson',
        {
            'a "quoted" # field': ["x\ny", 'q"q', "\x7f"] * 4,
            "etat\n[[layers]]": ["]", "# [", "\\"] * 4,
            "statut": [True, False, True] * 4,
            "classe": ["/.*/", "a", "b"] * 4,
        },
        crs="EPSG:4326",
    )
    draft = suggest_catalog(file)
    (layer,) = read(draft, file, tmp_path)
    assert (layer.spec.name, layer.counts.read) == ("arbres_2_x_u", 12)
    lines = draft.splitlines()
    offered = [place for place, line in enumerate(lines) if line.startswith("# where")]
    assert len(offered) == 3  # a pattern is no value
    for place in offered:
        tried = [*lines[:place], SUGGESTION.sub("", lines[place]), *lines[place + 1 :]]
        (layer,) = read("\n".join(tried), file, tmp_path)
        assert (layer.counts.read, layer.counts.filtered) == (12, 0), lines[place]


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("town.osm.pbf", b"x", ("OpenStreetMap", "'openstreetmap'")),
        ("town.osm", b"<osm/>", ("OpenStreetMap", "'openstreetmap'")),
        ("town.csv", b"name;size\na;1\n", ("no field that looks like a position", "name, size")),
        ("town.json", b'[{"a": 1}]', ("no field that looks like a position",)),
        ("town.json", b"[", ("town.json",)),
        ("town.shp", b"x", ("town.shp",)),
        ("town.parquet", b"x", ("town.parquet",)),
        ("town.txt", b"x", ("town.txt",)),
        ("town.csv", None, ("town.csv", "does not exist")),
        ("town.gpkg", None, ("town.gpkg", "does not exist")),
    ],
)
def test_what_cannot_be_drafted_is_an_error(
    tmp_path: Path, name: str, content: bytes | None, words: tuple[str, ...]
) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with refused(SourceError, *words):
        suggest_catalog(tmp_path / name)


GUESSES = {
    "alignment_tree": ["ArbresAlign", "ArbresRemarq", "les-arbres", "paris_trees"],
    "automatic_wc": ["sanisettes"],
    "bike_station": ["bike_stations", "velib"],
    "buildings": ["Batiments"],
    "bus_stop": ["ratp"],
    "camera": ["CameraSurv"],
    "car_park": ["ParkingOuv"],
    "car_station": ["Autolib"],
    "defibrillator": ["Defibrillateurs"],
    "disabled_bay": ["PlacesGIG"],
    "indicator": ["Signalisation"],  # marked; the traffic lights are named second
    "notice_board": ["AffichageLibre"],
    "parking_meter": ["Horodateurs"],
    "pedestrian_crossing": ["PassagesPiet"],
    "post_box": ["BoiteLettre"],
    "recycling_point": ["Recyclage"],
    "reserved_bay": ["PlacesReserv"],
    "street_light": ["EclairagePublic"],
    "streets": ["FilaireVoies"],
    "taxi_station": ["taxi"],
    "telephone": ["TelephonePublic"],
    "traffic_light": ["feurouge", "signalisation-tricolore"],
    "water_fountain": ["Fontaines", "fontaines-a-boire"],
}
NO_GUESS = {
    "AccTrottoir", "EspacesVertsGlobal", "LimiteCommune", "arrondissements", "districts",
    "land_use", "perimeter",
}  # fmt: skip


@pytest.mark.parametrize("folder", ["montpellier", "paris"])
def test_published_files_are_drafted_and_read_by_their_drafts(
    geodata: Path, tmp_path: Path, folder: str
) -> None:
    files = [path for path in sorted((geodata / folder).iterdir()) if path.suffix != ".txt"]
    assert len(files) > 20
    for file in files:
        draft = suggest_catalog(file)
        (stanza,) = layers(draft)
        expected = {name for name, parts in GUESSES.items() if any(p in file.name for p in parts)}
        assert expected or any(part in file.name for part in NO_GUESS), file.name
        assert stanza.get("class", stanza.get("role")) in (expected or {"EDIT"}), file.name
        (layer,) = read(edited(draft), file, tmp_path)
        assert layer.counts.read > 0
        assert layer.counts.unreadable == 0
        assert len(layer.table) == layer.counts.read
        assert layer.spec.rows is not None
        assert layer.spec.rows[0] <= layer.counts.read <= layer.spec.rows[1]
        if layer.spec.id_field is not None:
            assert layer.table["source_id"].is_unique, file.name


def test_the_filters_of_the_montpellier_catalogue_are_offered(geodata: Path) -> None:
    for name, field, value in (
        ("FontainesPublic", "ETAT", "en fonction"),
        ("EclairagePublic", "type_lante", "Lanterne"),  # stands once, in row 29,000 or so
        ("ParkingOuv", "TYPARK_C_2", "Superstructure"),
        ("PlacesReserv", "F01_TYPE_D", "Livraison"),
    ):
        draft = suggest_catalog(geodata / "montpellier" / f"VilleMTP_MTP_{name}.zip")
        (line,) = (line for line in draft.splitlines() if f"where = {{ {field} =" in line)
        assert f'"{value}"' in line


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ()),
        ("VilleMTP_MTP_ArbresAlign", ("ville", "mtp", "mtp", "arbres", "align")),
        ("les-arbres", ("arbres",)),
        ("Fontaines à boire", ("fontaines", "boire")),
        ("Straßenbäume", ("strassenbaume",)),
        ("EspacesVerts2011", ("espaces", "verts", "2011")),
        ("POINT_X", ("point", "x")),
        ("Coord_Y", ("coord", "y")),
        ("œuvre n°7", ("œuvre", "n", "7")),
        ("日本 tree", ("日本", "tree")),
    ],
)
def test_names_are_taken_apart(text: str, words: tuple[str, ...]) -> None:
    assert words_of(text) == words


@given(st.text(max_size=40))
def test_words_are_words_again(text: str) -> None:
    words = words_of(text)
    assert words_of(" ".join(words)) == words


NAMES = {
    "": ["street", "wcxyz", "arrondissements", "limite commune"],
    "alignment_tree": [
        *("les-arbres", "Baumkataster_Berlin", "Straßenbäume", "arbolado viario", "street_trees")
    ],
    "automatic_wc": ["sanisettesparis", "WCPublic", "wcs"],
    "bike_station": ["velib-emplacement-des-stations"],
    "bus_stop": ["arrêts de bus", "BusStops", "fermate_atac"],
    "car_station": ["Autolib_dataset"],
    "disabled_bay": ["PlacesGIG"],
    "indicator traffic_light": ["Signalisation"],
    "parking_meter": ["parking meters"],
    "pedestrian_crossing": ["PassagesPiet"],
    "post_box": ["BoiteLettre", "boîtes aux lettres"],
    "street_light": ["streetlights", "EclairagePublic"],
    "taxi_station": ["bornes-d-appel-taxi", "bornes-dappel-taxi"],
    "traffic_light": ["signalisation-tricolore", "coord-feurouge_west", "Ampeln", "semafori"],
    "waste_basket bench": ["bancs et corbeilles"],
    "water_fountain": ["fontaines-a-boire"],
}


@pytest.mark.parametrize("classes", NAMES)
def test_layers_are_recognised_by_their_names(classes: str) -> None:
    for name in NAMES[classes]:
        assert [match.name for match in keywords("classes").find(name)] == classes.split(), name


def test_the_longest_keyword_decides_and_hides_its_parts() -> None:
    own = Keywords.of([("sign", "light"), ("lamp", "street light"), ("lamp", "lamp")])
    assert own.find("Street_Lights") == (Match("lamp", "street lights", 11),)
    assert [item.name for item in own.find("light and street light")] == ["lamp", "sign"]
    assert own.find("streetlight") == (Match("lamp", "streetlight", 11),)


def test_every_class_can_be_found_by_its_own_words() -> None:
    for name, phrase in keywords("classes").phrases:
        assert phrase, name
        found = keywords("classes").find(" ".join(phrase))
        assert name in {item.name for item in found}, phrase


def test_the_classes_are_those_of_the_catalogues() -> None:
    assert "keywords" not in catalog_names()
    known = {name for name, _ in keywords("classes").phrases}
    assert {item.name for item in paper_taxonomy().classes} <= known
    for catalog in catalog_names():
        own = {item.name for item in load_catalog(catalog).taxonomy.classes}
        assert own <= known, catalog
    assert {name for name, _ in keywords("class_fields").phrases} <= known


def sample(*rows: dict[str, Any]) -> Sample:
    fields = tuple((name, "") for name in dict.fromkeys(name for row in rows for name in row))
    return Sample("opendatasoft", LayerInfo("x", "Point", None, len(rows), fields), rows)


def column(name: str, *values: object) -> Column:
    (found,) = columns_of(sample(*({name: value} for value in values)))
    return found


def test_only_fields_of_plain_values_are_looked_at() -> None:
    rows = sample(
        {"a": 1, "b": {"lon": 1}, "c": "x", "d": None, "e": b"wkb"},
        {"a": None, "b": None, "c": "", "d": None, "e": None},
    )
    found = columns_of(rows)
    assert [(item.name, dict(item.counts), item.missing) for item in found] == [
        ("a", {1: 1}, 1),
        ("c", {"x": 1}, 1),
        ("d", {}, 2),
    ]


@pytest.mark.parametrize(
    ("values", "unique", "few"),
    [
        ((), False, False),
        (("a",), True, False),
        (("a", "b"), True, False),
        (("a", "b", None), False, False),
        (("a", "a", "b", "b"), False, True),
        (("a", "a", "a", "a"), False, False),
        ((True, False, True, True), False, True),
        ((1, 2, 1, 2), False, False),
        (("1", "2", "1", "2"), False, False),
        (("2019-01-02T10:00", "b", "b", "b"), False, False),
        (("x" * 61, "b", "b", "b"), False, False),
        (("a", "b", "a", "b", *[None] * 40), False, False),
        (tuple("abcdefghijklm" * 3), False, False),
    ],
)
def test_identifiers_and_filters_are_told_apart(
    values: tuple[object, ...],
    unique: bool,  # noqa: FBT001
    few: bool,  # noqa: FBT001
) -> None:
    counts = Counter(value for value in values if value is not None)
    found = Column("x", counts, len(values) - counts.total())
    assert (found.unique, found.few) == (unique, few)


@pytest.mark.parametrize(
    ("purpose", "names"),
    [
        (["filter"], ["TYPE_D_OPÉ", "Kind"]),
        (["identifier"], ["IDBASE", "cod_ouvrag"]),
        (["row_number"], ["OBJECTID_1"]),
        (["x"], ["POINT_X", "Longitude"]),
        (["y"], ["lat"]),
        ([], ["N° Voie", "LONGUEUR", "latin"]),
    ],
)
def test_fields_are_known_by_their_names(purpose: list[str], names: list[str]) -> None:
    purposes = ("filter", "identifier", "row_number", "x", "y")
    for name in names:
        fits = [item for item in purposes if Column(name, Counter(), 0).meant_for(item)]
        assert fits == purpose, name


KIND = column("amenity", "bench", "bench", "post box", "bench")
SPECIES = column("espece", "Platanus", "Acer", "Acer", "Acer")
USE = column("use", "tree", "tree")


@pytest.mark.parametrize(
    ("names", "geometry", "columns", "expected"),
    [
        ("Fontaines", "point", [KIND, SPECIES], ("water_fountain", False, True)),
        ("layer 1", "point", [SPECIES, KIND], ("bench", False, False)),
        ("layer 1", None, [SPECIES], ("alignment_tree", False, False)),
        ("layer 1", "point", [], ("", False, False)),
        ("districts", "polygon", [USE], ("", False, False)),
        ("bancs et corbeilles", "line", [], ("waste_basket", False, False)),
        ("street lights", "line", [], ("street_light", False, True)),
        ("Batiments", "polygon", [], ("buildings", True, True)),
        ("Gebäude", "polygon", [], ("buildings", True, True)),
        ("Batiments", "point", [], ("", False, False)),
        ("FilaireVoies", "line", [], ("streets", True, True)),
        ("streets", "line", [], ("streets", True, True)),
        ("streets", "polygon", [], ("", False, False)),
    ],
)
def test_the_class_is_guessed_by_name_then_values_then_fields(
    names: str, geometry: str | None, columns: list[Column], expected: tuple[str, bool, bool]
) -> None:
    guess = guess_class(names, columns, geometry=geometry, rows=4)
    assert (guess.name, guess.is_role, guess.sure) == expected
    assert guess.others == (("bench",) if guess.name == "waste_basket" else ())
    assert ("amenity = bench" in guess.reason) == (guess.name == "bench")
    assert ("the field espece" in guess.reason) == (guess.name == "alignment_tree")


def test_values_that_name_other_classes_are_found() -> None:
    kind = column("kind", *["Taxi", "Livraison", "GIG/GIC", "Autre"] * 3)
    assert guess_class_by([kind], "reserved_bay") == (
        "kind",
        {"Taxi": "taxi_station", "GIG/GIC": "disabled_bay"},
    )
    assert guess_class_by([column("kind", *["Taxi", "Autre"] * 3)], "taxi_station") is None
    assert guess_class_by([column("kind", "Taxi", "Bench")], "") is None  # each seen once


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        ([{"place": "48.85, 2.35"}, {"place": "48.85,2.35"}], ("place",)),
        ([{"place": "48.85, 2.35"}, {"place": None}], ("place",)),
        ([{"place": "rue 1, 2"}], ()),
        ([{"x": 1, "y": 2}], ("x", "y")),
        ([{"lng": "2.3", "lat": "48.8"}], ("lng", "lat")),
        ([{"lng": "here", "lat": "there"}], ()),
        ([{"x": 1}], ()),
    ],
)
def test_positions_are_found_in_a_table(
    rows: list[dict[str, Any]], expected: tuple[str, ...]
) -> None:
    table = sample(*rows)
    assert guess_position(table, columns_of(table)) == expected
