"""The command line as its user meets it: results, exit codes and plain sentences."""

from __future__ import annotations

import io
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import geopandas as gpd
import pytest
import shapely
from osm_xml import node, way, write_osm
from sentences import sentence
from servers import Answer, Server

from semsig_gis import __version__
from semsig_gis.database import open_city, open_database
from semsig_gis.localization import localize

if TYPE_CHECKING:
    from conftest import Run, RunOk

DATA = Path(__file__).with_name("data")
X, Y = 770_000.0, 6_280_000.0
LOAD = "load . --catalog tiny.toml --out o.parquet"
LIKELIHOOD = "localize city.parquet"
REFUSALS = [
    row.replace("LOAD", LOAD).replace("LIKELIHOOD", LIKELIHOOD)
    for row in (DATA / "refusals.txt").read_text(encoding="utf-8").splitlines()
    if row and not row.startswith("#")
]


def write_layer(path: Path, *shapes: shapely.Geometry) -> None:
    gpd.GeoDataFrame(geometry=list(shapes), crs=2154).to_file(path)


def text(name: str) -> str:
    return Path(name).read_text(encoding="utf-8")


# --- Results ----------------------------------------------------------------------------------


@pytest.mark.usefixtures("city")
def test_load_build_and_localize(run_ok: RunOk) -> None:
    report = json.loads(run_ok(LOAD, "--json"))
    lights, crossings = report["sources"]
    assert report["objects"] == 21
    assert (lights["read"], lights["collapsed"], lights["kept"]) == (21, 1, 20)
    assert (crossings["read"], crossings["filtered"], crossings["kept"]) == (2, 1, 1)
    out = run_ok(LOAD)
    assert out.startswith("21 street objects of 2 classes on ")
    assert "street light (20), crossing (1)." in out
    assert out.endswith("street objects: o.parquet\n")
    out = run_ok(LOAD, "--tables")
    assert "per km² of hull" in out
    assert "Nobody (CC0-1.0): lights, crossings" in out
    assert " street objects on average, " in run_ok("build o.parquet --out c.parquet")
    assert "Nobody (CC0-1.0)" in str(json.loads(run_ok("info c.parquet --json")))
    out = run_ok("info c.parquet")
    assert "Seen: street light, crossing." in out
    assert "Data: Nobody (CC0-1.0)." in out
    out = run_ok("info c.parquet --symbols --tables")
    assert "street light (D)" in out
    assert "Nobody (CC0-1.0): lights, crossings" in out

    query = "localize c.parquet --types DX --bearings 200,20"
    answer = json.loads(run_ok(query, "--paper", "--top", 3, "--json"))
    assert answer["method"] == "edit+edit:5%"
    assert answer["query"]["types"] == "XD"
    assert len(answer["candidates"]) == 3
    best = answer["candidates"][0]
    # The only crossing is at x = 770010, y = 6280010.
    assert max(abs(best["x"] - 770010), abs(best["y"] - 6280010)) <= 30
    assert "(noise: generic)" not in run_ok(query, "--map", "query.html")
    out = run_ok(query, "-v")
    assert "(noise: generic)" in out
    assert re.search(r"│ (\d × )?street light", out)
    assert re.search(r"│ [DX]+ +│", run_ok(query, "--tables", "--symbols"))
    assert "https://www.openstreetmap.org/?mlat=" in out
    assert "leaflet" in text("query.html").lower()


@pytest.mark.usefixtures("city")
def test_evaluate_and_map(run_ok: RunOk) -> None:
    line = "evaluate city.parquet --queries 30 --distortion light --method edit+edit:20% --seed 5"
    summary = json.loads(run_ok(line, "--out", "eval", "--json"))
    assert summary["settings"]["queries"] == 30
    assert summary["settings"]["method"] == "edit+edit:20%"
    assert summary.pop("timing")["seconds_per_query"] > 0
    stored = json.loads(text("eval/evaluation.json"))
    assert {name: value for name, value in stored.items() if name != "run"} == summary
    out = run_ok(line, "--report", "eval.html")
    assert f"Of 30 views, {summary['results']['p_error_within_m']['50']:.0%}".rstrip("%") in out
    assert "report: eval.html" in out
    page = text("eval.html")
    assert f"semsig {line} --report eval.html" in page
    assert '<h1 dir="auto">City: how well queries are placed</h1>' in page
    assert "were placed within 50 m" in page
    assert "map.html" in run_ok("map city.parquet --evaluation eval --out map.html")
    assert Path("map.html").stat().st_size > 1000


