"""The commands that use the likelihood: localize, route, suggest, learn and calibrate."""

from __future__ import annotations

import dataclasses
import datetime as dt
import io
import json
import math
import re
import shutil
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pytest
import rasterio
import shapely
from pyproj import CRS, Transformer
from sentences import sentence
from worlds import CORNER, World, random_town

from semsig_gis.database import ObjectStore, save_database, save_with_store, visible_objects_at
from semsig_gis.evaluation import open_evaluation
from semsig_gis.localization import open_noise, open_rule
from semsig_gis.objects import save_objects
from semsig_gis.observation import North

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run

WORLD = random_town()
CITY = WORLD.database
STORE = ObjectStore.of(WORLD.street_objects)


@pytest.fixture
def city(tmp_path: Path) -> Path:
    """Return a database with its object store."""
    save_with_store(CITY, STORE, tmp_path / "city.parquet")
    return tmp_path / "city.parquet"


def view_from(xy: np.ndarray) -> dict[str, Any]:
    """Return the view from a place without errors."""
    view = visible_objects_at(STORE.objects, xy[None], index=STORE.index, radius=30.0)
    return {"types": CITY.taxonomy.decode(view.codes), "bearings": view.bearings.tolist()}


def options(view: dict[str, Any]) -> tuple[str, ...]:
    return ("--types", view["types"], "--bearings", ",".join(map(str, view["bearings"])))


def test_what_was_read_is_compared_with_the_map(tmp_path: Path, run: Run) -> None:
    names = [f"Kiosk {chr(97 + row % 26) * 3}{chr(97 + row // 26) * 3}" for row in range(300)]
    table = STORE.objects.table
    table = table.assign(name=names[: len(table)])
    store = ObjectStore.of(dataclasses.replace(STORE.objects, table=table))
    save_with_store(CITY, store, tmp_path / "city.parquet")
    lines: list[dict[str, Any]] = [
        {"see": "tree 'kiosk cccaaa' at 40, bench at 90, sign 'Nowhere'"},
        {"detections": [{"class": "tree", "bearing": 40, "text": "Kiosk cccaaa"}]},
        {"types": "?", "bearings": [40], "texts": ["Kiosk cccaab"], "signs": ["Kiosk ddd"]},
    ]
    (tmp_path / "views.jsonl").write_text("\n".join(map(json.dumps, lines)))
    city, views = str(tmp_path / "city.parquet"), str(tmp_path / "views.jsonl")
    code, out, _ = run("localize", city, "--queries", views, "--json")
    answers = list(map(json.loads, out.splitlines()))
    assert code == 0
    fits = [[(text["fit"], text["names"]) for text in answer["texts"]] for answer in answers]
    exact = "exact", ["Kiosk cccaaa"]
    assert fits[0] == [exact, ("none", [])]
    assert fits[1] == [exact]
    assert [fit for fit, _ in fits[2]] == ["letters off", "part"]
    assert any("'Nowhere'" in note for note in answers[0]["notes"])
    code, out, _ = run("localize", city, lines[0]["see"], "--explain")
    assert "'kiosk cccaaa' is written on 1 object of the map." in out
    assert "that reads 'kiosk cccaaa'" in out


