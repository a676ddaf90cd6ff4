"""Drafts of catalogues: keywords, guesses, and the draft for a file."""

from __future__ import annotations

import csv
import io
import json
import re
import textwrap
import tomllib
from collections import Counter
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pandas as pd
import pyogrio
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import CRS
from sentences import refused

from semsig_gis.core import OWN_CODES, CrsError, SourceError
from semsig_gis.objects import (
    Column,
    LayerSample,
    assemble,
    columns_of,
    draft_catalog,
    guess_class,
    guess_class_by,
    read_files,
)
from semsig_gis.objects import (
    load as load_objects,
)
from semsig_gis.sources import (
    Keywords,
    LayerInfo,
    Match,
    built_in_taxonomy,
    catalog_names,
    keywords,
    load_catalog,
    paper_taxonomy,
    reader,
    transform_points,
    words_for,
    words_of,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from semsig_gis.core import ObjectClass
    from semsig_gis.sources import Catalog, RawLayer

# Comments that a person would uncomment.
OFFERED = re.compile(r"# (?=\[\[classes|(?:where|class_by|\w*id\w*|code|symbol|name|title) = )")


def load(draft: str, folder: Path) -> Catalog:
    path = folder / "draft.toml"
    path.write_text(draft, encoding="utf-8")
    return load_catalog(path)


def read(draft: str, file: Path, folder: Path) -> tuple[RawLayer, ...]:
    """Read a file with its draft."""
    catalog = load(draft, folder)
    return reader(catalog.reader)(file, catalog.layers)


def write(path: Path, fields: Mapping[str, Sequence[object]]) -> Path:
    size = len(next(iter(fields.values())))
    metric = path.suffix == ".gpkg"
    x, y, step = (770_000.0, 6_280_000.0, 1.0) if metric else (3.88, 43.61, 1e-5)
    places = shapely.points([(x + row * step, y) for row in range(size)])
    crs = "EPSG:2154" if metric else "EPSG:4326"
    gpd.GeoDataFrame(fields, geometry=places, crs=crs).to_file(path)
    return path


def check(file: Path, snapshot: Callable[[str, str], None]) -> None:
    """Compare a draft, and the rows read with all of its offers uncommented."""
    text = draft = draft_catalog(file, crs="EPSG:2154" if "lambert" in file.name else None)
    assert all(layer.counts.kept == layer.counts.read for layer in read(draft, file, file.parent))
    for layer in read(OFFERED.sub("", draft), file, file.parent):
        text += f"\n# {layer.spec.name}: {layer.counts.kept} of {layer.counts.read} rows\n"
        rows = layer.table.to_wkt(rounding_precision=5)
        text += textwrap.indent(rows.to_csv(index=False, lineterminator="\n"), "# ")
    snapshot(f"{file.name}.toml", text.replace(f"{file.parent}/", ""))


FILES: dict[str, dict[str, list[object]] | list[object] | str] = {
    # The class is certain, doubtful, one of two, or unknown.
    "Bancs_publics.gpkg": {
        "Numéro": [f"b{row}" for row in range(6)],
        "etat": ["neuf", "usé", "neuf", None, "neuf", "usé"],
    },
    "layer1.geojson": {"amenity": ["post_box"] * 3},
    "signalisation.gpkg": {"a": [1]},
    "stuff.gpkg": {"a": [1, 2]},
    # Values name other classes: of most rows, of few, or not of all.
    "PlacesReserv.gpkg": {"Type": ["Livraison", "Taxi", "GIG/GIC"] * 3},
    "Places_reserv.gpkg": {"Type": [*["Livraison"] * 9, "Taxi"]},
    "assets.gpkg": {"Kind": ["Bench", "Bench", "Tree pit"] * 2},
    "furniture.gpkg": {"Kind": ["Bench", "lamp", "Pole", "Thing", None, "Bench, red", "lamp"] * 2},
    # Ids are repeated, or the field has an unusual name.
    "trees.gpkg": {"code": ["a", "a", "b"], "x": [1, 2, 3]},
    "arbres.gpkg": {"height": [1.5, 2.5, 3.25], "kind": ["a", "a", "b"], "baumnr": [17, 18, 21]},
    # A CRS that is not stated is guessed, or must be given.
    "bancs.csv": "X;Y\n3.88;43.61\n3.89;43.62\n",
    "bancs_lambert.csv": "X;Y\n770000;6280000\n",
    # Tables of portals.
    "sanisettes.csv": "id;Geo point\na;43.61, 3.88\nb;43.62,3.89\n",
    "sanisettes_2d.csv": 'id,geo_point_2d\na,"43.61, 3.88"\nb,"43.62, 3.89"\n',
    "sanisettes.json": [{"id": i, "lng": 3.88, "lat": 43.61} for i in "ab"],
    "sanisettes_2d.json": [{"id": i, "geo_point_2d": {"lon": 3.88, "lat": 43.61}} for i in "ab"],
    "sanisettes_records.json": [
        {"recordid": i, "fields": {"id": i, "geo_point_2d": [43.61, 3.88]}} for i in "ab"
    ],
}


@pytest.mark.parametrize("name", FILES)
def test_file_is_read_with_its_draft(
    tmp_path: Path, name: str, snapshot: Callable[[str, str], None]
) -> None:
    content = FILES[name]
    file = tmp_path / name
    if isinstance(content, dict):
        write(file, content)
    else:
        text = content if isinstance(content, str) else json.dumps(content)
        file.write_text(text, encoding="utf-8")
    check(file, snapshot)


@pytest.mark.parametrize(
    ("stem", "name"), [("stuff", "stuff"), ("2019 œuvres", "layer_2019_uvres"), ("木", "layer")]
)
def test_unknown_file_gets_a_class_of_its_own(tmp_path: Path, stem: str, name: str) -> None:
    draft = draft_catalog(write(tmp_path / f"{stem}.gpkg", {"a": [1, 2]}))
    assert f'class = "{name}"  # EDIT: unknown' in draft
    assert load(draft, tmp_path).layers[0].class_name == name


def test_new_class_has_an_unused_code_and_symbol(tmp_path: Path) -> None:
    def drafted(file: str, name: str) -> ObjectClass:
        path = write(tmp_path / file, {"a": [1]})
        return load(draft_catalog(path), tmp_path).taxonomy.by_name(name)

    shipped = built_in_taxonomy()
    assert drafted("horodateurs.gpkg", "parking_meter") == shipped.by_name("parking_meter")
    assert drafted("defibrillateurs.gpkg", "defibrillator") == shipped.by_name("defibrillator")
    own = drafted("stuff.gpkg", "stuff")
    assert own.code == OWN_CODES
    assert own.symbol not in {item.symbol for item in shipped.classes}


def test_every_layer_with_geometry_is_drafted(
    tmp_path: Path, snapshot: Callable[[str, str], None]
) -> None:
    file = tmp_path / "town.gpkg"
    x, y = 770_000, 6_280_000
    square, line = shapely.box(x, y, x + 1, y + 1), shapely.LineString([(x, y), (x + 1, y + 1)])
    shapes = {"Arbres": line.centroid, "arbres!": line.centroid, "batiments": square, "rues": line}
    for layer, shape in shapes.items():
        gpd.GeoDataFrame({"a": [1]}, geometry=[shape], crs="EPSG:2154").to_file(file, layer=layer)
    pyogrio.write_dataframe(pd.DataFrame({"text": ["x"]}), file, layer="legend", append=True)
    check(file, snapshot)


def test_layer_without_rows_does_not_prevent_a_draft(tmp_path: Path) -> None:
    file = tmp_path / "town.gpkg"
    table = gpd.GeoDataFrame({"a": [1]}, geometry=[shapely.Point(4.8, 45.7)], crs="EPSG:4326")
    for name, rows in (("closed", 0), ("trees", 1)):
        table.head(rows).to_file(file, layer=name, geometry_type="Point")
    assert 'layer = "trees"' in draft_catalog(file)


def test_unusual_names_and_values_are_quoted(tmp_path: Path) -> None:
    file = write(
        tmp_path / 'arbres [2] "x" # ü.geojson',
        {
            'a "quoted" # field': ["x\ny", 'q"q', "\x7f"] * 4,
            "etat\n[[layers]]": ["]", "# [", "\\"] * 4,
            "statut": [True, False, True] * 4,
            "classe": ["/.*/", "a", "b"] * 4,
        },
    )
    draft = draft_catalog(file)
    offered = [line for line in draft.splitlines() if line.startswith("# where")]
    assert len(offered) == 4
    assert r'"//\\.\\*//"' in draft  # the pattern of a value that looks like one
    for line in ("", *offered):
        (layer,) = read(draft.replace(line, OFFERED.sub("", line)), file, tmp_path)
        assert layer.spec.name == "arbres_2_x_u"
        assert (layer.counts.read, layer.counts.filtered) == (12, 0), line


NOWHERE = b"""{"type": "FeatureCollection", "features": [
    {"type": "Feature", "properties": {"a": 1}, "geometry": null}]}"""


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("town.osm.pbf", b"x", ("OpenStreetMap", "'openstreetmap'")),
        ("town.osm", b"<osm/>", ("OpenStreetMap", "'openstreetmap'")),
        ("town.csv", b"x;y\n770000;6280000\n", ("(770000, 6280000)", "--crs EPSG:2154")),
        ("town.csv", b"x;y\n;\n", ("no layer with positions",)),
        ("town.geojson", NOWHERE, ("town.geojson has no layer with positions",)),
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
def test_file_that_cannot_be_drafted_is_refused(
    tmp_path: Path, name: str, content: bytes | None, words: tuple[str, ...]
) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with refused((CrsError, SourceError), *words):
        draft_catalog(tmp_path / name)


STEMS = ("bancs", "stuff", "arbres & bancs", "日本 [1]", "Batiments", "rues", "2024", "a'b;c")
AXES = (
    *(("lon", "lat"), ("X", "Y"), ("Coord_X", "Coord_Y"), ("lon_wgs84", "lat_wgs84")),
    *(("Long", "Lat"), ("Längengrad", "Breitengrad"), ("wkt", ""), ("geo_point_2d", "")),
)
TEXTS = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=8)
VALUES = st.none() | st.booleans() | st.integers() | st.floats() | TEXTS
CENTRES = st.tuples(st.floats(-170, 170), st.floats(-70, 70))
OFFSETS = st.lists(st.tuples(st.integers(0, 99), st.integers(0, 99)), min_size=1, max_size=6)