@pytest.mark.usefixtures("city")
def test_no_filter_and_no_collapse_keep_all_rows(run_ok: RunOk) -> None:
    line = f"{LOAD} --no-filter --no-collapse --json"
    assert json.loads(run_ok(line))["objects"] == 23
    assert json.loads(run_ok(line, "--layer", "crossings"))["objects"] == 2


@pytest.mark.usefixtures("city")
def test_distortion_of_the_crs_is_reported_and_limited(run: Run, run_ok: RunOk) -> None:
    sentence(run(f"{LOAD} --max-distortion 1e-6"), "too wide", "EPSG:2154", "--max-distortion")
    plane = json.loads(run_ok("info city.parquet --json"))["distortion"]
    assert (plane["angle"], plane["stretch"]) == pytest.approx((0.63, 3e-4), abs=0.01)
    loaded = json.loads(run_ok(f"{LOAD} --json"))["distortion"]
    assert loaded["angle"] == pytest.approx(plane["angle"], abs=0.01)
    assert "at most 0.63° off true north" in run_ok("info city.parquet --tables")


@pytest.mark.parametrize("tiles", ["", "--tile 200"])
def test_warnings_of_load_are_stored_with_the_data(
    city: Path, run: Run, run_ok: RunOk, tiles: str
) -> None:
    (city / "crossings.geojson").unlink()
    catalog = (city / "tiny.toml").read_text(encoding="utf-8")
    lights = catalog.replace('files = ["lights.*"]', 'files = ["lights.*"]\nrows = [1, 9]')
    (city / "tiny.toml").write_text(lights, encoding="utf-8")
    code, out, err = run(f"{LOAD} --json")
    report = json.loads(out)
    (absent,), (few,) = report["notes"], report["sources"][0]["notes"]
    assert (code, f"semsig: {absent}" in err) == (0, True)
    assert absent.startswith("layer 'crossings' has no file here")
    assert "1 to 9 were expected" in few
    target = "town" if tiles else "town.parquet"
    run_ok(f"build o.parquet --out {target} {tiles}")
    notes = [absent, f"lights: {few}"]
    assert json.loads(run_ok(f"info {target} --json"))["notes"] == notes
    printed = run_ok(f"info {target} --tables").replace("│\n│", "")
    assert all(note in " ".join(printed.split()) for note in notes)


@pytest.mark.usefixtures("city")
def test_origin_moves_the_grid(run_ok: RunOk) -> None:
    run_ok("build objects.parquet --origin 5,5 --out moved.parquet")
    assert set(gpd.read_parquet("moved.parquet").geometry.x % 10) == {0.0}
    assert set(gpd.read_parquet("city.parquet").geometry.x % 10) == {5.0}