def test_a_view_from_any_of_several_cities(city: Path, tmp_path: Path, run: Run) -> None:
    other = random_town(5, count=150).database
    other_zone = dataclasses.replace(other, crs=CRS("EPSG:32631"), licenses=("Other (CC0)",))
    save_database(other_zone, tmp_path / "other.parquet")
    cities = str(tmp_path / "other.parquet"), str(city)
    code, out, _ = run("localize", *cities, *options(VIEW), "--json", "--top", 4)
    assert code == 0
    answer = json.loads(out)
    assert answer["city"] == cities[1]
    assert answer["answered"]
    assert math.dist((answer["place"]["x"], answer["place"]["y"]), PLACE) < 10.0
    assert sum(answer["cities"].values()) + answer["elsewhere"] == pytest.approx(1.0)
    assert [row["rank"] for row in answer["candidates"]] == [1, 2, 3, 4]
    chances = [row["chance"] for row in answer["candidates"]]
    assert chances == sorted(chances, reverse=True)
    # What was seen comes last; north is that of each city.
    out = run("localize", *cities, "lamp", "--noise", "light", "--north", "true")[1]
    assert "elsewhere" in out
    assert {row["city"] for row in answer["candidates"]} <= set(cities)
    for name in cities:
        assert f"{name}: chance " in out
    code, out, _ = run("localize", *cities, *options(VIEW), "--surely-here", "--json")
    assert json.loads(out)["elsewhere"] == 0.0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("city.parquet", "bench", "lamp"), "give more databases"),
        (("bench", "city.parquet"), "give more databases"),
        (("city.parquet", "bench", "--near", "1,2,3"), "several databases were given with --near"),
        (("city.parquet", "bench", "--method", "edit+edit"), "databases were given with --method"),
    ],
)
def test_databases_come_before_what_was_seen(
    city: Path, run: Run, arguments: tuple[str, ...], words: str
) -> None:
    sentence(run("localize", city, *arguments), words)


def written(path: Path, rows: list[dict[str, Any]]) -> Path:
    path.write_text("".join(json.dumps(row) + "\n" for row in rows), encoding="utf-8")
    return path


def written_area(path: Path, shape: shapely.Geometry) -> tuple[str, Path]:
    gpd.GeoDataFrame(geometry=[shape], crs=2154).to_file(path)
    return "--area", path


def walk(count: int) -> tuple[np.ndarray, list[dict[str, Any]]]:
    """Return places 15 m apart, and the views from them with the steps between."""
    places = CORNER + np.array([[50.0 + 15.0 * step, 90.0] for step in range(count)])
    rows = [view_from(place) for place in places]
    rows[0]["id"] = "start"
    for row in rows[1:]:
        row |= {"dx": 15.0, "dy": 0.0, "sigma": 1.0}
    return places, rows


def flat(text: str) -> str:
    """Return a text without the breaks between its lines."""
    return " ".join(text.split())


PLACE = CORNER + np.array([103.0, 97.0])
VIEW = view_from(PLACE)


def test_answer_and_priors_are_printed(city: Path, run: Run) -> None:
    query = "localize", city, *options(VIEW)
    code, out, _ = run(*query, "--json", "--top", 3)
    assert code == 0
    answer = json.loads(out)
    assert (answer["noise"], len(answer["candidates"])) == ("generic", 3)
    assert answer["answered"]
    assert math.dist((answer["place"]["x"], answer["place"]["y"]), PLACE) < 10.0
    assert "explanation" not in answer["candidates"][0]
    out = run(*query, "--noise", "medium", "--heading", "unknown", "--top", 2, "--tables")[1]
    for words in ("2 best places in", "Position: x", "North of the query: ", "over 99 %"):
        assert words in out
    short = "localize", city, "--types", VIEW["types"][:1]
    assert "90 % region, if it is from this area: " in run(*short)[1]
    code, out, _ = run(*short, "--surely-here", "--tables")
    assert code == 0
    assert "Cannot tell. 90 % region: " in out
    assert out.index("Cannot tell") < out.index("Best place: ") < out.index("If it is there: x ")
    x, y = PLACE
    lon, lat = Transformer.from_crs(2154, 4326, always_xy=True).transform(x, y)
    query = "localize", city, *options(VIEW), "--near", f"{lon},{lat},15"
    assert f"x {x:.1f}, y {y:.1f}, ± 15 m, read as LON,LAT" in flat(run(*query)[1])
    used = json.loads(run(*query, "--require", VIEW["types"][0], "--json")[1])["prior"]
    assert used["near"]["x"] == pytest.approx(x, abs=0.01)
    assert used["near"]["read_as"] == "LON,LAT"
    assert used["require"]["cells"] > 0
    assert used["ratio"] > 1
    prior = "--near", f"{x},{y},15", "--require", VIEW["types"][0]
    assert run(*query, *prior, "--heading", 10)[0] == 0
    area = written_area(city.with_name("square.gpkg"), shapely.box(x - 6, y - 6, x + 6, y + 6))
    inside = json.loads(run("localize", city, "--types", VIEW["types"], *area, "--json")[1])
    assert inside["answered"]
    assert inside["prior"]["area"] == {"file": str(area[1]), "cells": 1}
    assert sum(row["chance"] for row in inside["candidates"][:4]) == pytest.approx(1.0)


