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


def write_layer(path: Path, points: list[tuple[float, float]], **columns: list[Any]) -> None:
    gpd.GeoDataFrame(columns, geometry=shapely.points(points), crs=2154).to_file(path)


@pytest.fixture
def city(tmp_path: Path) -> Path:
    """A folder with a catalogue, two layers, and what the commands make of them."""
    (tmp_path / "tiny.toml").write_text(CATALOG, encoding="utf-8")
    lights = [(770000.0 + 23 * i, 6280000.0 + 31 * (i % 3)) for i in range(20)]
    write_layer(tmp_path / "lights.gpkg", [*lights, lights[0]], kind=["a"] * 21)
    crossings = [(770010.0, 6280010.0), (770100.0, 6280010.0)]
    states = ["painted", "worn"]
    gpd.GeoDataFrame({"state": states}, geometry=shapely.points(crossings), crs=2154).to_crs(
        4326
    ).to_file(tmp_path / "crossings.geojson")
    return tmp_path


@pytest.fixture
def database(city: Path, done: Done) -> Path:
    objects, path = city / "objects.parquet", city / "city.parquet"
    done("load", city, "--catalog", city / "tiny.toml", "--out", objects)
    done("build", objects, "--out", path)
    return path


def test_the_road_from_files_to_a_place(city: Path, done: Done) -> None:
    objects, database = city / "objects.parquet", city / "city.parquet"
    out = done("load", city, "--catalog", city / "tiny.toml", "--out", objects, "--json")
    report = json.loads(out)
    assert report["objects"] == 21
    lights, crossings = report["sources"]
    assert (lights["read"], lights["collapsed"], lights["objects"]) == (21, 1, 20)
    assert (crossings["read"], crossings["filtered"], crossings["objects"]) == (2, 1, 1)
    out = done("load", city, "--catalog", city / "tiny.toml", "--out", objects)
    assert "per km² of hull" in out
    assert "Nobody (CC0-1.0): lights, crossings" in out

    out = done("build", objects, "--out", database)
    assert "cells of mean length" in out

    out = done("info", database, "--json")
    facts = json.loads(out)
    assert "Nobody (CC0-1.0)" in str(facts)

    out = done("info", database)
    assert "Street light (D)" in out
    assert "Nobody (CC0-1.0): lights, crossings" in out

    query = ("--types", "DX", "--bearings", "200,20")
    out = done("localize", database, *query, "--top", 3, "--json")
    result = json.loads(out)
    assert result["query"]["types"] == "XD"
    assert len(result["candidates"]) == 3
    best = result["candidates"][0]
    # The only crossing stands at x = 770010, y = 6280010.
    assert abs(best["x"] - 770010) <= 30
    assert abs(best["y"] - 6280010) <= 30

    out = done("localize", database, *query, "--map", city / "query.html")
    assert "rank" in out
    assert "leaflet" in (city / "query.html").read_text(encoding="utf-8").lower()


def test_evaluate_map_and_export(database: Path, city: Path, done: Done) -> None:
    options = ("--queries", 30, "--distortion", "light", "--seed", 5, "--method", "edit+edit:20%")
    out = done("evaluate", database, *options, "--out", city / "eval", "--json")
    summary = json.loads(out)
    assert summary["settings"]["queries"] == 30
    assert summary["settings"]["method"] == "edit+edit:20%"
    assert summary.pop("timing")["seconds_per_query"] > 0
    assert json.loads((city / "eval" / "evaluation.json").read_text(encoding="utf-8")) == summary

    out = done("evaluate", database, *options)
    assert "recall" in out

    out = done("map", database, "--evaluation", city / "eval", "--out", city / "map.html")
    assert "map.html" in out
    assert (city / "map.html").stat().st_size > 1000

    out = done(
        "export", database, "--objects", city / "objects.parquet", "--out", city / "city.gpkg"
    )
    assert set(fiona.listlayers(city / "city.gpkg")) >= {"cells", "objects"}
    assert set(gpd.read_file(city / "city.gpkg", layer="cells").geom_type) == {"Polygon"}

    done("export", database, "--geometry", "point", "--out", city / "points.gpkg")
    assert set(gpd.read_file(city / "points.gpkg", layer="cells").geom_type) == {"Point"}


def test_switches_keep_what_filters_and_collapsing_take(city: Path, done: Done) -> None:
    switches = ("--no-filter", "--no-collapse", "--json")
    options = ("--catalog", city / "tiny.toml", "--out", city / "all.parquet")
    assert json.loads(done("load", city, *options, *switches))["objects"] == 23
    one = done("load", city, *options, "--layer", "crossings", *switches)
    assert json.loads(one)["objects"] == 2