@pytest.mark.usefixtures("city")
def test_sources_lists_catalogues(run_ok: RunOk, monkeypatch: pytest.MonkeyPatch) -> None:
    listed = json.loads(run_ok("sources --json"))
    catalogs = {item["name"]: item for item in listed["catalogs"]}
    assert set(catalogs) >= {"montpellier", "opendata_paris", "openstreetmap"}
    needs = {"files": False, "network": True, "area": True, "token": "MAPILLARY_ACCESS_TOKEN"}
    assert catalogs["mapillary"]["needs"] == needs
    assert catalogs["montpellier"]["needs"]["files"]
    vienna = catalogs["vienna"]
    assert (vienna["place"], vienna["license"]) == ("Vienna, Austria", "CC BY 4.0")
    assert catalogs["washington"]["classes"][0] == "alignment_tree"
    monkeypatch.delenv("MAPILLARY_ACCESS_TOKEN", raising=False)
    assert "(MAPILLARY_ACCESS_TOKEN, not set)" in run_ok("sources")
    monkeypatch.setenv("MAPILLARY_ACCESS_TOKEN", "MLY|secret")
    out = run_ok("sources mapillary")
    assert "place: world; needs files, or an area" in out
    assert "Classes: " in out
    assert "secret" not in out
    assert "osm_file" in listed["readers"]
    monkeypatch.setenv("COLUMNS", "400")  # no text is wrapped
    for line, words in {
        "sources": ("montpellier",),
        "sources openstreetmap": ("highway=street_lamp", "telephones (optional)", "level = <0"),
        "sources opendata_paris": ("les-arbres",),
        "sources overture": ("base/land: subtype=tree and class=tree",),
        "sources mapillary": ("object--bench (",),
        "sources montpellier": ("ETAT = en fonction", "taxi_station"),
        "sources tiny.toml --json": ('"title": "A tiny city"',),
        "draft lights.gpkg": ("[[layers]]", 'files = ["lights.gpkg"]'),
    }.items():
        out = run_ok(line, *([] if "draft" in line or "--json" in line else ["--tables"]))
        assert all(word in out for word in words), line


def test_two_catalogues_are_loaded_and_merged(city: Path, run_ok: RunOk) -> None:
    (city / "survey.toml").write_text(
        'name = "survey"\ntitle = "Survey"\n'
        '[[layers]]\nname = "lamps"\nclass = "street_light"\nfiles = ["survey.gpkg"]\n'
        "[conflate]\nstreet_light = 2\n",
        encoding="utf-8",
    )
    write_layer(city / "survey.gpkg", shapely.Point(X + 1, Y), shapely.Point(X + 1000, Y))
    report = json.loads(run_ok(f"{LOAD} --catalog survey.toml --json"))
    assert report["objects"] == 22
    assert [(item["count"], item["kept"]) for item in report["conflated"]] == [(1, "tiny/lights")]
    assert json.loads(run_ok(f"{LOAD} --catalog survey.toml --no-merge --json"))["objects"] == 23


def test_options_select_layers_of_openstreetmap(city: Path, run_ok: RunOk) -> None:
    kinds = (
        {"amenity": "bench"},
        {"highway": "crossing", "crossing": "zebra"},
        {"amenity": "telephone"},
    )
    write_osm(
        city / "town.osm",
        *(node(n, 7.42, 43.73 + n / 1000, tags) for n, tags in enumerate(kinds, start=1)),
    )
    line = "load town.osm --catalog openstreetmap --out o.parquet"
    for options, objects, crossings, telephones in (
        ("", 2, None, 1),
        ("--paper-classes", 1, 1, 1),
        ("--all-layers", 3, None, None),
        ("--layer +telephones", 3, None, None),
        ("--layer telephones", 1, 1, None),
        ("--paper-classes --layer +telephones", 2, 1, None),
    ):
        report = json.loads(run_ok(f"{line} {options} --json"))
        unread = {item["name"]: item["objects"] for item in report["unread"]}
        counts = (report["objects"], unread.get("crossings"), unread.get("telephones"))
        assert counts == (objects, crossings, telephones), options
    out = run_ok(f"{line} --paper-classes --tables")
    assert "Layers not read" in out
    assert "pedestrian_crossing" not in out.partition("No objects of")[2].partition("Rows by")[0]
    assert "--layer +NAME" in out