def near(centre: tuple[float, float], offset: tuple[int, int]) -> tuple[float, float]:
    """Return a place within some hundred metres."""
    lon, lat = (round(value + 1e-5 * step, 6) for value, step in zip(centre, offset, strict=True))
    return lon, lat


@st.composite
def csv_files(draw: st.DrawFn) -> bytes:
    """Draw a table of places in one of many styles, with some unusable rows."""
    separator = draw(st.sampled_from(";,\t"))
    comma = draw(st.booleans()) and separator != ","
    names = draw(st.lists(TEXTS | st.sampled_from(["id", "type", "Nom"]), max_size=3))
    x, y = draw(st.sampled_from(AXES))
    centre = draw(CENTRES)
    rows = []
    for offset in draw(OFFSETS):
        lon, lat = near(centre, offset)
        place = {"wkt": f"POINT ({lon} {lat})", "geo_point_2d": f"{lat}, {lon}"}.get(x)
        styled = [f"{lon:.6f}", f"{lat:.6f}"]
        if comma:
            styled = [text.replace(".", ",") for text in styled]
        rows.append([*(str(draw(VALUES)) for _ in names), *(styled if place is None else [place])])
    if draw(st.booleans()):
        rows.append(["?"] * len(rows[0]))
    text = io.StringIO()
    writer = csv.writer(text, delimiter=separator)
    writer.writerow([*names, *filter(None, (x, y))])
    writer.writerows(rows)
    return text.getvalue().encode(draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16"])))


@st.composite
def geojson_files(draw: st.DrawFn) -> bytes:
    """Draw features of all kinds, some without geometry."""
    centre = draw(CENTRES)
    fields = draw(st.lists(TEXTS.filter(bool), max_size=3, unique=True))
    features: list[dict[str, object]] = []
    for offset in draw(OFFSETS):
        point = shapely.Point(near(centre, offset))
        line = shapely.LineString([point.coords[0], (point.x + 1e-4, point.y + 1e-4)])
        kinds = [point, line, line.envelope, shapely.MultiPoint([point]), None]
        shape = draw(st.sampled_from(kinds)) if features else point
        geometry = shape and json.loads(shapely.to_geojson(shape))
        # Within 64 bits: GDAL refuses files with larger numbers.
        numbers = st.lists(st.integers(-(2**63), 2**63 - 1))
        values = st.none() | st.booleans() | st.integers(-9, 9) | TEXTS | numbers
        properties = {field: draw(values) for field in fields}
        features.append({"type": "Feature", "properties": properties, "geometry": geometry})
    return json.dumps({"type": "FeatureCollection", "features": features}).encode()


@pytest.mark.parametrize(
    ("suffix", "files"), [(".csv", csv_files()), (".geojson", geojson_files())]
)
def test_every_file_loads_with_its_draft(
    suffix: str, files: st.SearchStrategy[bytes], tmp_path: Path
) -> None:
    @settings(max_examples=8, deadline=None)
    @given(st.sampled_from(STEMS), files)
    def loads(stem: str, content: bytes) -> None:
        file = tmp_path / f"{stem}{suffix}"
        file.write_bytes(content)
        catalog = load(draft_catalog(file), tmp_path)
        layers, absent = read_files(catalog.layers, [file])
        assert not absent
        if layers[0].spec.role == "objects":
            assert len(assemble(layers, catalog).objects.table) >= 1

    loads()


@pytest.mark.parametrize(
    ("name", "kind", "shape", "line"),
    [
        ("trees", "Point", "<gml:pos>391000 5820000</gml:pos>", 'geometry = "point"'),
        ("streets", "LineString", "<gml:posList>0 0 9 9</gml:posList>", 'role = "streets"'),
    ],
)
def test_gml_is_read_with_its_draft(
    tmp_path: Path, name: str, kind: str, shape: str, line: str
) -> None:
    place = f'<gml:{kind} srsName="urn:ogc:def:crs:EPSG::25833">{shape}</gml:{kind}>'
    member = f"<wfs:member><a><n>7</n><geom>{place}</geom></a></wfs:member>"
    file = tmp_path / f"{name}.gml"
    file.write_text(
        '<wfs:FeatureCollection xmlns:wfs="http://www.opengis.net/wfs/2.0" '
        f'xmlns:gml="http://www.opengis.net/gml/3.2">{member * 3}</wfs:FeatureCollection>'
    )
    text = draft_catalog(file)
    assert line in text
    assert 'metric_crs = "EPSG:25833"' in text
    (layer,), absent = read_files(load(text, tmp_path).layers, [file])
    assert (len(layer.table), absent) == (3, ())


@pytest.mark.parametrize("folder", ["montpellier", "paris"])
def test_published_files_are_read_with_their_drafts(
    geodata: Path, tmp_path: Path, folder: str, snapshot: Callable[[str, str], None]
) -> None:
    guesses = []
    for file in sorted((geodata / folder).iterdir()):
        if file.suffix == ".txt":
            continue
        draft = draft_catalog(file, crs="EPSG:2154" if folder == "montpellier" else None)
        (stanza,) = tomllib.loads(draft)["layers"]
        guesses.append(f"{file.name}: {stanza.get('class', stanza.get('role'))}\n")
        (layer,) = read(draft, file, tmp_path)
        assert layer.counts.unreadable == 0
        assert len(layer.table) == layer.counts.read > 0
        assert layer.spec.rows is not None
        assert layer.spec.rows[0] <= layer.counts.read <= layer.spec.rows[1]
        if layer.spec.id_field is not None:
            assert layer.table["source_id"].is_unique, file.name
    snapshot(f"{folder}.txt", "".join(guesses))


def test_filters_of_the_montpellier_catalogue_are_offered(geodata: Path) -> None:
    for name, field, value in (
        ("FontainesPublic", "ETAT", "en fonction"),
        ("EclairagePublic", "type_lante", "Lanterne"),  # occurs once, near row 29,000
        ("ParkingOuv", "TYPARK_C_2", "Superstructure"),
        ("PlacesReserv", "F01_TYPE_D", "Livraison"),
    ):
        draft = draft_catalog(geodata / "montpellier" / f"VilleMTP_MTP_{name}.zip")
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
def test_names_are_split_into_words(text: str, words: tuple[str, ...]) -> None:
    assert words_of(text) == words


@given(st.text(max_size=40))
def test_splitting_words_again_changes_nothing(text: str) -> None:
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
def test_classes_are_recognised_in_layer_names(classes: str) -> None:
    for name in NAMES[classes]:
        assert [match.name for match in keywords("classes").find(name)] == classes.split(), name


# Names of layers, with the class that is guessed, and whether it is asked about.
GUESSES = {
    "street_cabinet": [
        *("Traffic-signal cabinets", "TrafficSignalCabinets", "cabinets of traffic signals"),
        *("armoires de feux tricolores", "armarios de semáforos", "street_cabinets"),
    ],
    "alignment_tree": [
        "school trees",
        "tree_locations_2021",
        "les arbres",
        "liste des arbres",
        "Baumstandorte",
    ],
    "alignment_tree?": ["tree pits", "tree guards", "Baumscheiben", "grilles d'arbres"],
    "": [
        "bench mark",
        "Benchmarks",
        "water meters",
        "taxiways",
        "Baumschule",
        "tree house",
        "bancs de sable",
    ],
    "street_light": ["Lichtmasten", "Straßenbeleuchtung", "streetlights 2020", "EclairagePublic"],
    "street_light?": ["lamp post banners", "street light complaints", "Street_Light_Outages"],
    "bus_stop?": ["bus stop flags", "bus_stop_shelters"],
    "parking_meter?": ["parking meter transactions", "requests for parking meters"],
    "fire_hydrant?": ["fire hydrant inspections", "Hydrants and valves"],
    "monument": ["Monuments and memorials"],
    "bicycle_stand?": ["bike rack requests"],
    "tram_stop": ["light rail stops"],
    "traffic_light?": ["signal boxes", "traffic signal boxes", "Ampelschaltschränke"],
    "manhole?": ["manhole covers", "manholes"],
    "defibrillator": ["AEDs"],
    "playground?": ["playgrounds"],
}


@pytest.mark.parametrize("expected", GUESSES)
def test_a_name_is_what_its_head_says_or_is_asked_about(expected: str) -> None:
    for name in GUESSES[expected]:
        guess = guess_class(name, [], geometry="point", rows=4)
        mark = "" if guess.sure or not guess.name else "?"
        assert f"{guess.name}{mark}" == expected, name


def test_a_role_is_asked_about_if_another_word_follows() -> None:
    sure = guess_class("buildings", [], geometry="polygon", rows=4)
    guess = guess_class("building permits", [], geometry="polygon", rows=4)
    assert (sure.name, sure.sure) == ("buildings", True)
    assert (guess.name, guess.sure) == ("buildings", False)
    assert '"permits"' in guess.reason


def test_longest_keyword_wins_over_its_parts() -> None:
    own = Keywords.of([("sign", "light"), ("lamp", "street light"), ("lamp", "lamp")])
    assert own.find("Street_Lights") == (Match("lamp", "street lights", 11),)
    assert [item.name for item in own.find("light and street light")] == ["lamp", "sign"]
    assert own.find("streetlight") == (Match("lamp", "streetlight", 11),)


def test_every_class_is_recognised_by_its_keywords() -> None:
    for name, phrase in keywords("classes").phrases:
        assert phrase, name
        matches = keywords("classes").find(" ".join(phrase))
        assert name in {match.name for match in matches}, phrase


def test_keywords_have_all_classes_of_the_catalogues() -> None:
    assert "keywords" not in catalog_names()
    names = {name for name, _ in keywords("classes").phrases}
    assert {item.name for item in paper_taxonomy().classes} <= names
    for catalog in catalog_names():
        own = {item.name for item in load_catalog(catalog).taxonomy.classes}
        # The name itself, and what people say.
        assert all(len(words_for(name)) > 1 for name in own), catalog
    assert {name for name, _ in keywords("class_fields").phrases} <= names


def sample(*rows: dict[str, Any]) -> LayerSample:
    fields = tuple(dict.fromkeys(name for row in rows for name in row))
    return LayerSample("opendatasoft", LayerInfo("x", "Point", None, len(rows), fields), rows)


def column(name: str, *values: object) -> Column:
    (result,) = columns_of(sample(*({name: value} for value in values)))
    return result


def test_only_fields_of_plain_values_become_columns() -> None:
    rows = sample(
        {"a": 1, "b": {"lon": 1}, "c": "x", "d": None, "e": b"wkb"},
        {"a": None, "b": None, "c": "", "d": None, "e": None},
    )
    columns = columns_of(rows)
    assert [(item.name, dict(item.counts), item.missing) for item in columns] == [
        ("a", {1: 1}, 1),
        ("c", {"x": 1}, 1),
        ("d", {}, 2),
    ]


@pytest.mark.parametrize(
    ("values", "kinds"),
    [
        ((), []),
        (("a",), ["unique"]),
        (("a", "b"), ["unique"]),
        (("a", "b", None), []),
        (("a", "a", "b", "b"), ["few"]),
        (("a", "a", "a", "a"), []),
        ((True, False, True, True), ["few"]),
        ((1, 2, 1, 2), []),
        (("1", "2", "1", "2"), []),
        (("2019-01-02T10:00", "b", "b", "b"), []),
        (("x" * 61, "b", "b", "b"), []),
        (("a", "b", "a", "b", *[None] * 40), []),
        (tuple("abcdefghijklm" * 3), []),
    ],
)
def test_identifiers_and_filters_are_distinguished(
    values: tuple[object, ...], kinds: list[str]
) -> None:
    counts = Counter(value for value in values if value is not None)
    field = Column("x", counts, len(values) - counts.total())
    assert [kind for kind in ("unique", "few") if getattr(field, kind)] == kinds


@pytest.mark.parametrize(
    ("purpose", "names"),
    [
        (["filter"], ["TYPE_D_OPÉ", "Kind"]),
        (["identifier"], ["IDBASE", "cod_ouvrag"]),
        (["row_number"], ["OBJECTID_1"]),
        ([], ["N° Voie", "LONGUEUR", "latin"]),
    ],
)
def test_purpose_of_a_field_is_recognised_by_its_name(purpose: list[str], names: list[str]) -> None:
    purposes = ("filter", "identifier", "row_number")
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
def test_class_is_guessed_by_name_then_values_then_fields(
    names: str, geometry: str | None, columns: list[Column], expected: tuple[str, bool, bool]
) -> None:
    guess = guess_class(names, columns, geometry=geometry, rows=4)
    assert (guess.name, guess.is_role, guess.sure) == expected
    assert guess.others == (("bench",) if guess.name == "waste_basket" else ())
    assert ("amenity = bench" in guess.reason) == (guess.name == "bench")
    assert ("the field espece" in guess.reason) == (guess.name == "alignment_tree")


def test_field_with_values_of_other_classes_is_found() -> None:
    classes = {"Taxi": "taxi_station", "Livraison": "reserved_bay", "GIG/GIC": "disabled_bay"}
    kind = column("kind", *["Taxi", "Livraison", "GIG/GIC", "Autre"] * 3)
    assert guess_class_by([kind], "reserved_bay") == ("kind", classes)
    assert guess_class_by([column("kind", *["Taxi", "Autre"] * 3)], "taxi_station") is None
    assert guess_class_by([column("kind", "Taxi", "Bench")], "") is None  # each seen once


CUSTOM_CRS = "+proj=laea +lat_0=43.6 +lon_0=3.88 +datum=WGS84 +units=m"


@pytest.mark.parametrize(
    ("suffix", "crs"),
    [
        (".gpkg", "EPSG:5698"),  # compound: with heights
        (".gpkg", "EPSG:32631+5773"),
        (".parquet", "EPSG:32631+5773"),
        (".shp", "EPSG:4979"),
        (".gpkg", "ESRI:102110"),
        (".gpkg", "ESRI:54009"),
        (".gpkg", CUSTOM_CRS),
        (".parquet", CUSTOM_CRS),
        (".gpkg", "OGC:CRS84"),
    ],
)
def test_draft_of_a_file_in_any_crs_loads(suffix: str, crs: str, tmp_path: Path) -> None:
    places = gpd.GeoSeries.from_xy([3.88, 3.881], [43.61, 43.611], crs="EPSG:4326")
    places = places.to_crs(CRS(crs).to_2d()).set_crs(crs, allow_override=True)
    frame = gpd.GeoDataFrame({"ref": ["a", "b"]}, geometry=places)
    file = tmp_path / f"benches{suffix}"
    frame.to_parquet(file) if suffix == ".parquet" else frame.to_file(file)
    text = draft_catalog(file)
    assert "$schema" not in text
    (tmp_path / "draft.toml").write_text(text, encoding="utf-8")
    objects = load_objects(file, catalog=tmp_path / "draft.toml").objects
    lonlat = transform_points(objects.xy, objects.crs, CRS(4326))
    assert np.allclose(lonlat, [[3.88, 43.61], [3.881, 43.611]], atol=1e-7)
