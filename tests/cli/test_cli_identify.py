"""Identifiability as its user meets it: identify, info, map, export and update."""

from __future__ import annotations

import dataclasses
import functools
import json
from typing import TYPE_CHECKING

import geopandas as gpd
import pytest
from sentences import sentence
from worlds import random_town

from semsig_gis.database.city import City
from semsig_gis.database.file import open_database, save_database
from semsig_gis.database.store import ObjectStore, open_store, save_with_store
from semsig_gis.database.tiles import TileSpec, build_tiles
from semsig_gis.evaluation.identify import identify as identifying
from semsig_gis.objects.table import save_objects

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Done, Run

TOWN = random_town()
# Each class is left out once, which takes its time.
WORLD = dataclasses.replace(
    TOWN, objects=tuple(one for one in TOWN.objects if one[2] in {1, 3, 10})
)
QUICK = ("--on-grid", "--noise", "medium")


@pytest.fixture(autouse=True)
def _few_trials(monkeypatch: pytest.MonkeyPatch) -> None:
    few = functools.partial(identifying.identify, trials=60, class_trials=5)
    monkeypatch.setattr(identifying, "identify", few)


@pytest.fixture
def city(tmp_path: Path) -> Path:
    """Return a database with its object store beside it."""
    path = tmp_path / "city.parquet"
    save_with_store(WORLD.database, ObjectStore.of(WORLD.street_objects), path)
    return path


def test_what_is_found_out_is_told_everywhere(city: Path, run: Run, done: Done) -> None:
    code, out, told = run("identify", city, "--noise", "medium", "--check", 40)
    assert code == 0
    for said in ("Identifiability, medium noise", "What each class adds", "bits left",
                 "Do the chances come true?", "Rank correlation", "columns: "):  # fmt: skip
        assert said in out
    assert "is built" in told
    cells = gpd.read_parquet(city)
    assert cells["chance_found"].between(0, 1).all()
    assert len(open_store(city).objects) == len(WORLD.street_objects)

    code, out, told = run("identify", city, "--noise", "medium", "--json")
    assert code == 0
    assert "has these columns already" in told
    facts = json.loads(out)
    assert facts["chance_found"] == pytest.approx(cells["chance_found"].mean())
    assert facts["classes"][0]["objects"] > 0
    assert json.loads(done("info", city, "--json"))["identifiability"] == facts
    assert "Identifiability, medium noise" in done("info", city)

    folder = city.parent
    out = done("map", city, "--identifiability", "--out", folder / "map.html")
    assert "Where a query can be placed" in (folder / "map.html").read_text(encoding="utf-8")
    done("export", city, "--out", folder / "city.gpkg")
    exported = gpd.read_file(folder / "city.gpkg", layer="cells")
    assert exported["chance_found"].tolist() == cells["chance_found"].tolist()


def test_another_noise_seed_or_radius_is_found_out_anew(city: Path, run: Run, done: Done) -> None:
    options = ("--threads", 2, "--json", "--check", 20)
    one = json.loads(done("identify", city, *QUICK, *options))
    assert (one["seed"], one["radius_m"], one["check"]["seed"]) == (0, 50.0, 1)
    for more in (("--seed", 3), ("--radius", 20), ("--noise", "light"), ()):
        code, out, told = run("identify", city, *(QUICK if more else QUICK[1:]), *options, *more)
        assert code == 0
        assert "already" not in told
        assert json.loads(out) != one


def test_a_database_in_parts(tmp_path: Path, done: Done) -> None:
    save_objects(WORLD.street_objects, tmp_path / "objects.parquet")
    build_tiles(tmp_path / "objects.parquet", tmp_path / "city", tile=TileSpec(100.0))
    out = done("identify", tmp_path / "city", *QUICK, "--json")
    assert json.loads(done("info", tmp_path / "city", "--json"))["identifiability"] == (
        json.loads(out)
    )


def test_an_update_takes_the_columns_away_and_says_so(city: Path, run: Run, done: Done) -> None:
    done("identify", city, *QUICK, "--json")
    save_objects(WORLD.street_objects, city.parent / "objects.parquet")
    code, _, told = run("update", city, "--objects", city.parent / "objects.parquet")
    assert code == 0
    assert "run semsig identify again" in told
    assert "Identifiability" not in done("info", city)
    code, _, told = run("update", city, "--objects", city.parent / "objects.parquet")
    assert code == 0
    assert "identify" not in told


def test_columns_that_do_not_fit_are_told_and_left_out(city: Path, run: Run, done: Done) -> None:
    done("identify", city, *QUICK, "--json")
    whole = open_database(city)
    save_database(whole.select(slice(9, None)), city.parent / "other.parquet")
    stored = City(city).columns("identifiability")
    assert stored is not None
    columns, facts = stored
    City(city.parent / "other.parquet").put_columns(
        "identifiability",
        columns.drop_columns(["cell_id"]).slice(9),
        cell_ids=whole.cell_ids[9:],
        facts=facts,
    )
    code, out, told = run("info", city.parent / "other.parquet")
    assert code == 0
    assert "that of other signatures" in told
    assert "Identifiability" not in out


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (("identify", "--check", 0), ("--check", "from 1")),
        (("identify", "--radius", -1), ("radius of -1.0", "0 or more")),
        (("identify", "--seed", -1), ("seed", "is -1")),
        (("identify", "--threads", 0), ("--threads", "as 0")),
        (("identify", "--noise", "medum"), ("'medum'", "medium")),
        (("map", "--out", "map.html"), ("--identifiability, --ambiguity or --drift",)),
        (("map", "--identifiability", "--out", "m.html"), ("run semsig identify first",)),
        (("map", "--identifiability", "--evaluation", "e", "--out", "m.html"), ("give one",)),
    ],
)
def test_input_that_cannot_be_used(
    command: tuple[object, ...], words: tuple[str, ...], city: Path, run: Run
) -> None:
    before = city.read_bytes()
    sentence(run(command[0], city, *command[1:]), *words)
    assert city.read_bytes() == before


def test_no_database_at_all(tmp_path: Path, run: Run) -> None:
    outcome = run("identify", tmp_path / "nowhere.parquet")
    sentence(outcome, "nowhere.parquet does not exist")