def test_openstreetmap_with_its_surroundings(city: Path, run: Run, run_ok: RunOk) -> None:
    write_osm(
        city / "town.osm",
        node(1, 7.42, 43.73, {"amenity": "bench"}),
        node(2, 7.42, 43.74),
        node(3, 7.43, 43.74),
        way(8, [1, 2], {"highway": "residential"}),
        way(9, [1, 2, 3, 1], {"building": "yes"}),
    )
    surroundings = "--out o.parquet --buildings b.parquet --streets s.parquet"
    line = f"load town.osm --catalog openstreetmap {surroundings} --tables"
    assert "EPSG:32632" in run_ok(line)
    assert list(gpd.read_parquet("b.parquet").geom_type) == ["Polygon"]
    assert list(gpd.read_parquet("s.parquet").geom_type) == ["LineString"]
    load = "load extract.osm --catalog openstreetmap --out o.parquet --json"
    write_osm(
        city / "extract.osm",
        '<bounds minlon="7.4" minlat="43.7" maxlon="7.45" maxlat="43.75"/>',
        node(1, 7.42, 43.73, {"amenity": "bench"}),
        node(2, 7.46, 43.73, {"amenity": "bench"}),
    )
    for clip, outside, inside in (
        ("", 1, 1),
        ("--clip none", 0, 2),
        ("--clip box", 1, 1),
        ("--clip 7.45,43,8,44", 1, 1),
    ):
        report = json.loads(run_ok(f"{load} {clip}"))
        (benches,) = (layer for layer in report["sources"] if layer["name"] == "benches")
        assert (benches["outside"], benches["kept"]) == (outside, inside)
        at_the_edge = any("--area" in note for note in report["notes"])
        assert at_the_edge == (clip not in {"", "--clip none"})
        assert any("--clip none" in note for note in report["notes"]) == (clip == "")
        noted = any("1 of" in note and "by up to 80" in note for note in benches["notes"])
        assert noted == (clip not in {"", "--clip box"})
    code, _, err = run(LOAD, "--buildings", "none.parquet")
    assert code == 0
    assert "no buildings in what was loaded, so none.parquet is not written" in err
    assert not (city / "none.parquet").exists()


def test_fetch_from_a_portal_and_offline_from_the_cache(city: Path, run: Run) -> None:
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
        portal = (city / "portal.toml").read_text(encoding="utf-8")
        elsewhere = portal.replace(server.url, "http://nowhere.example")
        (city / "elsewhere.toml").write_text(elsewhere, encoding="utf-8")
        fetch_there = fetch.replace("portal.toml", "elsewhere.toml")
        code, out, err = run(fetch_there, "2,48,3,49", "--server", server.url)
        assert (code, json.loads(out)["objects"]) == (0, 1), err
        houses = '[[layers]]\nname = "houses"\nrole = "buildings"\ngeometry = "polygon"\n'
        (city / "houses.toml").write_text(f'{portal}{houses}dataset = "gone"\nfiles = ["x"]\n')
        fetch_houses = fetch.replace("portal.toml", "houses.toml")
        code, out, err = run(fetch_houses, "2,48,3,49")
        assert (code, json.loads(out)["objects"]) == (0, 1), err
        assert "without buildings and streets" in err
        assert "layer 'houses'" in err
        sentence(run(fetch_houses, "2,48,3,49", "--buildings", "b.parquet"), "layer 'houses'")
        sentence(run(fetch, "2,48,3,49", "--server", "portal"), "'portal'", "https://")
        sentence(run(fetch, "Paris"), "'Paris'", "polygon file")
        sentence(run(fetch, "2,48,3"), "2,48,3")
    code, out, err = run(fetch, "2,48,3,49", "--offline")
    assert (code, "from the cache" in err, json.loads(out)["objects"]) == (0, True, 1)
    sentence(run(fetch, "5,48,6,49", "--offline"), "127.0.0.1")