def test_a_layer_without_a_file_is_told_and_left_out(city: Path, run: Run) -> None:
    (city / "crossings.geojson").unlink()
    code, _, err = run("load", city, "--catalog", city / "tiny.toml", "--out", city / "o.parquet")
    assert code == 0
    assert "layer 'crossings' has no file here" in err


def test_origin_moves_the_grid(city: Path, database: Path, done: Done) -> None:
    moved = city / "moved.parquet"
    done("build", city / "objects.parquet", "--origin", "5,5", "--out", moved)
    x = gpd.read_parquet(moved).geometry.x
    assert set(x % 10) == {0.0}
    assert set(gpd.read_parquet(database).geometry.x % 10) == {5.0}


def test_sources(done: Done, city: Path) -> None:
    out = done("sources")
    assert "montpellier" in out
    listed = json.loads(done("sources", "--json"))
    assert {"montpellier", "opendata_paris", "openstreetmap"} <= {
        item["name"] for item in listed["catalogs"]
    }
    assert "osm_file" in listed["readers"]
    out = done("sources", "openstreetmap")
    assert "highway=street_lamp" in out
    assert "fire_hydrants (optional)" in out
    assert "les-arbres" in done("sources", "opendata_paris")
    out = done("sources", "montpellier")
    assert "ETAT = en fonction" in out
    assert "taxi_station" in out
    assert json.loads(done("sources", city / "tiny.toml", "--json"))["title"] == "A tiny city"


def test_a_draft_is_suggested_and_loads(city: Path, run: Run, done: Done) -> None:
    draft = done("suggest", city / "lights.gpkg")
    assert "[[layers]]" in draft
    assert 'files = ["lights.gpkg"]' in draft
    sentence(run("suggest", city / "none.shp"), "none.shp")


def test_two_catalogues_are_loaded_and_merged(city: Path, done: Done) -> None:
    (city / "osm.toml").write_text(
        """
name = "survey"
title = "Survey"
[[layers]]
name = "lamps"
class = "street_light"
files = ["survey.gpkg"]
[conflate]
street_light = 2
""",
        encoding="utf-8",
    )
    write_layer(city / "survey.gpkg", [(770001.0, 6280000.0), (771000.0, 6280000.0)])
    catalogs = ("--catalog", city / "tiny.toml", "--catalog", city / "osm.toml")
    out = done("load", city, *catalogs, "--out", city / "both.parquet", "--json")
    report = json.loads(out)
    assert report["objects"] == 22
    assert [item["count"] for item in report["conflated"]] == [1]
    assert report["conflated"][0]["kept"] == "tiny/lights"
    options = ("--no-merge", "--json", "--out", city / "apart.parquet")
    assert json.loads(done("load", city, *catalogs, *options))["objects"] == 23


def test_openstreetmap_with_its_surroundings(tmp_path: Path, done: Done) -> None:
    path = write_osm(
        tmp_path / "town.osm",
        node(1, 7.42, 43.73, {"amenity": "bench"}),
        node(2, 7.42, 43.74),
        node(3, 7.43, 43.74),
        way(8, [1, 2], {"highway": "residential"}),
        way(9, [1, 2, 3, 1], {"building": "yes"}),
    )
    surroundings = ("--buildings", tmp_path / "b.parquet", "--streets", tmp_path / "s.parquet")
    out = done(
        "load", path, "--catalog", "openstreetmap", "--out", tmp_path / "o.parquet", *surroundings
    )
    assert "EPSG:32632" in out
    assert list(gpd.read_parquet(tmp_path / "b.parquet").geom_type) == ["Polygon"]
    assert list(gpd.read_parquet(tmp_path / "s.parquet").geom_type) == ["LineString"]


def test_surroundings_that_a_source_has_not_are_told(city: Path, run: Run) -> None:
    buildings = city / "b.parquet"
    options = ("--out", city / "o.parquet", "--buildings", buildings)
    code, _, told = run("load", city / "lights.gpkg", "--catalog", city / "tiny.toml", *options)
    assert code == 0
    assert f"no buildings in what was loaded, so {buildings} is not written" in told
    assert not buildings.exists()