def test_popularity_raster_is_a_prior(city: Path, run: Run) -> None:
    x, y = PLACE
    people = city.with_name("people.tif")
    spec = {"width": 3, "height": 3, "count": 1, "dtype": "uint8", "crs": "EPSG:2154"}
    place = rasterio.Affine(200.0, 0.0, x - 300.0, 0.0, -200.0, y + 300.0)
    with rasterio.open(people, "w", transform=place, **spec) as file:
        file.write(np.array([[0, 0, 0], [0, 9, 0], [0, 0, 0]], np.uint8), 1)
    query = "localize", city, "--types", VIEW["types"][:1]
    answer = json.loads(run(*query, "--popularity", people, "--json", "--top", 500)[1])
    likely = [row for row in answer["candidates"] if row["chance"] > 0]
    assert likely
    assert all(abs(row["x"] - x) < 110 and abs(row["y"] - y) < 110 for row in likely)


def test_on_grid_assumes_the_centre_of_a_cell(city: Path, run: Run) -> None:
    cell = int(CITY.lengths.argmax())
    query = "localize", city, *options(view_from(CITY.xy[cell])), "--json"
    sure, likely = (
        json.loads(run(*query, *more)[1])["candidates"][0] for more in (("--on-grid",), ())
    )
    explained = json.loads(run(*query, "--on-grid", "--explain")[1])
    assert explained["candidates"][0].pop("explanation")["counts"]["missed"] == 0
    assert explained["candidates"][0] == sure
    assert sure["cell_id"] == likely["cell_id"] == CITY.cell_ids[cell]
    assert sure["chance"] > likely["chance"]


def test_place_is_refined_explained_and_drawn(city: Path, run: Run) -> None:
    page = city.with_name("map.html")
    query = "localize", city, *options(VIEW), "--explain"
    code, out, _ = run(*query, "--map", page)
    assert code == 0
    for words in ("Place 1, ", " matched", "Place 3, ", f"map: {page}"):
        assert words in out
    assert "leaflet" in page.read_text(encoding="utf-8").lower()
    answer = json.loads(run(*query, "--json")[1])
    place = answer["place"]
    assert place["refined"]
    assert math.dist((place["x"], place["y"]), PLACE) < 1.0
    assert place["sigma"] < 2.0
    why = [row.get("explanation") for row in answer["candidates"]]
    assert [explanation is not None for explanation in why] == [True] * 3 + [False] * 7
    assert why[0]["counts"]["matched"] == len(VIEW["types"])
    assert {row["source"] for row in why[0]["rows"]} == {"world"}
    assert all(row["source_id"].isdigit() for row in why[0]["rows"])


def test_street_objects_are_missing_or_in_another_file(city: Path, run: Run) -> None:
    query = "localize", city, *options(VIEW)
    elsewhere = city.with_name("elsewhere")
    city.with_suffix(".objects").rename(elsewhere)
    sentence(run(*query, "--refine"), "no object store", "build the database again")
    code, out, err = run(*query, "--explain", "--json")
    assert code == 0
    assert "no street objects found" in err
    rows = json.loads(out)["candidates"][0]["explanation"]["rows"]
    assert {row["source_id"] for row in rows} == {None}
    assert json.loads(run(*query, "--objects", elsewhere, "--json")[1])["place"]["refined"]
    file = city.with_name("objects.parquet")
    save_objects(WORLD.street_objects, file)
    assert json.loads(run(*query, "--refine", "--objects", file, "--json")[1])["place"]["refined"]