def test_demo_shows_an_answer_a_doubt_and_a_command_to_type(
    tmp_path: Path, run_ok: RunOk, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    out = run_ok("demo --queries 5")
    for name in ("place.html", "map.html", "report.html", "city.gpkg", "city.parquet"):
        assert f": demo/{name}\n" in out
        assert (tmp_path / "demo" / name).stat().st_size > 0
    output = " ".join(out.split())
    assert output.startswith("A made-up town: ")
    assert output.count("you would see: ") == output.count("semsig says: ") == 2
    assert re.search(r"within 50 m with a chance of [^.]* %\. In truth, it is \d+ m off\.", output)
    assert "semsig says: Cannot tell." in output
    assert "Of 5 views, " in output
    # The command to type gives the answer that was shown.
    (line,) = [line for line in out.splitlines() if line.startswith("  semsig localize ")]
    _, *words = shlex.split(line)
    answer = run_ok("", *words)
    assert " ".join(answer.split()).partition(" with ")[0] in output
    # The buildings and streets are found, and are layers of the export.
    run_ok("build demo/objects.parquet --out again.parquet")
    assert set(open_city("again.parquet").store.ground) == {"buildings", "streets"}
    assert {"buildings", "streets"} <= set(gpd.list_layers("demo/city.gpkg")["name"])
    page = text("demo/place.html")
    assert "Street " in page


def test_version_imports_no_slow_libraries() -> None:
    code = (
        "import sys; sys.argv = ['semsig', '--version']\n"
        "from semsig_gis.cli import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "print(sorted({'geopandas', 'numpy', 'folium', 'pandas', 'pydantic'} & set(sys.modules)))"
    )
    assert printed(sys.executable, "-c", code).splitlines() == [f"semsig {__version__}", "[]"]


def printed(*command: str) -> str:
    """Run a command without messages, and return its standard output."""
    process = subprocess.run(command, capture_output=True, text=True, check=True)
    assert process.stderr == ""
    return process.stdout


@pytest.mark.parametrize("options", ["--json", "--method likelihood"])
def test_query_imports_no_tables_or_maps_and_writes_no_files(city: Path, options: str) -> None:
    before = sorted(city.rglob("*"))
    code = (
        "import sys\n"
        "from semsig_gis.cli import main\n"
        "try: main()\n"
        "except SystemExit as end: assert end.code == 0\n"
        "heavy = {'pandas', 'geopandas', 'folium', 'dask', 'fiona', 'matplotlib', 'rasterio'}\n"
        # Modules that lazy_loader has prepared, but not imported, do not count.
        "lazy = {name for name in heavy if '_LazyModule' in str(type(sys.modules.get(name)))}\n"
        "print(sorted(heavy & set(sys.modules) - lazy))"
    )
    line = f"localize city.parquet --types DD --bearings 80,200 {options}".split()
    out = printed(sys.executable, "-c", code, *line)
    assert "city" in out or "cells" in out
    assert out.splitlines()[-1] == "[]"
    assert sorted(city.rglob("*")) == before


def test_companion_files_are_listed_and_removed(city: Path, run_ok: RunOk) -> None:
    old = city / "city.parquet.generic-8d47.likelihood"
    old.write_bytes(b"1" * 300_000)
    assert "likelihood index of an older version" in run_ok("info city.parquet --tables")
    files = json.loads(run_ok("info city.parquet --json"))["files"]
    assert [(file["what"], file["needed"]) for file in files] == [
        ("street objects", True),
        ("likelihood index of an older version", False),
    ]
    assert "0.3 MB in all" in run_ok("clean city.parquet --dry-run")
    report = json.loads(run_ok("clean city.parquet --json"))
    assert report == {"dry_run": False, "bytes": 300_000, "removed": files[1:]}
    assert not old.exists()
    assert "nothing to remove next to city.parquet" in run_ok("clean city.parquet")
    assert "street objects" in run_ok("clean city.parquet --objects")
    assert not (city / "city.objects").exists()


def test_console_script_is_installed() -> None:
    script = shutil.which("semsig", path=Path(sys.executable).parent)
    if script is None:
        pytest.skip("the package is not installed in this environment")
    assert printed(script, "--version").strip() == f"semsig {__version__}"


@pytest.mark.usefixtures("city")
def test_likelihood_is_evaluated_and_drawn(run_ok: RunOk) -> None:
    line = "evaluate city.parquet --queries 20 --noise light"
    summary = json.loads(run_ok(line, "--out", "eval", "--json"))
    assert summary["settings"]["method"] == "likelihood:light:on_grid"
    assert 0 <= summary["results"]["coverage"] <= 1
    assert "Answered" in run_ok(line, "--tables")
    run_ok("map city.parquet --evaluation eval --out map.html")
    assert "likelihood, noise: light" in text("map.html")


@pytest.mark.usefixtures("city")
def test_sentence_is_repeated_as_it_was_understood(run_ok: RunOk) -> None:
    words = "a green lamp on the left, 2 lamps ahead, lamp 20 right, no crossing"
    out = " ".join(run_ok("localize city.parquet", words).split())
    classes = "street light ahead ± 26°, street light ahead ± 26°, street light 20° right, "
    assert f"Seen: {classes}street light 90° left ± 26°; north unknown." in out
    assert "Not there: crossing" in out
    assert "Note: 'green' was not used." in out
    out = " ".join(
        run_ok("localize city.parquet", "zwei Laternen NO, Laterne auf 200 Grad").split()
    )
    assert (
        "Seen: street light at 45° ± 13°, street light at 45° ± 13°, street light at 200°." in out
    )


def test_many_queries_are_answered_line_by_line(
    city: Path, run_ok: RunOk, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines = b'{"id": "a", "types": "DD"}\n{"types": "?D", "bearings": [10, 200]}\n'
    (city / "queries.jsonl").write_bytes(lines)
    for method in ("edit+edit", "likelihood"):
        out = run_ok("localize city.parquet --queries queries.jsonl --method", method)
        answers = [json.loads(line) for line in out.splitlines()]
        assert [answer["id"] for answer in answers] == ["a", 2]
        assert all(answer["candidates"] for answer in answers)
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(lines)))
    assert len(run_ok("localize city.parquet --queries - --require 2D").splitlines()) == 2