def test_fetch_from_a_portal_and_again_without_it(tmp_path: Path, run: Run) -> None:
    datasets = "/api/explore/v2.1/catalog/datasets/benches"
    point = {"type": "Point", "coordinates": [2.35, 48.85]}
    feature = {"type": "Feature", "geometry": point, "properties": {"id": 1}}
    export = {"type": "FeatureCollection", "features": [feature]}
    fields = {"fields": [{"name": "id", "type": "int"}, {"name": "shape", "type": "geo_shape"}]}
    options = ("--cache", tmp_path / "cache", "--out", tmp_path / "o.parquet", "--json")
    catalog = tmp_path / "portal.toml"
    with Server() as server:
        server.on(datasets, Answer(json.dumps(fields).encode()))
        server.on(
            f"{datasets}/exports/geojson",
            Answer(json.dumps(export).encode(), type="application/geo+json"),
        )
        catalog.write_text(
            f"""
name = "portal"
title = "Portal"
reader = "opendatasoft"
endpoints = ["{server.url}"]
metric_crs = "EPSG:2154"
[[layers]]
name = "benches"
class = "bench"
dataset = "benches"
files = ["benches.geojson"]
""",
            encoding="utf-8",
        )
        code, out, err = run("fetch", catalog, "--area", "2,48,3,49", *options)
        assert code == 0, err
        assert json.loads(out)["objects"] == 1
        assert "benches: 1 rows, 0.00 MB, from the portal, fetched 20" in err
        sentence(run("fetch", catalog, "--area", "Paris", *options), "'Paris'", "polygon file")
        sentence(run("fetch", catalog, "--area", "2,48,3", *options), "2,48,3")
    code, out, err = run("fetch", catalog, "--area", "2,48,3,49", "--offline", *options)
    assert code == 0
    assert "from the cache" in err
    assert json.loads(out)["objects"] == 1
    sentence(run("fetch", catalog, "--area", "5,48,6,49", "--offline", *options), "127.0.0.1")
    sentence(run("fetch", "montpellier", "--area", "3,43,4,44", *options), "semsig load")


def test_demo(tmp_path: Path, done: Done) -> None:
    out = done("demo", "--out", tmp_path / "demo", "--queries", 5)
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


def test_missing_file(city: Path, run: Run) -> None:
    catalog = ("--catalog", city / "tiny.toml", "--out", city / "o.parquet")
    sentence(run("load", city / "nowhere.shp", *catalog), "nowhere.shp does not exist")
    sentence(run("build", city / "no.parquet", "--out", city / "c.parquet"), "does not exist")
    sentence(run("info", city / "no.parquet"), "no.parquet does not exist")
    sentence(run("load", city, "--catalog", "no.toml", "--out", city / "o.parquet"), "no.toml")
    sentence(
        run("load", city, "--catalog", "montpelier", "--out", city / "o.parquet"),
        "the nearest is 'montpellier'",
    )


def test_unknown_layer(city: Path, run: Run) -> None:
    options = ("--catalog", city / "tiny.toml", "--out", city / "o.parquet")
    sentence(run("load", city, *options, "--layer", "light"), "'light'", "nearest is 'lights'")
    assert not (city / "o.parquet").exists()


def test_file_without_crs(city: Path, run: Run, done: Done) -> None:
    catalog = city / "bare.toml"
    catalog.write_text(
        CATALOG.replace('crs = "EPSG:2154"\n\n[[layers]]', "\n[[layers]]"), encoding="utf-8"
    )
    (city / "lights.gpkg").unlink()
    with fiona.open(
        city / "lights.shp",
        "w",
        driver="ESRI Shapefile",
        schema={"geometry": "Point", "properties": {"kind": "str"}},
    ) as layer:
        point = {"type": "Point", "coordinates": (770000.0, 6280000.0)}
        layer.write({"geometry": point, "properties": {"kind": "a"}})
    options = ("--catalog", catalog, "--layer", "lights", "--out", city / "o.parquet")
    sentence(run("load", city, *options), "lights.shp")
    done("load", city, *options, "--crs", "EPSG:2154")
    sentence(run("load", city, *options, "--crs", "EPSG:0"), "EPSG:0")


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
def test_bad_catalogue(
    city: Path,
    run: Run,
    old: str,
    new: str,
    words: tuple[str, ...],
) -> None:
    assert old in CATALOG
    (city / "tiny.toml").write_text(CATALOG.replace(old, new), encoding="utf-8")
    options = ("--catalog", city / "tiny.toml", "--out", city / "o.parquet")
    sentence(run("load", city, *options), *words)


