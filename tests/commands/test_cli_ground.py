"""Buildings and streets from load to the name of a place, and the area that load keeps."""

from __future__ import annotations

import dataclasses
import errno
import json
import os
from typing import TYPE_CHECKING

import geopandas as gpd
import pytest
import shapely
from osm_xml import node, way, write_osm
from sentences import sentence

from semsig_gis.core import LICENSES
from semsig_gis.database import open_city, open_store
from semsig_gis.objects import open_objects, read_surroundings, save_objects, save_surroundings

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run, RunOk
    from semsig_gis.database import ObjectStore

LAT, LON = 43.73, 7.42
DEGREE_M = 111_195.0
LOAD = "load town.osm --out town.parquet"
GROUND = ("town.buildings.parquet", "town.streets.parquet")
QUERY = "--types L --bearings 180 --json"


def at(number: int, east: float, north: float, tags: dict[str, str] | None = None) -> str:
    """Return a node some metres from the middle of the town."""
    lon = LON + east / (DEGREE_M * 0.7225)
    return node(number, lon, LAT + north / DEGREE_M, tags)


def ground_rows(store: ObjectStore) -> tuple[int, int]:
    """Return the numbers of buildings and of streets that a city keeps."""
    buildings, streets = (
        0 if part is None else len(part) for part in (store.footprints, store.streets)
    )
    return buildings, streets