def test_route_is_answered_line_by_line(
    city: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    places, rows = walk(4)
    rows[1] = {"types": "", "bearings": [], "distance": 15.0, "bearing": 90.0, "sigma": 1.0}
    file = written(city.with_name("route.jsonl"), rows)
    query = "route", city, "--json"
    for more in (("--no-refine",), ("--refine", "--explain"), ("--heading", "unknown")):
        code, out, _ = run(*query, file, *more)
        assert code == 0
        answers = [json.loads(line) for line in out.splitlines()]
        assert [answer["id"] for answer in answers] == ["start", 2, 3, 4]
        for answer, place in zip(answers, places, strict=True):
            assert math.dist((answer["place"]["x"], answer["place"]["y"]), place) < 15.0
            assert answer["answered"]
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(file.read_bytes())))
    assert len(run(*query, "-")[1].splitlines()) == 4


def gpx(file: Path, places: np.ndarray, *, timed: bool) -> Path:
    """Write a track that begins at 10:00, with 20 seconds between its points."""
    degrees = Transformer.from_crs(CITY.crs, 4326, always_xy=True).transform(*np.transpose(places))
    points = "".join(
        f'<trkpt lat="{lat}" lon="{lon}">'
        + (f"<time>2026-05-31T10:00:{20 * number:02}Z</time>" if timed else "")
        + "</trkpt>"
        for number, (lon, lat) in enumerate(zip(*degrees, strict=True))
    )
    schema = 'xmlns="http://www.topografix.com/GPX/1/1"'
    file.write_text(f"<gpx {schema}><trk><trkseg>{points}</trkseg></trk></gpx>")
    return file


@pytest.mark.parametrize("timed", [False, True])
def test_track_gives_the_steps_of_a_route(city: Path, run: Run, timed: bool) -> None:  # noqa: FBT001
    places, rows = walk(3)
    views = [{key: row[key] for key in ("types", "bearings")} for row in rows]
    track = gpx(city.with_name("way.gpx"), places, timed=timed)
    expected = [*places]
    if timed:  # the last view is halfway between the last two points, in another time zone
        expected = [*places[:2], (places[1] + places[2]) / 2]
        views[2] |= {"types": "", "bearings": []}
        for row, time in zip(views, ("10:00:00Z", "10:00:20+00:00", "12:00:30+02:00"), strict=True):
            row["time"] = f"2026-05-31T{time}"
    file = written(city.with_name("route.jsonl"), views)
    code, out, _ = run("route", city, file, "--track", track, "--json")
    assert code == 0
    answers = [json.loads(line)["place"] for line in out.splitlines()]
    for place, xy in zip(answers, expected, strict=True):
        assert math.dist((place["x"], place["y"]), xy) < 15.0
    printed = run("route", city, file, "--track", track)[1]
    assert "3 views of city.parquet" in printed
    assert "lat, lon" in printed

    for change, words in (
        ({"dx": 1, "dy": 2}, ["line 3", "the track gives the steps"]),
        ({"time": "2026-05-31T09:00:00Z"}, ["view 3" if timed else "view 1", "time"]),
        ({"time": "noon"}, ["'noon'", "2024-05-31T14:05:09Z"]),
    ):
        wrong = written(city.with_name("wrong.jsonl"), [*views[:2], {**views[2], **change}])
        sentence(run("route", city, wrong, "--track", track), *words)
    short = gpx(city.with_name("short.gpx"), places[:2], timed=False)
    words = ["has no times"] if timed else ["2 points for 3 views"]
    sentence(run("route", city, file, "--track", short), *words)


