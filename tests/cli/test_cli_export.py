"""Exports as their user meets them: export, import, and localize --out."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import geopandas as gpd
import pandas as pd
import pyarrow.parquet as pq
import pyogrio
import pytest
import rasterio
from cells_told import told_of
from sentences import sentence
from small_city import small_city, small_evaluation

from semsig_gis.cli.localize import print_answer
from semsig_gis.database.file import open_database, save_database
from semsig_gis.evaluation.file import save_evaluation
from semsig_gis.evaluation.identify.result import save_identifiability
from semsig_gis.exports.geotiff import cell_errors
from semsig_gis.objects.table import open_objects, save_objects

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Done, Run


@pytest.fixture
def city(tmp_path: Path) -> Path:
    """Return a database with its identifiability, and objects and an evaluation beside it."""
    database, objects = small_city()
    path = tmp_path / "city.parquet"
    save_database(database, path)
    # A coordinate system that was read tells of itself in other words than one that was named.
    save_database(open_database(path), path)
    save_identifiability(told_of(database), path)
    save_objects(objects, tmp_path / "objects.parquet")
    save_objects(open_objects(tmp_path / "objects.parquet"), tmp_path / "objects.parquet")
    save_evaluation(small_evaluation(), tmp_path / "evaluation")
    return path


def test_a_city_goes_into_a_geopackage_and_back(city: Path, run: Run) -> None:
    folder = city.parent
    more = ("--objects", folder / "objects.parquet", "--evaluation", folder / "evaluation")
    code, out, err = run("export", city, *more, "--out", folder / "city.gpkg")
    assert (code, err) == (0, "")
    assert "city.gpkg" in out
    assert set(pyogrio.list_layers(folder / "city.gpkg")[:, 0]) == {
        *("cells", "objects", "evaluation", "evaluation_lines", "layer_styles")
    }
    back = folder / "back.parquet"
    objects = ("--objects", folder / "back_objects.parquet")
    code, out, err = run("import", folder / "city.gpkg", "--out", back, *objects)
    assert (code, err) == (0, "")
    assert f"{len(small_city()[0]):,} cells" in out
    # With the columns that semsig identify put there, of which a -0.0 comes back as 0.0.
    again, before = pq.read_table(back), pq.read_table(city)
    assert again.equals(before)
    assert again.schema.metadata == before.schema.metadata
    assert (folder / "back_objects.parquet").read_bytes() == (
        folder / "objects.parquet"
    ).read_bytes()


def test_one_layer(city: Path, done: Done) -> None:
    folder = city.parent
    database = small_city()[0]
    done("export", city, "--out", folder / "cells.csv")
    assert "chance_found" in pd.read_csv(folder / "cells.csv").columns
    done("export", city, "--geometry", "point", "--out", folder / "p.parquet")
    assert set(gpd.read_parquet(folder / "p.parquet").geom_type) == {"Point"}
    evaluation = ("--evaluation", folder / "evaluation", "--layer", "error")
    done("export", city, *evaluation, "--out", folder / "e.tif")
    with rasterio.open(folder / "e.tif") as read:
        found = [value[0] for value in read.sample(database.xy)]
    expected = cell_errors(small_evaluation(), database).astype("float32")
    assert pd.Series(found).equals(pd.Series(expected))


@pytest.mark.parametrize("method", ["edit+edit", "likelihood"])
def test_what_must_be_searched_after_a_query(method: str, city: Path, done: Done) -> None:
    query = ("--types", small_city()[0].types(7), "--method", method)
    out = city.parent / "answer.gpkg"
    printed = done("localize", city, *query, "--out", out, "--within", 15)
    assert "km2" in printed
    assert "% of the city" in printed
    told = json.loads(done("localize", city, *query, "--out", out, "--json"))["searched"]
    regions = gpd.read_file(out, layer="regions")
    assert regions["cells"].sum() == told["cells"]
    assert regions.geometry.area.sum() == pytest.approx(told["km2"] * 1e6)


def test_the_chance_of_every_cell(city: Path, run: Run) -> None:
    query = ("--types", "DD", "--method", "likelihood")
    code, out, _ = run("localize", city, *query, "--out", city.parent / "p.tif")
    assert (code, out.splitlines()[-1]) == (0, f"chances: {city.parent / 'p.tif'}")
    with rasterio.open(city.parent / "p.tif") as read:
        values = [value[0] for value in read.sample(small_city()[0].xy)]
    assert sum(values) == pytest.approx(1.0, abs=1e-4)


def test_what_is_required_may_be_drawn_and_searched(city: Path, run: Run) -> None:
    folder = city.parent
    files = ("--map", folder / "m.html", "--out", folder / "a.gpkg")
    query = ("--types", "DD", "--require", "D", "--top", 2)
    code, out, err = run("localize", city, *query, *files, "--json")
    assert (code, err) == (0, "")
    told = json.loads(out)
    assert told["tied_beyond"] > 0
    # All that are as good as the last candidate are to be searched, and are in the file.
    candidates = gpd.read_file(folder / "a.gpkg", layer="candidates")
    assert told["searched"]["cells"] == len(candidates) == 2 + told["tied_beyond"]
    assert len(set(candidates["distance"])) == 1


@pytest.mark.parametrize(("tied", "said"), [(1, "1 further cell ties"), (1200, "1,200 further")])
def test_how_many_cells_tie_is_said(
    tied: int, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    print_answer({"used": "types", "cells": 5000, "candidates": [], "tied_beyond": tied})
    assert f"\n{said}" in capsys.readouterr().out


def test_a_slip_is_told_before_the_index_is_built(city: Path, run: Run) -> None:
    likely = ("--method", "likelihood")
    sentence(run("localize", city, "--types", "D!", *likely), "'!'")
    sentence(run("localize", city, *likely), "types, bearings or both")
    assert not list(city.parent.glob("*.likelihood"))


def test_what_does_not_go_together(city: Path, run: Run, done: Done) -> None:
    folder = city.parent
    out = ("--out", folder / "a.gpkg")
    likely = ("--method", "likelihood")
    refused = (
        (("export", city, "--layer", "objects", *out), "no objects"),
        (("export", city, "--out", folder / "a.txt"), ".gpkg, .parquet, .csv or .tif"),
        (("export", city, "--evaluation", folder / "nowhere", *out), "does not exist"),
        (("localize", city, "--types", "D", "--within", 5), "--out"),
        (("localize", city, "--types", "D", "--share", 0.5, *out), "likelihood"),
        (("localize", city, "--queries", "-", *out), "--out"),
        (("localize", city, "--types", "D", "--out", folder / "a.tif"), "likelihood"),
        (("localize", city, "--types", "D", "--within", -1, *out), "metres, 0 or more"),
        (
            ("localize", city, "--types", "D", *likely, "--share", 0.5, "--out", folder / "a.tif"),
            "chances of all cells",
        ),
        (("import", folder / "nowhere.gpkg", "--out", folder / "b.parquet"), "does not exist"),
        (("import", city, "--out", folder / "b.parquet"), "not written by semsig export"),
    )
    for command, words in refused:
        sentence(run(*command), words)
    done("export", city, *out)
    more = ("--objects", folder / "o.parquet")
    sentence(run("import", folder / "a.gpkg", "--out", folder / "b.parquet", *more), "holds no")
    assert not (folder / "b.parquet").exists()


def test_nothing_is_written_over_what_is_read(city: Path, run: Run) -> None:
    folder = city.parent
    objects = folder / "objects.parquet"
    refused: tuple[tuple[object, ...], ...] = (
        ("export", city, "--out", city),
        ("export", city, "--objects", objects, "--layer", "objects", "--out", objects),
        ("map", city, "--ambiguity", "--out", folder / "x" / ".." / city.name),
        ("localize", city, "--types", "D", "--map", city),
        ("localize", city, "--types", "D", "--map", folder / "m", "--out", folder / "m"),
        ("build", objects, "--out", objects),
        ("import", folder / "a.gpkg", "--out", folder / "a.gpkg"),
        ("learn", city, "--samples", folder / "s.csv", "--out", folder / "s.csv"),
    )
    before = city.read_bytes()
    for command in refused:
        sentence(run(*command), "to be written", "also another file")
        assert city.read_bytes() == before


def test_a_name_says_what_a_file_will_be(city: Path, run: Run) -> None:
    folder = city.parent
    for command in (
        ("build", folder / "objects.parquet", "--out", folder / "city.gpkg"),
        ("map", city, "--ambiguity", "--out", folder / "map.png"),
        ("import", folder / "a.gpkg", "--out", folder / "b.gpkg"),
    ):
        sentence(run(*command), "must end in .")