@pytest.fixture
def town(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with a town of a street, a house and a bench on each side of the house."""
    monkeypatch.chdir(tmp_path)
    write_osm(
        tmp_path / "town.osm",
        at(1, -60, 0),
        at(2, 60, 0),
        at(3, -15, 12),
        at(4, 15, 12),
        at(5, 15, 30),
        at(6, -15, 30),
        at(7, 0, 3, {"amenity": "bench"}),
        at(8, 0, 38, {"amenity": "bench"}),
        way(10, [1, 2], {"highway": "residential", "name": "Rue Longue"}),
        way(11, [3, 4, 5, 6, 3], {"building": "yes", "name": "Town Hall"}),
    )
    return tmp_path


def cells(run_ok: RunOk, options: str = "") -> tuple[int, int]:
    run_ok(f"build town.parquet --out city.parquet {options}")
    database = open_city("city.parquet").database
    return len(database), len(database.codes)


def test_load_keeps_the_ground_and_build_finds_it(town: Path, run: Run, run_ok: RunOk) -> None:
    run_ok(LOAD)
    assert all((town / name).is_file() for name in GROUND)
    code, _, err = run("build town.parquet --out city.parquet")
    assert code == 0
    for words in (*GROUND, "hide what is behind", "outdoor", "--no-ground"):
        assert words in err
    city = open_city("city.parquet")
    assert (city.database.viewpoints.mode, city.database.occlusion) == ("outdoor", 0.5)
    assert ground_rows(city.store) == (1, 1)
    with_ground = cells(run_ok)
    plain = cells(run_ok, "--no-ground")
    assert with_ground[0] < plain[0]
    store = open_store("city.parquet")
    assert ground_rows(store) == (0, 0)
    everywhere = cells(run_ok, "--viewpoints all")
    assert everywhere[1] < plain[1]  # the house hides


def test_ground_of_an_earlier_load_is_not_used(town: Path, run_ok: RunOk) -> None:
    run_ok(LOAD)
    run_ok(f"{LOAD} --no-ground")
    assert not any((town / name).exists() for name in GROUND)
    run_ok(f"{LOAD} --buildings houses.parquet")
    assert [(town / name).exists() for name in GROUND] == [False, True]
    run_ok("build town.parquet --out city.parquet")
    city = open_city("city.parquet")
    assert (city.database.viewpoints.mode, city.database.occlusion) == ("all", None)
    assert ground_rows(city.store) == (0, 1)


def test_files_of_a_user_are_not_lost(town: Path, run: Run, run_ok: RunOk) -> None:
    own = gpd.GeoDataFrame(geometry=[shapely.box(LON, LAT, LON + 0.001, LAT + 0.001)], crs=4326)
    save_surroundings(own, town / GROUND[0])
    (town / GROUND[1]).write_text("notes", "utf-8")
    before = [(town / name).read_bytes() for name in GROUND]
    sentence(run(LOAD), *GROUND, "would be replaced", "--no-ground")
    assert not (town / "town.parquet").exists()
    code, _, err = run(f"{LOAD} --no-ground")
    assert code == 0
    assert all(f"{name} was not written by semsig" in err for name in GROUND)
    assert [(town / name).read_bytes() for name in GROUND] == before
    (town / GROUND[1]).unlink()
    run_ok("build town.parquet --out city.parquet --no-ground")
    run_ok("export city.parquet --out city.gpkg --objects town.parquet")
    code, _, err = run("import city.gpkg --out new.parquet --objects town.parquet")
    assert (code, f"{GROUND[0]} was not written by semsig" in err) == (0, True)
    assert (town / GROUND[0]).read_bytes() == before[0]


def test_ground_that_was_changed_by_its_user_is_kept(town: Path, run: Run, run_ok: RunOk) -> None:
    run_ok(LOAD)
    code, _, err = run(f"{LOAD} --no-ground")
    assert (code, err.count("was removed")) == (0, 2)
    run_ok(LOAD)
    table = read_surroundings(town / GROUND[0], role="buildings", crs=4326)
    save_surroundings(table, town / GROUND[0])
    sentence(run(LOAD), GROUND[0], "would be replaced")


@pytest.mark.parametrize("options", ["", " --no-ground", " --tile 100"])
@pytest.mark.parametrize("name", GROUND)
def test_build_does_not_replace_the_ground(
    town: Path, run: Run, run_ok: RunOk, name: str, options: str
) -> None:
    run_ok(LOAD)
    before = (town / name).read_bytes()
    sentence(run(f"build town.parquet --out {name}{options}"), name, "another name")
    assert (town / name).read_bytes() == before


@pytest.mark.parametrize("out", ["city.parquet", "tiles --tile 100"])
def test_ground_of_another_city_is_not_used(town: Path, run: Run, run_ok: RunOk, out: str) -> None:
    run_ok(LOAD)
    there = gpd.GeoDataFrame(geometry=[shapely.box(-0.1, 51.5, -0.09, 51.51)], crs=4326)
    save_surroundings(there, town / GROUND[0])
    code, _, err = run(f"build town.parquet --out {out}")
    assert (code, f"the buildings of {GROUND[0]} are not where" in err) == (0, True)
    assert "hide what is behind" not in err
    store = open_store(out.split(maxsplit=1)[0])
    assert ground_rows(store) == (0, 1)
    code, _, err = run(f"build town.parquet --out {out} --buildings {GROUND[0]}")
    assert f"the buildings of {GROUND[0]} are not where the street objects are\n" in err


@pytest.mark.parametrize(("name", "options"), [("city.parquet", ""), ("city", "--tile 100")])
def test_answers_name_their_place(
    town: Path,  # noqa: ARG001
    run_ok: RunOk,
    name: str,
    options: str,
) -> None:
    run_ok(LOAD)
    run_ok(f"build town.parquet --out {name} {options}")
    for method in ("likelihood", "edit+edit"):
        place = json.loads(run_ok(f"localize {name} {QUERY} --method {method}"))["place"]
        assert place["name"].endswith("near Town Hall")
        assert all(link.startswith("https://") for link in place["links"].values())
        assert f"{place['lat']:.4f}" in place["links"]["OpenStreetMap"]
    run_ok("build town.parquet --out city.parquet --no-ground")
    assert json.loads(run_ok(f"localize city.parquet {QUERY}"))["place"]["name"] == ""


@pytest.mark.parametrize(("name", "options"), [("city.parquet", ""), ("city", "--tile 100")])
@pytest.mark.parametrize("method", ["likelihood", "edit+edit"])
def test_sources_of_names_are_credited(
    town: Path, run_ok: RunOk, name: str, options: str, method: str
) -> None:
    run_ok(LOAD)
    streets = gpd.read_parquet(town / GROUND[1])
    streets.attrs[LICENSES] = ["Streets of the town: CC BY"]
    save_surroundings(streets, town / "lanes.parquet")
    run_ok(f"build town.parquet --out {name} {options} --streets lanes.parquet --viewpoints all")
    record = json.loads(run_ok(f"localize {name} {QUERY} --method {method}"))
    assert record["licenses"][-1] == "Streets of the town: CC BY"
    assert len(record["licenses"]) == len(set(record["licenses"])) > 1
    for suffix in ("kml", "geojson"):
        run_ok(f"localize {name} {QUERY} --method {method} --out answer.{suffix}")
        assert "Streets of the town: CC BY" in (town / f"answer.{suffix}").read_text("utf-8")
    assert "Streets of the town: CC BY" in open_city(name).licenses


def test_streets_are_kept_for_every_choice_of_viewpoints(town: Path, run_ok: RunOk) -> None:
    run_ok(f"{LOAD} --streets lanes.parquet")
    for mode in ("all", "outdoor", "streets"):
        run_ok(f"build town.parquet --out city.parquet --streets lanes.parquet --viewpoints {mode}")
        assert ground_rows(open_city("city.parquet").store)[1] == 1
    run_ok("build town.parquet --out tiles --tile 100 --streets lanes.parquet --viewpoints all")
    assert ground_rows(open_city(town / "tiles").store)[1] == 1


@pytest.mark.parametrize("lanes", ["lanes.geojson", "lanes.gpkg"])
def test_names_of_streets_of_a_user_are_used(town: Path, run_ok: RunOk, lanes: str) -> None:
    run_ok(f"{LOAD} --no-ground")
    line = shapely.LineString([(LON - 0.001, LAT), (LON + 0.001, LAT)])
    gpd.GeoDataFrame({"Name": ["My Lane"]}, geometry=[line], crs=4326).to_file(town / lanes)
    run_ok(f"build town.parquet --out city.parquet --streets {lanes}")
    city = open_city("city.parquet")
    assert city.place_name(*city.database.xy[0]) == "on My Lane"


@pytest.mark.parametrize("names", [[0.748], [["a", "b"]], [None]])
def test_names_that_are_not_text_are_not_used(
    town: Path,
    run_ok: RunOk,
    names: list[object],
) -> None:
    run_ok(f"{LOAD} --no-ground")
    line = shapely.LineString([(LON - 0.001, LAT), (LON + 0.001, LAT)])
    gpd.GeoDataFrame({"name": names}, geometry=[line], crs=4326).to_parquet(town / "own.parquet")
    for out in ("city.parquet", "tiles --tile 100"):
        run_ok(f"build town.parquet --out {out} --streets own.parquet")
        answer = json.loads(run_ok(f"localize {out.split()[0]} {QUERY} --map map.html"))
        assert answer["place"]["name"] == ""


def test_box_of_a_file_that_holds_no_object_is_named(town: Path, run: Run) -> None:
    text = (town / "town.osm").read_text("utf-8")
    box = '<bounds minlat="1" minlon="2" maxlat="3" maxlon="4"/>'
    start = text.index("<node")
    (town / "town.osm").write_text(text[:start] + box + text[start:], "utf-8")
    sentence(run(LOAD), "2,1,4,3", "--clip none")


def test_update_and_merge_keep_the_ground(town: Path, run_ok: RunOk) -> None:  # noqa: ARG001
    run_ok(LOAD)
    for name, options in (("city.parquet", ""), ("tiles", "--tile 100")):
        run_ok(f"build town.parquet --out {name} {options}")
        run_ok(f"update {name} --objects town.parquet")
        store = open_city(name).store
        assert ground_rows(store) == (1, 1)
    run_ok("merge city.parquet tiles --out both.parquet")
    store = open_city("both.parquet").store
    assert ground_rows(store) == (1, 1)
    assert store.place_name(*open_city("city.parquet").database.xy[0]) != ""


def test_made_up_cities_have_ground(town: Path, run_ok: RunOk) -> None:  # noqa: ARG001
    run_ok("synthesize --size 250 --out made")
    run_ok("build made/objects.parquet --out made.parquet")
    city = open_city("made.parquet")
    assert city.database.viewpoints.mode == "outdoor"
    assert any(city.place_name(*xy).startswith(("on ", "at ")) for xy in city.database.xy)


LAT_FIRST = "43.72,7.41,43.74,7.43"
WANTED = ("latitude", "exchanged", "7.41,43.72,7.43,43.74")


@pytest.mark.parametrize(
    "line",
    [
        f"{LOAD} --clip {LAT_FIRST}",
        f"build town.parquet --out c.parquet --area {LAT_FIRST}",
        f"build town.parquet --out tiles --tile 100 --area {LAT_FIRST}",
        f"localize city.parquet --types L --area {LAT_FIRST}",
        "localize city.parquet --types L --area exchanged.geojson",
    ],
)
def test_exchanged_latitude_and_longitude_of_an_area_are_noticed(
    town: Path, run: Run, run_ok: RunOk, line: str
) -> None:
    run_ok(LOAD)
    run_ok("build town.parquet --out city.parquet")
    south, west, north, east = map(float, LAT_FIRST.split(","))
    box = shapely.box(south, west, north, east)
    gpd.GeoDataFrame(geometry=[box], crs=4326).to_file(town / "exchanged.geojson")
    sentence(run(line), *WANTED)


def test_exchanged_latitude_and_longitude_of_a_position_are_noticed(
    town: Path,  # noqa: ARG001
    run: Run,
    run_ok: RunOk,
) -> None:
    run_ok(LOAD)
    run_ok("build town.parquet --out city.parquet")
    for position, noticed in ((f"{LON},{LAT},90", True), (f"{LAT},{LON},90", False)):
        _, _, err = run(f"localize city.parquet --types L --near {position}")
        assert ("read as longitude,latitude" in err) == noticed


def test_box_with_latitude_first_that_is_none_is_noticed(run: Run, town: Path) -> None:  # noqa: ARG001
    line = f"{LOAD} --clip=-33.9,151.1,-33.8,151.3"
    sentence(run(line), "is not an area", "exchanged", "151.1,-33.9,151.3,-33.8")


def test_files_of_another_run_of_load_are_remarked(town: Path, run: Run, run_ok: RunOk) -> None:
    run_ok(f"{LOAD} --buildings own.parquet")
    old = [(town / name).read_bytes() for name in ("own.parquet", GROUND[1])]
    build = "build town.parquet --out city.parquet --buildings own.parquet"
    assert "another run" not in run(build)[2]
    objects = open_objects(town / "town.parquet")
    save_objects(dataclasses.replace(objects, table=objects.table[:-1]), town / "town.parquet")
    code, _, err = run(build)
    assert code == 0
    for role, name in (("buildings", "own.parquet"), ("streets", GROUND[1])):
        assert f"the {role} of {name} are of another run of semsig load than town.parquet" in err
    (town / "town.parquet").rename(town / "mine.parquet")  # not what they were written with
    assert "another run" not in run(f"{build.replace('town', 'mine')} --streets {GROUND[1]}")[2]
    run_ok(f"{LOAD} --buildings own.parquet")
    assert [(town / name).read_bytes() for name in ("own.parquet", GROUND[1])] == old


def test_a_full_disk_leaves_all_files_of_load(
    town: Path, run: Run, run_ok: RunOk, monkeypatch: pytest.MonkeyPatch
) -> None:
    run_ok(f"{LOAD} --buildings own.parquet")
    before = {path: path.read_bytes() for path in town.glob("*.parquet")}

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    for name in ("save_objects", "_save"):
        with monkeypatch.context() as patch:
            patch.setattr(f"semsig_gis.objects.surroundings.{name}", full)
            sentence(run(f"{LOAD} --buildings own.parquet"), "No space left", "unchanged")
        assert {path: path.read_bytes() for path in town.glob("*.parquet")} == before