def test_view_is_given_without_an_option(city: Path, run: Run) -> None:
    query = "localize", city, "--json"
    angles = ",".join(map(str, VIEW["bearings"]))
    symbols = json.loads(run(*query, VIEW["types"], "--bearings", angles)[1])
    assert symbols == json.loads(run(*query, *options(VIEW))[1])
    names = [CITY.taxonomy.by_symbol(symbol).name for symbol in VIEW["types"]]
    words = [f"{name} at {at}" for name, at in zip(names, VIEW["bearings"], strict=True)]
    sentence_answer = json.loads(run(*query, ", ".join(words), "--noise", "generic")[1])
    assert sentence_answer["candidates"] == symbols["candidates"]
    # People leave out objects in a sentence, so the default noise is another one.
    assert json.loads(run(*query, ", ".join(words))[1])["noise"] == "by-hand"
    # The last object has no direction.
    line = ", ".join([*words[:-1], names[-1]])
    code, out, _ = run("localize", city, line)
    assert code == 0
    title = CITY.taxonomy.by_symbol(VIEW["types"][-1]).title.lower()
    assert f"Seen somewhere: {title}." in out
    assert "said without direction" in run("localize", city, line, "--explain")[1]
    _, out, _ = run("localize", city, f"{line}, {names[-1]}")
    assert f"Seen somewhere: 2 × {title}." in out
    # Absent classes, in addition to symbols.
    code, out, _ = run("localize", city, "no bench", *options(VIEW))
    assert (code, "Not there: bench." in out) == (0, True)
    sentence(run("localize", city, "no bench", *options(VIEW), "--paper"), "absent objects")
    mixed = run("localize", city, ", ".join([*words[:-1], names[-1]]), "--paper")
    sentence(mixed, "with and without a direction", "'edit+edit:5%'")


def test_suggest_prints_questions_by_gain(city: Path, run: Run) -> None:
    few = {key: values[:2] for key, values in VIEW.items()}
    suggest = "suggest", city, *options(few)
    questions = json.loads(run(*suggest, "--json")[1])["questions"]
    gains = [question["gain"] for question in questions]
    assert gains == sorted(gains, reverse=True)
    assert {question["symbol"] for question in questions} == {
        CITY.taxonomy.by_code(code).symbol for code in CITY.present_codes
    }
    code, out, _ = run(*suggest)
    assert code == 0
    assert questions[0]["question"] in out
    assert "lat, lon" in out


def samples(count: int, *, seed: int = 0) -> list[dict[str, Any]]:
    """Return views of a poor detector from random places."""
    rng = np.random.default_rng(seed)
    rows = []
    for place in CORNER + rng.uniform(20, 180, (count, 2)):
        view = visible_objects_at(STORE.objects, place[None], index=STORE.index, radius=30.0)
        detected = rng.random(len(view.codes)) < 0.8
        angles = (view.bearings[detected] + rng.normal(0, 4.0, int(detected.sum()))) % 360.0
        types = CITY.taxonomy.decode(view.codes[detected])
        rows.append({"x": place[0], "y": place[1], "types": types, "bearings": angles.tolist()})
    return rows


def test_noise_is_learnt_and_used(city: Path, run: Run) -> None:
    file, out = written(city.with_name("s.jsonl"), samples(150)), city.with_name("noise.toml")
    learn = "learn", city, "--samples", file, "--out", out
    code, printed, _ = run(*learn)
    assert code == 0
    for words in ("Learnt from", f"noise model: {out}"):
        assert words in printed
    assert "bearing_sigma" in run(*learn, "--tables")[1]
    report = json.loads(run(*learn, "--json")[1])
    (detection,) = (
        row for row in report["rates"] if (row["quantity"], row["class"]) == ("detection", "all")
    )
    assert detection["low_95"] < 0.8 < detection["high_95"]
    assert detection["samples"] == report["objects"]
    noise = open_noise(out)
    assert noise.name == "noise"
    assert {spec.position_sigma for spec in noise.specs} == {0.0}
    query = "localize", city, *options(VIEW), "--refine", "--json", "--noise", out
    answer = json.loads(run(*query)[1])
    assert answer["noise"] == "noise"
    assert math.dist((answer["place"]["x"], answer["place"]["y"]), PLACE) < 1.0