def test_damaged_zip(city: Path, run: Run, done: Done) -> None:
    (city / "lights.gpkg").unlink()
    write_layer(city / "s.shp", [(770000.0 + i, 6280000.0) for i in range(500)], kind=["a"] * 500)
    with zipfile.ZipFile(city / "lights.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        for suffix in ("shp", "shx", "dbf", "prj"):
            archive.write(city / f"s.{suffix}", f"s.{suffix}")
    whole = (city / "lights.zip").read_bytes()
    options = ("--catalog", city / "tiny.toml", "--layer", "lights", "--out", city / "o.parquet")
    done("load", city, *options)
    for size in (len(whole) // 2, len(whole) - 10, 0):
        (city / "lights.zip").write_bytes(whole[:size])
        sentence(run("load", city, *options), "lights.zip")


def test_empty_results(city: Path, database: Path, run: Run) -> None:
    (city / "tiny.toml").write_text(CATALOG.replace("painted", "flooded"), encoding="utf-8")
    options = ("--catalog", city / "tiny.toml", "--out", city / "o.parquet")
    sentence(run("load", city, *options, "--layer", "crossings"), "no object remains")
    sentence(
        run("build", city / "objects.parquet", "--step", 5000, "--radius", 1, "--out", database),
        "no cell sees",
    )
    sentence(run("localize", database, "--types", ""), "without objects")
    sentence(run("localize", database), "types")


@pytest.mark.parametrize("radius", ["0", "-5", "nan"])
def test_radius_out_of_range(city: Path, database: Path, run: Run, radius: str) -> None:
    before = database.read_bytes()
    outcome = run("build", city / "objects.parquet", f"--radius={radius}", "--out", database)
    sentence(outcome, "visibility range")
    assert database.read_bytes() == before


def test_queries_that_do_not_fit(database: Path, run: Run) -> None:
    sentence(run("localize", database, "--types", "DQ"), "'Q'", "D street light")
    # A class that the taxonomy has and the city does not.
    sentence(run("localize", database, "--types", "DB"), "alignment tree", "B")
    lengths = run("localize", database, "--types", "DD", "--bearings", "10,20,30")
    sentence(lengths, "2 types and 3 bearings")
    sentence(run("localize", database, "--types", "D", "--bearings", "ten"), "'ten'")
    sentence(run("localize", database, "--types", "D", "--bearings", "nan"), "nan")
    sentence(run("localize", database, "--types", "D", "--method", "edti+edit"), "'edti'", "'edit'")
    sentence(run("localize", database, "--types", "D", "--method", "angles:edit"), "bearings")
    sentence(run("localize", database, "--types", "D", "--top", 0))
    sentence(run("evaluate", database, "--queries", 10**6), "queries")
    sentence(run("evaluate", database, "--distortion", "mild"), "'mild'")
    sentence(run("evaluate", database, "--noise", "light"), "--noise", "likelihood", "'edit+edit'")


def test_a_database_cut_in_half(database: Path, city: Path, run: Run) -> None:
    half = city / "half.parquet"
    half.write_bytes(database.read_bytes()[: database.stat().st_size // 2])
    for command in (
        ("info", half),
        ("localize", half, "--types", "D"),
        ("evaluate", half),
        ("export", half, "--out", city / "h.gpkg"),
    ):
        sentence(run(*command), "half.parquet is damaged")
    assert not (city / "h.gpkg").exists()
    # Each kind of file is told from the other.
    sentence(run("info", city / "objects.parquet"), "is a street objects file")
    sentence(run("build", database, "--out", half), "is a signature database file")


def test_outputs_that_cannot_be_written(database: Path, city: Path, run: Run) -> None:
    blocked = city / "tiny.toml" / "x.parquet"
    sentence(run("build", city / "objects.parquet", "--out", blocked), "cannot be written")
    sentence(run("build", city / "objects.parquet", "--out", city), "is a folder")
    sentence(run("export", database, "--out", city / "cells.txt"), ".gpkg")
    assert not list(city.glob(".*"))


def test_usage_errors_exit_2(run: Run) -> None:
    code, _, err = run("build")
    assert code == 2
    assert "Traceback" not in err


def test_the_console_script_is_installed() -> None:
    script = shutil.which("semsig", path=Path(sys.executable).parent)
    if script is None:
        pytest.skip("the package is not installed in this environment")
    done = subprocess.run([script, "--version"], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == f"semsig {__version__}"


def test_the_likelihood_is_evaluated_and_drawn(
    database: Path, city: Path, run: Run, done: Done
) -> None:
    options = ("--queries", 20, "--method", "likelihood", "--noise", "light")
    out = done("evaluate", database, *options, "--out", city / "by_likelihood", "--json")
    summary = json.loads(out)
    assert summary["settings"]["method"] == "likelihood:light:on_grid"
    assert 0 <= summary["results"]["coverage"] <= 1
    code, out, err = run("evaluate", database, *options)
    assert code == 0
    assert "Answered" in out
    assert "index" not in err  # it is kept beside the database
    out = done(
        "map", database, "--evaluation", city / "by_likelihood", "--out", city / "likelihood.html"
    )
    assert "likelihood:light:on_grid" in (city / "likelihood.html").read_text(encoding="utf-8")
    sentence(run("evaluate", database, "--method", "likelihood", "--noise", "loud"), "'loud'")


def test_many_queries_are_answered_line_by_line(
    city: Path, database: Path, run: Run, done: Done, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines = '{"id": "a", "types": "DD"}\n{"types": "?D", "bearings": [10, 200]}\n'
    (city / "queries.jsonl").write_text(lines)
    for method in ("edit+edit", "likelihood"):
        out = done("localize", database, "--queries", city / "queries.jsonl", "--method", method)
        answers = [json.loads(line) for line in out.splitlines()]
        assert [answer["id"] for answer in answers] == ["a", 2]
        assert all(answer["candidates"] for answer in answers)
    monkeypatch.setattr("sys.stdin", io.StringIO(lines))
    out = done("localize", database, "--queries", "-", "--require", "2D")
    assert len(out.splitlines()) == 2
    sentence(run("localize", database, "--queries", "x.csv", "--types", "D"), "--queries")
    sentence(run("localize", database, "--queries", city / "x.csv"), "x.csv", "cannot be read")


def test_buildings_streets_and_an_area_narrow_what_is_built(
    city: Path, database: Path, run: Run, done: Done
) -> None:
    objects, out = city / "objects.parquet", city / "narrow.parquet"
    houses, area = city / "houses.gpkg", city / "area.parquet"
    streets = city / "streets.geojson"
    square = shapely.box(770_000, 6_280_005, 770_400, 6_280_025)
    gpd.GeoDataFrame(geometry=[square], crs=2154).to_file(houses)
    gpd.GeoDataFrame(geometry=[square.buffer(60)], crs=2154).to_crs(4326).to_parquet(area)
    street = shapely.LineString([(770_000, 6_280_000), (770_400, 6_280_000)])
    gpd.GeoDataFrame(geometry=[street], crs=2154).to_crs(4326).to_file(streets)
    everything = open_database(database)
    sizes = {}
    for name, options in {
        "buildings": ("--buildings", houses),
        "outdoor": ("--buildings", houses, "--viewpoints", "outdoor"),
        "streets": ("--streets", streets, "--viewpoints", "streets"),
        "wide": ("--streets", streets, "--viewpoints", "streets", "--street-width", 40),
        "area": ("--area", area),
    }.items():
        printed = done("build", objects, "--out", out, *options)
        assert "cells of mean length" in printed
        opened = open_database(out)
        sizes[name] = len(opened), int(opened.lengths.sum())
    bow = shapely.Polygon(
        [(770_000, 6_280_000), (770_050, 6_280_050), (770_050, 6_280_000), (770_000, 6_280_050)]
    )
    gpd.GeoDataFrame(geometry=[bow], crs=2154).to_parquet(city / "bow.parquet")
    code, _, told = run("build", objects, "--out", out, "--buildings", city / "bow.parquet")
    assert code == 0
    assert "1 building footprints in" in told
    assert "repaired" in told
    total = int(everything.lengths.sum())
    assert sizes["outdoor"][0] < sizes["buildings"][0] <= len(everything)
    assert sizes["buildings"][1] < total
    assert sizes["streets"][0] < sizes["wide"][0] < len(everything)
    assert sizes["area"][0] <= len(everything)


def test_surroundings_that_cannot_be_used_are_refused(city: Path, database: Path, run: Run) -> None:
    del database
    objects, out = city / "objects.parquet", city / "narrow.parquet"

    def build(*options: object) -> tuple[int, str, str]:
        return run("build", objects, "--out", out, *options)

    sentence(build("--buildings", city / "nowhere.gpkg"), "nowhere.gpkg", "does not exist")
    sentence(build("--buildings", city / "nowhere.parquet"), "nowhere.parquet", "does not exist")
    sentence(build("--buildings", city / "lights.gpkg"), "lights.gpkg", "Point", "polygons")
    sentence(build("--area", city / "lights.gpkg"), "lights.gpkg", "Point", "polygons")
    sentence(build("--streets", city / "lights.gpkg", "--viewpoints", "streets"), "lines")
    sentence(build("--viewpoints", "outdoor"), "outdoor", "footprints")
    sentence(build("--viewpoints", "streets"), "streets", "centre lines")
    sentence(build("--streets", city / "lights.gpkg"), "--streets", "--viewpoints streets")
    assert not out.exists()