@pytest.mark.usefixtures("city")
@pytest.mark.parametrize("method", ["edit+edit", "likelihood"])
def test_sentence_is_printed_as_understood(run_ok: RunOk, method: str) -> None:
    words = "lamp at 80 within 12 m, crossing at 120 far, street light at 200"
    query = "localize city.parquet --top 2 --method", method, words, "--fov", 70, "--look", 90
    answer = json.loads(run_ok(*query, "--json"))
    view = answer["query"]
    assert (view["types"], view["bearings"]) == ("DXD", [80.0, 120.0, 200.0])
    assert view["ranges"] == [pytest.approx(7.3, abs=0.1), pytest.approx(25, abs=1), None]
    assert view["sectors"] == [[55.0, 125.0]]
    notes = ["street light at 200.0° is outside the sectors"]
    notes += ["edit+edit does not use ranges and sectors"] if method == "edit+edit" else []
    for note, words in zip(answer["notes"], notes, strict=True):
        assert words in note
    out = run_ok(*query)
    objects = "street light at 80° 7.3 m away, crossing at 120° 25 m away, street light at 200°"
    assert f"Seen: {objects}; looked at 55 to 125°." in " ".join(out.split())
    # The query in an answer can be given again.
    Path("queries.jsonl").write_text(json.dumps(view | {"id": "again"}))
    noise = ("--noise", "by-hand") if method == "likelihood" else ()
    again = json.loads(
        run_ok("localize city.parquet --queries queries.jsonl --top 2 --method", method, *noise)
    )
    assert again["query"] == view
    assert again["candidates"] == answer["candidates"]


def test_sentence_has_one_answer_whoever_reads_it(city: Path, run_ok: RunOk) -> None:
    words = "lamp at 80 within 12 m, crossing at 120 far, street light at 200"
    single = json.loads(run_ok("localize city.parquet --json", words))
    (city / "queries.jsonl").write_text(json.dumps({"see": words}))
    (line,) = run_ok("localize city.parquet --queries queries.jsonl").splitlines()
    assert single["noise"] == json.loads(line)["noise"] == "by-hand"
    assert json.loads(line)["candidates"] == single["candidates"]
    answer = localize(city / "city.parquet", words, explained=0)
    assert answer.to_dict()["place"] == single["place"]