def test_noise_is_learnt_from_bearings_of_a_compass(city: Path, run: Run) -> None:
    north = North.of("magnetic", CITY.crs, CITY.bounds, date=dt.date(2024, 5, 1))
    rng, rows = np.random.default_rng(0), samples(150)
    for row in rows:
        turn = rng.normal(0.0, 10.0)
        row["bearings"] = [(north.from_grid(angle) + turn) % 360.0 for angle in row["bearings"]]
    file, out = written(city.with_name("s.jsonl"), rows), city.with_name("noise.toml")
    learn = "learn", city, "--samples", file, "--out", out, "--north", "magnetic"
    compass = "--date", "2024-05-01", "--heading", 10
    code, printed, _ = run(*learn, *compass)
    assert code == 0
    assert "The samples suffice for all classes together" in printed
    report = json.loads(run(*learn, *compass, "--json")[1])
    assert report["verdicts"]["detection"]["enough"]
    assert report["spec"]["bearing_sigma"] == pytest.approx(4.0, abs=0.6)
    for row in rows:
        row["heading_error"] = "unknown"
    written(file, rows[:3])
    code, printed, _ = run(*learn)
    assert code == 0
    assert "Give more samples for" in printed
    assert "fewer than 8 samples" in printed


def test_ranges_and_fading_are_learnt_and_printed(city: Path, run: Run) -> None:
    rng, rows = np.random.default_rng(1), []
    for place in CORNER + rng.uniform(20, 180, (250, 2)):
        view = visible_objects_at(STORE.objects, place[None], index=STORE.index, radius=30.0)
        chances = np.interp(view.distances, [6.0, 30.0], [0.95, 0.1])
        detected = rng.random(len(view.codes)) < chances
        ranges = view.distances[detected] * np.exp(rng.normal(0, 0.2, int(detected.sum())))
        rows.append(
            {
                "x": place[0],
                "y": place[1],
                "ranges": ranges.tolist(),
                "types": CITY.taxonomy.decode(view.codes[detected]),
                "bearings": view.bearings[detected].tolist(),
            }
        )
    file, out = written(city.with_name("s.jsonl"), rows), city.with_name("noise.toml")
    code, printed, err = run("learn", city, "--samples", file, "--out", out, "--tables")
    assert code == 0, err
    for words in ("range_sigma", "detection at 6 m", "detection at 30 m"):
        assert words in printed
    assert open_noise(out).specs[0].range_sigma == pytest.approx(0.2, abs=0.02)


def test_noise_is_learnt_from_views_of_unknown_places(city: Path, run: Run) -> None:
    rows = [
        {name: row[name] for name in ("types", "bearings")}
        for row in samples(60)
        if len(row["types"]) >= 3
    ][:30]
    views, out = written(city.with_name("views.jsonl"), rows), city.with_name("noise.toml")
    learn = "learn", city, "--out", out
    code, printed, err = run(*learn, "--unlabelled", views, "--noise", "by-hand")
    assert code == 0, err
    assert f"noise model: {out}" in printed
    assert "30 views" in err
    assert open_noise(out).name == "noise"
    for options_ in ((), ("--samples", views, "--unlabelled", views)):
        sentence(run(*learn, *options_), "--unlabelled")
    for option in (("--map-age", 2), ("--drift-report", city.with_name("drift.json"))):
        sentence(run(*learn, "--unlabelled", views, *option), f"{option[0]} was given with")
    code, printed, err = run("localize", city, "--queries", views, "--adapt", "--top", 1)
    assert code == 0, err
    answers = [json.loads(line) for line in printed.splitlines()]
    assert len(answers) == len(rows)
    assert {answer["noise"] for answer in answers} <= {"adapted", "photo"}
    sentence(run("localize", city, *options(VIEW), "--adapt"), "--queries")


