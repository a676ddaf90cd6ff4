"""The commands export and import, and localize --out."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pyogrio
import pytest
import rasterio
from sentences import sentence
from small_city import chances_of, small_city, small_evaluation

from semsig_gis.database import ObjectStore, open_database, save_database, save_with_store
from semsig_gis.evaluation import save_evaluation, save_identifiability
from semsig_gis.localization import Localization, localize
from semsig_gis.objects import open_objects, save_objects
from semsig_gis.observation import parse_view
from semsig_gis.output import answer_summary, cell_errors

if TYPE_CHECKING:
    from conftest import Run, RunOk


@pytest.fixture(autouse=True)
def _city(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run in a folder with a database with its identifiability, objects and an evaluation."""
    monkeypatch.chdir(tmp_path)
    database, objects = small_city()
    # Saved twice: a coordinate system that was read has another text than one that was named.
    save_database(database, "city.parquet")
    save_database(open_database("city.parquet"), "city.parquet")
    save_identifiability(chances_of(database), "city.parquet")
    save_objects(objects, "objects.parquet")
    save_objects(open_objects("objects.parquet"), "objects.parquet")
    save_evaluation(small_evaluation(), "evaluation")


def test_city_is_exported_to_a_geopackage_and_imported(run: Run) -> None:
    more = "--objects objects.parquet --evaluation evaluation"
    code, out, err = run(f"export city.parquet --out city.gpkg {more}")
    assert (code, err, "city.gpkg" in out) == (0, "", True)
    assert set(pyogrio.list_layers("city.gpkg")[:, 0]) == {
        *("cells", "objects", "evaluation", "evaluation_lines"),
        *("evaluation_figures", "layer_styles"),
    }
    code, out, err = run("import city.gpkg --out back.parquet --objects back_objects.parquet")
    assert (code, err, f"{len(small_city()[0]):,} cells" in out) == (0, "", True)
    # With the columns of semsig identify.
    again, before = pq.read_table("back.parquet"), pq.read_table("city.parquet")
    assert again.equals(before)
    assert again.schema.metadata == before.schema.metadata
    assert Path("back_objects.parquet").read_bytes() == Path("objects.parquet").read_bytes()


def test_single_layers_are_exported(run_ok: RunOk) -> None:
    run_ok("export city.parquet --out cells.csv")
    assert "chance_found" in pd.read_csv("cells.csv").columns
    run_ok("export city.parquet --geometry point --out p.parquet")
    assert set(gpd.read_parquet("p.parquet").geom_type) == {"Point"}
    run_ok("export city.parquet --evaluation evaluation --layer error --out e.tif")
    expected = cell_errors(small_evaluation(), small_city()[0]).astype("float32")
    np.testing.assert_array_equal(raster_values("e.tif"), expected)


def raster_values(path: str) -> list[float]:
    """Return the value of a raster at every cell of the city."""
    with rasterio.open(path) as raster:
        return [value[0] for value in raster.sample(small_city()[0].xy)]


@pytest.mark.parametrize("method", ["edit+edit", "likelihood"])
def test_regions_to_search_are_written(method: str, run_ok: RunOk) -> None:
    types = small_city()[0].types(7)
    line = f"localize city.parquet --types {types} --method {method} --out answer.gpkg"
    out = run_ok(line, "--within", 15)
    assert "km²" in out
    assert "% of the city" in out
    searched = json.loads(run_ok(line, "--json"))["searched"]
    regions = gpd.read_file("answer.gpkg", layer="regions")
    assert regions["cells"].sum() == searched["cells"]
    assert regions.geometry.area.sum() == pytest.approx(searched["km2"] * 1e6)


def test_chances_of_all_cells_are_written(run_ok: RunOk) -> None:
    out = run_ok("localize city.parquet --types DD --method likelihood --out p.tif")
    assert out.splitlines()[-1] == "chances: p.tif"
    assert sum(raster_values("p.tif")) == pytest.approx(1.0, abs=1e-4)


def test_ties_with_the_last_candidate_are_searched(run: Run) -> None:
    query = "localize city.parquet --method edit+edit --types DD --require D --top 2"
    code, out, err = run(query, "--map", "m.html", "--out", "a.gpkg", "--json")
    assert (code, err) == (0, "")
    answer = json.loads(out)
    assert answer["tied_beyond"] > 0
    # All cells that tie with the last candidate are in the file.
    candidates = gpd.read_file("a.gpkg", layer="candidates")
    assert answer["searched"]["cells"] == len(candidates) == 2 + answer["tied_beyond"]
    assert len(set(candidates["distance"])) == 1


@pytest.mark.parametrize(("tied", "words"), [(1, "1 further cell ties"), (1200, "1,200 further")])
def test_number_of_ties_is_printed(tied: int, words: str) -> None:
    database, _ = small_city()
    query = parse_view({"types": "D"}, taxonomy=database.taxonomy, radius=30.0)
    answer = localize(database, query, method="types:edit", top=1)
    assert isinstance(answer, Localization)
    parts = answer_summary(dataclasses.replace(answer, tied_beyond=tied))
    assert any(str(part).startswith(words) for part in parts)


def test_formats_of_other_programs_are_exported(run: Run, run_ok: RunOk) -> None:
    hexagons = "--objects objects.parquet --evaluation evaluation --h3 10"
    run_ok(f"export city.parquet {hexagons} --out hexagons.geojson")
    table = gpd.read_file("hexagons.geojson")
    assert table["cells"].sum() == len(small_city()[0])
    assert {"chance_found", "objects", "queries", "found"} <= set(table.columns)
    save_with_store(small_city()[0], ObjectStore.of(small_city()[1]), "stored.parquet")
    run_ok("export stored.parquet --h3 10 --out stored.fgb")
    assert gpd.read_file("stored.fgb")["objects"].sum() == len(small_city()[1])
    run_ok("export city.parquet --out cells.pmtiles")
    assert Path("cells.pmtiles").read_bytes()[:8] == b"PMTiles\x03"
    run_ok("export city.parquet --objects objects.parquet --out city.json")
    assert set(json.loads(Path("city.json").read_text())["assets"]) == {"database", "objects"}
    sentence(run("export city.parquet --h3 9 --out city.json"), "city.json", "--objects")
    sentence(run("export city.parquet --h3 16 --out a.fgb"), "--h3", "16")