@pytest.mark.parametrize("method", ["edit+edit", "likelihood"])
def test_every_query_has_an_answer_or_an_error(city: Path, run: Run, method: str) -> None:
    rows = ['{"types": "DX"}', "{", '{"id": "\\ud800", "types": "D!"}', '{"bearings": []}']
    rows.append('{"types": "DL", "bearings": [40, 80], "ranges": [1e-30, 12]}')
    (city / "queries.jsonl").write_text("\n".join(rows))
    batch = "localize few.parquet --queries queries.jsonl --method", method
    code, out, err = run(*batch)
    assert (code, "3 of 5 queries" in err) == (0, True)
    answers = [json.loads(line) for line in out.splitlines()]
    assert [answer["line"] for answer in answers] == [1, 2, 3, 4, 5]
    assert [answer["id"] for answer in answers] == [1, 2, "\ud800", 4, 5]
    assert ["error" in answer for answer in answers] == [False, True, True, False, True]
    assert "the map has no crossing, " in answers[0]["notes"][0]
    assert "nothing was seen" in answers[3]["notes"][0]
    (city / "queries.jsonl").write_text(rows[1])
    code, out, err = run(*batch)
    assert (code, "line 1 of queries.jsonl is no query" in err) == (2, True)
    assert json.loads(out)["error"] in err
    (city / "queries.jsonl").write_text('{"seen": "lamp at 4"}')
    assert "the key 'seen' is unknown; the nearest is 'see'" in run(*batch)[2]
    (city / "queries.jsonl").write_text("")
    sentence(run(*batch), "no query of queries.jsonl was found")


@pytest.mark.usefixtures("city")
@pytest.mark.parametrize("method", ["edit+edit", "likelihood"])
@pytest.mark.parametrize(
    ("view", "words"),
    [("--types X", "the map has no crossing, "), ("--bearings=", "nothing was seen")],
)
def test_unknown_class_and_empty_query_are_answered(
    run_ok: RunOk, method: str, view: str, words: str
) -> None:
    query = f"localize few.parquet {view} --method {method}"
    notes = json.loads(run_ok(f"{query} --json"))["notes"]
    (note,) = (note for note in notes if words in note)
    assert f"Note: {note}" in " ".join(run_ok(query).split())


def test_buildings_streets_and_area_select_cells(city: Path, run: Run, run_ok: RunOk) -> None:
    square = shapely.box(770_000, 6_280_005, 770_400, 6_280_025)
    street = shapely.LineString([(770_000, 6_280_000), (770_400, 6_280_000)])
    bow = shapely.Polygon(
        [(770_000, 6_280_000), (770_050, 6_280_050), (770_050, 6_280_000), (770_000, 6_280_050)]
    )
    write_layer(city / "houses.gpkg", square)
    gpd.GeoDataFrame(geometry=[square.buffer(60)], crs=2154).to_crs(4326).to_parquet("area.parquet")
    gpd.GeoDataFrame(geometry=[street], crs=2154).to_crs(4326).to_file("streets.geojson")
    write_layer(city / "bow.gpkg", bow)
    build = "build objects.parquet --out narrow.parquet"
    cells, entries = {}, {}
    for name, options in {
        "all": "",
        "buildings": "--buildings houses.gpkg --viewpoints all",
        "outdoor": "--buildings houses.gpkg",
        "streets": "--streets streets.geojson --viewpoints streets",
        "free": "--streets streets.geojson --viewpoints streets --buildings houses.gpkg",
        "wide": "--streets streets.geojson --viewpoints streets --street-width 40",
        "area": "--area area.parquet",
    }.items():
        assert " street objects on average, " in run_ok(f"{build} {options}")
        database = open_database("narrow.parquet")
        cells[name], entries[name] = len(database), int(database.lengths.sum())
    assert cells["outdoor"] < cells["buildings"] <= cells["all"]
    assert entries["buildings"] < entries["all"]
    assert cells["free"] < cells["streets"] < cells["wide"] < cells["all"]
    assert cells["area"] <= cells["all"]
    code, _, err = run(build, "--buildings", city / "bow.gpkg")
    assert code == 0
    assert "1 building footprints in" in err
    assert "repaired" in err


# --- Refusals ---------------------------------------------------------------------------------


def contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("row", REFUSALS)
def test_invalid_input_is_refused_and_changes_no_file(
    row: str, tiny_city: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tiny_city)
    before = contents(tiny_city)
    line, words = row.split(" -> ")
    sentence(run(line), *words.split(" | "))
    assert contents(tiny_city) == before