def test_map_age_is_printed_and_corrects_learnt_noise(city: Path, run: Run) -> None:
    fewer = city.with_name("fewer.parquet")
    objects = WORLD.street_objects
    save_objects(dataclasses.replace(objects, table=objects.table[::2]), fewer)
    newer, report = city.with_name("newer.parquet"), city.with_name("drift.json")
    update = "update", city, "--objects", fewer, "--out", newer
    report.write_text(run(*update, "--years", 2, "--json")[1], encoding="utf-8")
    old = "--map-age", 2, "--drift-report", report
    query = "localize", city, *options(VIEW)
    assert "(noise: 2-year-old map with generic)" in run(*query, *old, "--tables")[1]
    answers = [json.loads(run(*query, *more, "--json")[1]) for more in ((), old)]
    names = [answer["noise"] for answer in answers]
    assert names == ["generic", "2-year-old map with generic"]
    assert answers[0]["entropy_bits"] < answers[1]["entropy_bits"]
    file, out = written(city.with_name("s.jsonl"), samples(100)), city.with_name("noise.toml")
    learn = "learn", city, "--samples", file, "--out", out
    plain = json.loads(run(*learn, "--json")[1])["spec"]
    printed = run(*learn, *old)[1]
    (spec,) = open_noise(out).specs
    assert f"detection {spec.detection:.3f} (was {plain['detection']:.3f})" in printed
    assert spec.detection > 0.95 > plain["detection"]
    rules = []
    for more in ((), old):
        rule = city.with_name("rule.json")
        calibrate = "calibrate", city, "--samples", file, "--out", rule, "--precision", 0.9
        assert run(*calibrate, "--no-refine", *more)[0] == 0
        rules.append(open_rule(rule))
    assert rules[0].threshold != rules[1].threshold
    folder = city.with_name("evaluation")
    assert run("evaluate", city, *old, "--queries", 20, "--out", folder)[0] == 0
    command = "evaluate", city, "--queries", 20, "--foreign", city
    printed = run(*command, "--tables")[1]
    assert re.search(r"views of the other city, [\d.]+ % were answered", flat(printed))
    assert "Views of this city and of another" in printed
    rows = json.loads(run(*command, "--json")[1])["foreign"]
    assert [row["own"] for row in rows] == [row["foreign"] for row in rows]
    sentence(run(*command, "--paper"), "--foreign works only with the likelihood method")
    method = open_evaluation(folder).method
    assert str(method) == "likelihood:2-year-old map with generic:on_grid"


def test_noise_is_learnt_without_a_store(city: Path, run: Run) -> None:
    save_database(CITY, city.with_name("bare.parquet"))
    out = city.with_name("noise.json")
    rows = samples(100)
    for row in rows[:50]:
        cell = CITY.grid.cells_at([[row.pop("x"), row.pop("y")]])
        row["cell_id"] = int(cell[0][0]) * 10**8 + int(cell[1][0])
    for database in (city, city.with_name("bare.parquet")):
        file = written(city.with_name("s.jsonl"), rows)
        code, _, err = run("learn", database, "--samples", file, "--out", out)
        assert code == 0
        assert ("no street objects found" in err) == (database != city)
        assert {spec.position_sigma for spec in open_noise(out).specs} == {0.0}


