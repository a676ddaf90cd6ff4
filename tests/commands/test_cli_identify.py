"""Identifiability in the commands identify, info, map, export and update."""

from __future__ import annotations

import functools
import json
from pathlib import Path
from typing import TYPE_CHECKING

import geopandas as gpd
import pytest
from worlds import random_town

from semsig_gis.database import (
    City,
    ObjectStore,
    TileSpec,
    build_tiles,
    open_database,
    open_store,
    save_database,
    save_with_store,
)
from semsig_gis.evaluation.identifiability import analysis
from semsig_gis.objects import save_objects

if TYPE_CHECKING:
    from conftest import Run, RunOk

# Few classes, since each class is left out once.
WORLD = random_town(codes=[1, 3, 10])
IDENTIFY = "identify city.parquet --on-grid --noise medium --json"


@pytest.fixture(autouse=True)
def _city(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run few trials, in a folder with a database and its street objects."""
    few = functools.partial(analysis.identify, trials=60, class_trials=5)
    monkeypatch.setattr(analysis, "identify", few)
    monkeypatch.chdir(tmp_path)
    save_objects(WORLD.street_objects, "objects.parquet")
    save_with_store(WORLD.database, ObjectStore.of(WORLD.street_objects), "city.parquet")


def test_columns_are_printed_drawn_and_exported(run: Run, run_ok: RunOk) -> None:
    code, out, err = run("identify city.parquet --noise medium --check 40 --tables")
    assert code == 0
    for words in ("Identifiability, medium noise", "What each class adds", "by 1,000 objects",
                  "bits left", "Do the chances come true?", "Rank correlation",
                  "columns: "):  # fmt: skip
        assert words in out
    cells = gpd.read_parquet("city.parquet")
    assert cells["chance_found"].between(0, 1).all()
    assert len(open_store("city.parquet").objects) == len(WORLD.street_objects)

    code, out, err = run("identify city.parquet --noise medium --json")
    assert (code, "already has these columns" in err) == (0, True)
    facts = json.loads(out)
    assert facts["chance_found"] == pytest.approx(cells["chance_found"].mean())
    assert facts["classes"][0]["objects"] > 0
    assert json.loads(run_ok("info city.parquet --json"))["identifiability"] == facts
    assert "Identifiability, medium noise" in run_ok("info city.parquet --tables")
    assert "From the mean cell, a query is placed within 50 m" in run_ok("info city.parquet")

    run_ok("map city.parquet --identifiability --out map.html")
    assert "Where a query can be placed" in Path("map.html").read_text(encoding="utf-8")
    run_ok("export city.parquet --out city.gpkg")
    exported = gpd.read_file("city.gpkg", layer="cells")
    assert exported["chance_found"].tolist() == cells["chance_found"].tolist()


def test_other_settings_are_computed_again(run: Run, run_ok: RunOk) -> None:
    options = "--threads 2 --check 20"
    first = json.loads(run_ok(IDENTIFY, *options.split()))
    assert (first["seed"], first["radius_m"], first["check"]["seed"]) == (0, 50.0, 1)
    for line in (
        f"{IDENTIFY} {options} --seed 3",
        f"{IDENTIFY} {options} --radius 20",
        f"{IDENTIFY} {options} --noise light",
        f"{IDENTIFY} {options} --view 70",
        f"identify city.parquet --noise medium --json {options}",
    ):
        code, out, err = run(line)
        assert (code, "already" in err) == (0, False)
        assert json.loads(out) != first


def test_view_of_photos_is_shown(run_ok: RunOk) -> None:
    assert "From the mean cell, a photo of 70 degrees is placed" in run_ok(
        "identify city.parquet --noise medium --view 70 --check 20 --out report"
    )
    assert json.loads(run_ok("info city.parquet --json"))["identifiability"]["view_degrees"] == 70.0
    assert "photo of 70 degrees" in run_ok("info city.parquet")
    run_ok("map city.parquet --identifiability --out map.html")
    for page in ("map.html", "report/report.html"):
        assert "photo of 70 degrees" in Path(page).read_text(encoding="utf-8")


def test_tiles_get_columns(run_ok: RunOk) -> None:
    build_tiles("objects.parquet", "city", tile=TileSpec(100.0))
    facts = json.loads(run_ok(IDENTIFY.replace("city.parquet", "city")))
    assert json.loads(run_ok("info city --json"))["identifiability"] == facts


def test_update_removes_the_columns_with_a_remark(run: Run, run_ok: RunOk) -> None:
    run_ok(IDENTIFY)
    for first in (True, False):
        code, _, err = run("update city.parquet --objects objects.parquet")
        assert (code, "run semsig identify again" in err, "identify" in err) == (0, first, first)
        assert "Identifiability" not in run_ok("info city.parquet")


def test_columns_of_another_database_are_ignored_with_a_remark(run: Run, run_ok: RunOk) -> None:
    run_ok(IDENTIFY)
    whole = open_database("city.parquet")
    save_database(whole.select(slice(9, None)), "other.parquet")
    stored = City("city.parquet").columns("identifiability")
    assert stored is not None
    columns, facts = stored
    columns = columns.drop_columns(["cell_id"]).slice(9)
    City("other.parquet").put_columns(
        "identifiability", columns, cell_ids=whole.cell_ids[9:], facts=facts
    )
    code, out, err = run("info other.parquet")
    assert (code, "belongs to other signatures" in err) == (0, True)
    assert "Identifiability" not in out