def test_warning_is_one_line(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def suggest(_: Path, *, crs: str | None) -> str:  # noqa: ARG001
        warnings.warn("the file is old", stacklevel=1)
        return "draft"

    monkeypatch.setattr("semsig_gis.objects.draft_catalog", suggest)
    with warnings.catch_warnings(action="always"):
        assert run("draft x.gpkg") == (0, "draft\n", "semsig: the file is old\n")


def test_file_without_a_crs_needs_option(city: Path, run: Run, run_ok: RunOk) -> None:
    bare = text("tiny.toml").replace(
        'files = ["lights.*"]\ncrs = "EPSG:2154"', 'files = ["lights.*"]'
    )
    (city / "tiny.toml").write_text(bare, encoding="utf-8")
    (city / "lights.gpkg").unlink()
    with pytest.warns(UserWarning, match="crs"):
        gpd.GeoDataFrame(geometry=[shapely.Point(X, Y)]).to_file(city / "lights.shp")
    line = f"{LOAD} --layer lights"
    sentence(run(line), "lights.shp")
    run_ok(line, "--crs", "EPSG:2154")
    sentence(run(line, "--crs", "EPSG:0"), "EPSG:0")
    sentence(run(line, "--crs", "EPSG:4978"), "EPSG:4978", "geocentric")
    sentence(run(line, "--crs", "EPSG:5773"), "EPSG:5773", "vertical")


@pytest.mark.skipif(sys.platform == "win32", reason="no such files")
@pytest.mark.parametrize(
    ("line", "suffix"),
    [
        ("localize city.parquet --queries", ""),
        ("localize city.parquet --queries", ".csv"),
        ("learn city.parquet --out n.toml --samples", ".jsonl"),
        (f"{LIKELIHOOD} --types D --noise", ".toml"),
        (f"{LIKELIHOOD} --types D --rule", ".json"),
        (f"{LIKELIHOOD} --types D --popularity", ".tif"),
        (f"{LIKELIHOOD} --types D --area", ".geojson"),
        ("build objects.parquet --out c.parquet --buildings", ".gpkg"),
        ("load . --out o.parquet --catalog", ".toml"),
        ("load --catalog tiny.toml --out o.parquet", ".gpkg"),
        ("experiment --out x", ".toml"),
        ("draft", ".csv"),
        ("info", ".parquet"),
        ("build --out c.parquet", ".parquet"),
        ("import --out c.parquet", ".gpkg"),
    ],
)
def test_pipe_is_refused(line: str, suffix: str, city: Path, run: Run) -> None:
    pipe = city / f"pipe{suffix}"
    os.mkfifo(pipe)
    sentence(run(line, pipe), str(pipe))


@pytest.mark.parametrize(
    ("line", "name", "text"),
    [
        (f"{LIKELIHOOD} --types D --noise", "deep.json", "[" * 100_000),
        (f"{LIKELIHOOD} --types D --noise", "deep.toml", "a = " + "[" * 100_000),
        (f"{LIKELIHOOD} --types D --noise", "huge.toml", f"clutter = {10**400}"),
        (f"{LIKELIHOOD} --types D --noise", "nan.json", '{"clutter": NaN}'),
        (f"{LIKELIHOOD} --types D --rule", "deep.json", '{"threshold": ' + "[" * 100_000),
        (f"{LIKELIHOOD} --types D --rule", "huge.json", '{"threshold": 1e999}'),
        ("load . --out o.parquet --catalog", "deep.toml", "a = " + "[" * 100_000),
        ("load --catalog tiny.toml --out o.parquet", "crossings.geojson", '{"type": ' * 100_000),
        ("draft", "deep.geojson", '{"type": ' * 100_000),
        ("experiment --out x", "deep.toml", "a = " + "[" * 100_000),
    ],
)
def test_deeply_nested_or_huge_values_are_refused(
    line: str, name: str, text: str, city: Path, run: Run
) -> None:
    (city / name).write_text(text, encoding="utf-8")
    outcome = run(line, name)
    sentence(outcome)
    assert len(outcome[2]) < 500