def test_rule_is_calibrated_and_used(city: Path, run: Run) -> None:
    file = written(
        city.with_name("s.jsonl"), [*samples(60), samples(1)[0] | {"types": "", "bearings": ""}]
    )
    out = city.with_name("rule.json")
    calibrate = "calibrate", city, "--samples", file, "--out", out, "--precision", 0.9
    code, printed, _ = run(*calibrate, "--no-refine")
    assert code == 0
    assert "Answers from a chance of" in printed
    rule = open_rule(out)
    assert rule.queries == 61
    assert 0 < rule.answered < 61
    report = json.loads(run(*calibrate, "--json")[1])
    assert report["coverage"] >= rule.coverage
    assert report["precision"] == 0.9
    # Bearings from another north are turned before they are compared.
    north = North.of("true", CITY.crs, CITY.bounds)
    turned = [
        row | {"bearings": [north.from_grid(angle) for angle in row["bearings"] or ()]}
        for row in samples(60)
    ]
    true = written(city.with_name("true.jsonl"), turned)
    other = city.with_name("other.json")
    line = "calibrate", city, "--samples", true, "--out", other, "--precision", 0.9
    assert run(*line, "--no-refine", "--north", "true")[0] == 0
    assert open_rule(other).threshold == pytest.approx(rule.threshold, abs=1e-6)
    query = "localize", city, *options(VIEW), "--json", "--rule", out
    assert json.loads(run(*query)[1])["threshold"] == open_rule(out).threshold
    code, printed, _ = run("calibrate", city, "--samples", file, "--out", out, "--no-refine")
    assert "nothing is answered" in printed
    answer = json.loads(run(*query)[1])
    assert (answer["answered"], answer["threshold"]) == (False, None)
    sentence(run(*calibrate[:-1], 1.5), "--precision was given as 1.5", "from 0.01 to 0.9999")


def test_bearings_may_be_from_magnetic_north(city: Path, run: Run) -> None:
    query = "localize", city, *options(VIEW), "--north", "magnetic", "--date", "2024-05-31"
    for more in ((), ("--paper",)):
        north = json.loads(run(*query, *more, "--json")[1])["north"]
        assert (north["name"], north["date"]) == ("magnetic", "2024-05-31")
        assert "from magnetic north of 2024-05-31, at 1.6° from grid" in flat(run(*query, *more)[1])
    page_line = *query, "--heading", "unknown", "--map", city.with_name("map.html"), "--tables"
    out = run(*page_line)[1]
    assert "° from magnetic north." in out
    page = city.with_name("map.html").read_text(encoding="utf-8")
    assert "are measured from magnetic north of 2024-05-31" in page


def test_place_is_within_the_area(city: Path, run: Run) -> None:
    apart = World((*WORLD.objects, (CORNER[0] + 900.0, CORNER[1], WORLD.objects[0][2])))
    save_with_store(apart.database, ObjectStore.of(apart.street_objects), city)
    corner = shapely.box(*CORNER, *(CORNER + 50.0))
    area = written_area(city.with_name("corner.gpkg"), corner)
    near = "--near", f"{CORNER[0] + 900.0},{CORNER[1]},1"
    code, out, _ = run("localize", city, *options(VIEW), *area, *near, "--json")
    assert code == 0
    best = json.loads(out)["place"]
    assert shapely.Point(best["x"], best["y"]).within(corner)


def test_objects_outside_the_photo_are_counted_separately(city: Path, run: Run) -> None:
    view = "--types", "D", "--bearings", "90", "--ranges", "12", "--fov", "60", "--look", "90"
    query = "localize", city, *view, "--refine", "--explain"
    printed = run(*query)[1]
    assert "outside the photos" in printed
    assert "90.0°, 12.0 m" in printed
    (first, *_) = json.loads(run(*query, "--json")[1])["candidates"]
    rows = first["explanation"]["rows"]
    assert rows[0]["query_range"] == 12.0
    outside = [row for row in rows if row["verdict"] == "outside"]
    assert f"{len(outside)} outside" in printed
    assert all(not 45.0 < row["object_bearing"] < 135.0 for row in outside)


def test_answers_note_that_street_objects_are_missing_or_of_another_city(
    town: Path, run: Run
) -> None:
    query = "localize city.parquet --types BD --bearings 20,200 -q --json"
    assert json.loads(run(query)[1])["notes"] == []
    save_objects(random_town(seed=99).street_objects, "other.parquet")
    (note,) = json.loads(run(f"{query} --objects other.parquet")[1])["notes"]
    assert "of what cells of city.parquet see is in other.parquet" in note
    assert json.loads(run(f"{query} --objects objects.parquet")[1])["notes"] == []
    shutil.rmtree(town / "city.objects")
    (note,) = json.loads(run(query)[1])["notes"]
    assert "answering at cell precision" in note
    assert "build the database again" in note
