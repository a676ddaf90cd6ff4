"""The command line as its user meets it: results, exit codes and plain sentences."""

from __future__ import annotations

import io
import json
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import fiona
import geopandas as gpd
import pytest
import shapely
from osm_xml import node, way, write_osm
from sentences import sentence
from servers import Answer, Server

from semsig_gis import __version__
from semsig_gis.cli import main
from semsig_gis.database.file import open_database

if TYPE_CHECKING:
    from conftest import Done, Run

CATALOG = """
name = "tiny"
title = "A tiny city"
url = "https://example.org"
license = "CC0-1.0"
attribution = "Nobody"
metric_crs = "EPSG:2154"

[[classes]]
code = 12
symbol = "X"
name = "crossing"
title = "Crossing"

[[layers]]
name = "lights"
class = "street_light"
files = ["lights.*"]
crs = "EPSG:2154"

[[layers]]
name = "crossings"
class = "crossing"
files = ["crossings.geojson"]
where = { state = "painted" }
"""


LOAD = "load . --catalog tiny.toml --out o.parquet"


def write_layer(path: Path, points: list[tuple[float, float]], **columns: list[Any]) -> None:
    gpd.GeoDataFrame(columns, geometry=shapely.points(points), crs=2154).to_file(path)


@pytest.fixture(scope="module")
def saved_city(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a catalogue, two layers, and what the commands make of them."""
    folder = tmp_path_factory.mktemp("city")
    (folder / "tiny.toml").write_text(CATALOG, encoding="utf-8")
    lights = [(770000.0 + 23 * i, 6280000.0 + 31 * (i % 3)) for i in range(20)]
    write_layer(folder / "lights.gpkg", [*lights, lights[0]], kind=["a"] * 21)
    crossings = shapely.points([(770010.0, 6280010.0), (770100.0, 6280010.0)])
    table = gpd.GeoDataFrame({"state": ["painted", "worn"]}, geometry=crossings, crs=2154)
    table.to_crs(4326).to_file(folder / "crossings.geojson")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for line in (
            "load . --catalog tiny.toml --out objects.parquet",
            "build objects.parquet --out city.parquet",
        ):
            patch.setattr(sys, "argv", ["semsig", *line.split()])
            with pytest.raises(SystemExit, match=r"^0$"):
                main()
    half = (folder / "city.parquet").read_bytes()
    (folder / "half.parquet").write_bytes(half[: len(half) // 2])
    return folder


@pytest.fixture
def city(saved_city: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a copy of the folder, which the command runs in."""
    shutil.copytree(saved_city, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def text(name: str) -> str:
    return Path(name).read_text(encoding="utf-8")


# --- Results ----------------------------------------------------------------------------------


@pytest.mark.usefixtures("city")
def test_the_road_from_files_to_a_place(done: Done) -> None:
    report = json.loads(done(LOAD, "--json"))
    lights, crossings = report["sources"]
    assert report["objects"] == 21
    assert (lights["read"], lights["collapsed"], lights["objects"]) == (21, 1, 20)
    assert (crossings["read"], crossings["filtered"], crossings["objects"]) == (2, 1, 1)
    out = done(LOAD)
    assert "per km² of hull" in out
    assert "Nobody (CC0-1.0): lights, crossings" in out
    assert "cells of mean length" in done("build o.parquet --out c.parquet")
    assert "Nobody (CC0-1.0)" in str(json.loads(done("info c.parquet --json")))
    out = done("info c.parquet")
    assert "Street light (D)" in out
    assert "Nobody (CC0-1.0): lights, crossings" in out

    query = "localize c.parquet --types DX --bearings 200,20"
    answer = json.loads(done(query, "--top", 3, "--json"))
    assert answer["query"]["types"] == "XD"
    assert len(answer["candidates"]) == 3
    best = answer["candidates"][0]
    # The only crossing stands at x = 770010, y = 6280010.
    assert max(abs(best["x"] - 770010), abs(best["y"] - 6280010)) <= 30
    assert "rank" in done(query, "--map", "query.html")
    assert "leaflet" in text("query.html").lower()


@pytest.mark.usefixtures("city")
def test_evaluate_map_and_export(done: Done) -> None:
    line = "evaluate city.parquet --queries 30 --distortion light --seed 5 --method edit+edit:20%"
    summary = json.loads(done(line, "--out", "eval", "--json"))
    assert summary["settings"]["queries"] == 30
    assert summary["settings"]["method"] == "edit+edit:20%"
    assert summary.pop("timing")["seconds_per_query"] > 0
    assert json.loads(text("eval/evaluation.json")) == summary
    assert "recall" in done(line)
    assert "map.html" in done("map city.parquet --evaluation eval --out map.html")
    assert Path("map.html").stat().st_size > 1000

    done("export city.parquet --objects objects.parquet --out city.gpkg")
    assert set(fiona.listlayers("city.gpkg")) >= {"cells", "objects"}
    assert set(gpd.read_file("city.gpkg", layer="cells").geom_type) == {"Polygon"}
    done("export city.parquet --geometry point --out points.gpkg")
    assert set(gpd.read_file("points.gpkg", layer="cells").geom_type) == {"Point"}


@pytest.mark.usefixtures("city")
def test_switches_keep_what_filters_and_collapsing_take(done: Done) -> None:
    line = f"{LOAD} --no-filter --no-collapse --json"
    assert json.loads(done(line))["objects"] == 23
    assert json.loads(done(line, "--layer", "crossings"))["objects"] == 2


def test_a_layer_without_a_file_is_named_and_left_out(city: Path, run: Run) -> None:
    (city / "crossings.geojson").unlink()
    code, _, err = run(LOAD)
    assert (code, "layer 'crossings' has no file here" in err) == (0, True)


@pytest.mark.usefixtures("city")
def test_origin_moves_the_grid(done: Done) -> None:
    done("build objects.parquet --origin 5,5 --out moved.parquet")
    assert set(gpd.read_parquet("moved.parquet").geometry.x % 10) == {0.0}
    assert set(gpd.read_parquet("city.parquet").geometry.x % 10) == {5.0}


@pytest.mark.usefixtures("city")
def test_sources(done: Done) -> None:
    listed = json.loads(done("sources --json"))
    names = {item["name"] for item in listed["catalogs"]}
    assert names >= {"montpellier", "opendata_paris", "openstreetmap"}
    assert "osm_file" in listed["readers"]
    for line, words in {
        "sources": ("montpellier",),
        "sources openstreetmap": ("highway=street_lamp", "fire_hydrants (optional)"),
        "sources opendata_paris": ("les-arbres",),
        "sources montpellier": ("ETAT = en fonction", "taxi_station"),
        "sources tiny.toml --json": ('"title": "A tiny city"',),
        "suggest lights.gpkg": ("[[layers]]", 'files = ["lights.gpkg"]'),
    }.items():
        out = done(line)
        assert all(word in out for word in words), line


def test_two_catalogues_are_loaded_and_merged(city: Path, done: Done) -> None:
    (city / "survey.toml").write_text(
        'name = "survey"\ntitle = "Survey"\n'
        '[[layers]]\nname = "lamps"\nclass = "street_light"\nfiles = ["survey.gpkg"]\n'
        "[conflate]\nstreet_light = 2\n",
        encoding="utf-8",
    )
    write_layer(city / "survey.gpkg", [(770001.0, 6280000.0), (771000.0, 6280000.0)])
    report = json.loads(done(f"{LOAD} --catalog survey.toml --json"))
    assert report["objects"] == 22
    assert [(item["count"], item["kept"]) for item in report["conflated"]] == [(1, "tiny/lights")]
    assert json.loads(done(f"{LOAD} --catalog survey.toml --no-merge --json"))["objects"] == 23


def test_openstreetmap_with_its_surroundings(city: Path, run: Run, done: Done) -> None:
    write_osm(
        city / "town.osm",
        node(1, 7.42, 43.73, {"amenity": "bench"}),
        node(2, 7.42, 43.74),
        node(3, 7.43, 43.74),
        way(8, [1, 2], {"highway": "residential"}),
        way(9, [1, 2, 3, 1], {"building": "yes"}),
    )
    surroundings = "--out o.parquet --buildings b.parquet --streets s.parquet"
    assert "EPSG:32632" in done(f"load town.osm --catalog openstreetmap {surroundings}")
    assert list(gpd.read_parquet("b.parquet").geom_type) == ["Polygon"]
    assert list(gpd.read_parquet("s.parquet").geom_type) == ["LineString"]
    code, _, err = run(LOAD, "--buildings", "none.parquet")
    assert code == 0
    assert "no buildings in what was loaded, so none.parquet is not written" in err
    assert not (city / "none.parquet").exists()


def test_fetch_from_a_portal_and_again_without_it(city: Path, run: Run) -> None:
    datasets = "/api/explore/v2.1/catalog/datasets/benches"
    point = {"type": "Point", "coordinates": [2.35, 48.85]}
    feature = {"type": "Feature", "geometry": point, "properties": {"id": 1}}
    export = {"type": "FeatureCollection", "features": [feature]}
    fields = {"fields": [{"name": "id", "type": "int"}, {"name": "shape", "type": "geo_shape"}]}
    fetch = "fetch portal.toml --cache cache --out o.parquet --json --area"
    with Server() as server:
        server.on(datasets, Answer(json.dumps(fields).encode()))
        geojson = Answer(json.dumps(export).encode(), type="application/geo+json")
        server.on(f"{datasets}/exports/geojson", geojson)
        (city / "portal.toml").write_text(
            'name = "portal"\ntitle = "Portal"\nreader = "opendatasoft"\n'
            f'endpoints = ["{server.url}"]\nmetric_crs = "EPSG:2154"\n'
            '[[layers]]\nname = "benches"\nclass = "bench"\n'
            'dataset = "benches"\nfiles = ["benches.geojson"]\n',
            encoding="utf-8",
        )
        code, out, err = run(fetch, "2,48,3,49")
        assert code == 0, err
        assert json.loads(out)["objects"] == 1
        assert "benches: 1 rows, 0.00 MB, from the portal, fetched 20" in err
        sentence(run(fetch, "Paris"), "'Paris'", "polygon file")
        sentence(run(fetch, "2,48,3"), "2,48,3")
    code, out, err = run(fetch, "2,48,3,49", "--offline")
    assert (code, "from the cache" in err, json.loads(out)["objects"]) == (0, True, 1)
    sentence(run(fetch, "5,48,6,49", "--offline"), "127.0.0.1")


def test_demo(tmp_path: Path, done: Done) -> None:
    out = done("demo --queries 5 --out", tmp_path / "demo")
    for name in ("map.html", "city.gpkg", "city.parquet"):
        assert name in out
        assert (tmp_path / "demo" / name).stat().st_size > 0


def test_version_and_help_start_without_the_gis_stack() -> None:
    code = (
        "import sys; sys.argv = ['semsig', '--version']\n"
        "from semsig_gis.cli import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "print(sorted({'geopandas', 'numpy', 'folium', 'pandas'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [f"semsig {__version__}", "[]"]


def test_the_console_script_is_installed() -> None:
    script = shutil.which("semsig", path=Path(sys.executable).parent)
    if script is None:
        pytest.skip("the package is not installed in this environment")
    done = subprocess.run([script, "--version"], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == f"semsig {__version__}"


@pytest.mark.usefixtures("city")
def test_the_likelihood_is_evaluated_and_drawn(run: Run, done: Done) -> None:
    line = "evaluate city.parquet --queries 20 --method likelihood --noise light"
    summary = json.loads(done(line, "--out", "eval", "--json"))
    assert summary["settings"]["method"] == "likelihood:light:on_grid"
    assert 0 <= summary["results"]["coverage"] <= 1
    code, out, err = run(line)
    assert (code, "Answered" in out) == (0, True)
    assert "index" not in err  # it is kept beside the database
    done("map city.parquet --evaluation eval --out map.html")
    assert "likelihood:light:on_grid" in text("map.html")


def test_many_queries_are_answered_line_by_line(
    city: Path, done: Done, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines = '{"id": "a", "types": "DD"}\n{"types": "?D", "bearings": [10, 200]}\n'
    (city / "queries.jsonl").write_text(lines)
    for method in ("edit+edit", "likelihood"):
        out = done("localize city.parquet --queries queries.jsonl --method", method)
        answers = [json.loads(line) for line in out.splitlines()]
        assert [answer["id"] for answer in answers] == ["a", 2]
        assert all(answer["candidates"] for answer in answers)
    monkeypatch.setattr("sys.stdin", io.StringIO(lines))
    assert len(done("localize city.parquet --queries - --require 2D").splitlines()) == 2


def test_buildings_streets_and_an_area_narrow_what_is_built(
    city: Path, run: Run, done: Done
) -> None:
    square = shapely.box(770_000, 6_280_005, 770_400, 6_280_025)
    street = shapely.LineString([(770_000, 6_280_000), (770_400, 6_280_000)])
    bow = shapely.Polygon(
        [(770_000, 6_280_000), (770_050, 6_280_050), (770_050, 6_280_000), (770_000, 6_280_050)]
    )
    gpd.GeoDataFrame(geometry=[square], crs=2154).to_file("houses.gpkg")
    gpd.GeoDataFrame(geometry=[square.buffer(60)], crs=2154).to_crs(4326).to_parquet("area.parquet")
    gpd.GeoDataFrame(geometry=[street], crs=2154).to_crs(4326).to_file("streets.geojson")
    gpd.GeoDataFrame(geometry=[bow], crs=2154).to_parquet("bow.parquet")
    build = "build objects.parquet --out narrow.parquet"
    cells, seen = {}, {}
    for name, options in {
        "all": "",
        "buildings": "--buildings houses.gpkg",
        "outdoor": "--buildings houses.gpkg --viewpoints outdoor",
        "streets": "--streets streets.geojson --viewpoints streets",
        "wide": "--streets streets.geojson --viewpoints streets --street-width 40",
        "area": "--area area.parquet",
    }.items():
        assert "cells of mean length" in done(f"{build} {options}")
        database = open_database("narrow.parquet")
        cells[name], seen[name] = len(database), int(database.lengths.sum())
    assert cells["outdoor"] < cells["buildings"] <= cells["all"]
    assert seen["buildings"] < seen["all"]
    assert cells["streets"] < cells["wide"] < cells["all"]
    assert cells["area"] <= cells["all"]
    code, _, err = run(build, "--buildings", city / "bow.parquet")
    assert code == 0
    assert "1 building footprints in" in err
    assert "repaired" in err


# --- Refusals ---------------------------------------------------------------------------------

CITY = "city.parquet"
# A command line, and words that its sentence contains.
REFUSED = [
    # files
    ("load nowhere.shp --catalog tiny.toml --out o.parquet", "nowhere.shp does not exist"),
    ("build no.parquet --out c.parquet", "does not exist"),
    ("info no.parquet", "no.parquet does not exist"),
    ("suggest none.shp", "none.shp"),
    ("load . --catalog no.toml --out o.parquet", "no.toml"),
    ("load . --catalog montpelier --out o.parquet", "the nearest is 'montpellier'"),
    (f"{LOAD} --layer light", "'light'", "nearest is 'lights'"),
    ("fetch montpellier --area 3,43,4,44 --out o.parquet", "semsig load"),
    ("info half.parquet", "half.parquet is damaged"),
    ("localize half.parquet --types D", "half.parquet is damaged"),
    ("evaluate half.parquet", "half.parquet is damaged"),
    ("export half.parquet --out h.gpkg", "half.parquet is damaged"),
    # each kind of file is told from the other
    ("info objects.parquet", "is a street objects file"),
    (f"build {CITY} --out half.parquet", "is a signature database file"),
    ("build objects.parquet --out tiny.toml/x.parquet", "cannot be written"),
    ("build objects.parquet --out .", "is a folder"),
    (f"export {CITY} --out cells.txt", ".gpkg"),
    # settings
    (f"build objects.parquet --step 5000 --radius 1 --out {CITY}", "no cell sees"),
    (f"build objects.parquet --radius=0 --out {CITY}", "visibility range"),
    (f"build objects.parquet --radius=-5 --out {CITY}", "visibility range"),
    (f"build objects.parquet --radius=nan --out {CITY}", "visibility range"),
    (f"evaluate {CITY} --queries 1000000", "queries"),
    (f"evaluate {CITY} --distortion mild", "'mild'"),
    (f"evaluate {CITY} --noise light", "--noise", "likelihood", "'edit+edit'"),
    (f"evaluate {CITY} --method likelihood --noise loud", "'loud'"),
    # queries
    (f"localize {CITY}", "types"),
    (f"localize {CITY} --types=", "without objects"),
    (f"localize {CITY} --types DQ", "'Q'", "D street light"),
    (f"localize {CITY} --types DB", "alignment tree", "B"),  # a class that the city lacks
    (f"localize {CITY} --types DD --bearings 10,20,30", "2 types and 3 bearings"),
    (f"localize {CITY} --types D --bearings ten", "'ten'"),
    (f"localize {CITY} --types D --bearings nan", "nan"),
    (f"localize {CITY} --types D --method edti+edit", "'edti'", "'edit'"),
    (f"localize {CITY} --types D --method angles:edit", "bearings"),
    (f"localize {CITY} --types D --top 0", ""),
    (f"localize {CITY} --queries x.csv --types D", "--queries"),
    (f"localize {CITY} --queries x.csv", "x.csv", "cannot be read"),
    # surroundings
    *(
        (f"build objects.parquet --out narrow.parquet {options}", *words)
        for options, *words in (
            ("--buildings nowhere.gpkg", "nowhere.gpkg", "does not exist"),
            ("--buildings nowhere.parquet", "nowhere.parquet", "does not exist"),
            ("--buildings lights.gpkg", "lights.gpkg", "Point", "polygons"),
            ("--area lights.gpkg", "lights.gpkg", "Point", "polygons"),
            ("--streets lights.gpkg --viewpoints streets", "lines"),
            ("--viewpoints outdoor", "outdoor", "footprints"),
            ("--viewpoints streets", "streets", "centre lines"),
            ("--streets lights.gpkg", "--streets", "--viewpoints streets"),
        )
    ),
]


def contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("case", REFUSED, ids=lambda case: case[0])
def test_what_cannot_be_used_is_refused_and_changes_no_file(
    case: tuple[str, ...], saved_city: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(saved_city)
    before = contents(saved_city)
    sentence(run(case[0]), *case[1:])
    assert contents(saved_city) == before


def test_usage_errors_exit_2(run: Run) -> None:
    code, _, err = run("build")
    assert (code, "Traceback" in err) == (2, False)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('class = "street_light"', 'class = "streetlight"', ("streetlight", "'street_light'")),
        ('symbol = "X"', 'symbol = "D"', ("symbol 'D'", "street_light", "crossing")),
        ("code = 12", "code = 3", ("code 3",)),
        ("where =", "wehre =", ("'wehre'", "'where'")),
        ("attribution =", "atribution =", ("'atribution'", "'attribution'")),
        ('metric_crs = "EPSG:2154"', 'metric_crs = "EPSG:4326"', ("degrees",)),
        ('metric_crs = "EPSG:2154"', 'metric_crs = "EPSG:3857"', ("Mercator",)),
        ("state =", "stat =", ("'stat'", "'state'")),
        ('name = "tiny"', "name = tiny", ("TOML",)),
    ],
)
def test_a_bad_catalogue_is_refused(
    city: Path, run: Run, old: str, new: str, words: tuple[str, ...]
) -> None:
    assert old in CATALOG
    (city / "tiny.toml").write_text(CATALOG.replace(old, new), encoding="utf-8")
    sentence(run(LOAD), *words)


def test_nothing_that_the_filters_leave_is_refused(city: Path, run: Run) -> None:
    (city / "tiny.toml").write_text(CATALOG.replace("painted", "flooded"), encoding="utf-8")
    sentence(run(LOAD, "--layer", "crossings"), "no object remains")


def test_a_file_without_a_crs_needs_one(city: Path, run: Run, done: Done) -> None:
    bare = CATALOG.replace('crs = "EPSG:2154"\n\n[[layers]]', "\n[[layers]]")
    (city / "tiny.toml").write_text(bare, encoding="utf-8")
    (city / "lights.gpkg").unlink()
    schema = {"geometry": "Point", "properties": {"kind": "str"}}
    with fiona.open(city / "lights.shp", "w", driver="ESRI Shapefile", schema=schema) as layer:
        point = {"type": "Point", "coordinates": (770000.0, 6280000.0)}
        layer.write({"geometry": point, "properties": {"kind": "a"}})
    line = f"{LOAD} --layer lights"
    sentence(run(line), "lights.shp")
    done(line, "--crs", "EPSG:2154")
    sentence(run(line, "--crs", "EPSG:0"), "EPSG:0")


def test_a_damaged_zip_file_is_refused(city: Path, run: Run, done: Done) -> None:
    (city / "lights.gpkg").unlink()
    write_layer(city / "s.shp", [(770000.0 + i, 6280000.0) for i in range(500)], kind=["a"] * 500)
    with zipfile.ZipFile(city / "lights.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        for suffix in ("shp", "shx", "dbf", "prj"):
            archive.write(city / f"s.{suffix}", f"s.{suffix}")
    whole = (city / "lights.zip").read_bytes()
    done(LOAD, "--layer", "lights")
    for size in (len(whole) // 2, len(whole) - 10, 0):
        (city / "lights.zip").write_bytes(whole[:size])
        sentence(run(LOAD, "--layer", "lights"), "lights.zip")
