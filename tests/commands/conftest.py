"""Cities that the commands are run on."""

from __future__ import annotations

import dataclasses
import json
import shutil
import sys
from pathlib import Path

import geopandas as gpd
import numpy as np
import pytest
import shapely
from worlds import random_town, save_town, surroundings

from semsig_gis.cli import main
from semsig_gis.database import open_database, save_database
from semsig_gis.objects import save_objects, save_surroundings

X, Y = 770_000.0, 6_280_000.0
ROWS = [f"{X + 23 * i + 5},{Y + 31 * (i % 3)},DD,{30 + i};{264 + i}" for i in range(15)]
SAMPLES = "\n".join(["x,y,types,bearings", *ROWS, ""]).replace(";", " ")
BOXES = {
    "images": [{"id": 1, "file_name": "a.jpg", "width": 4000, "height": 3000}],
    "categories": [{"id": 15, "name": "bench"}],
    "annotations": [{"id": 1, "image_id": 1, "category_id": 15, "bbox": [900, 1400, 300, 200]}],
}
SPEC = """
database = "city.parquet"
queries = 3
[methods]
paper = "edit+edit:5%"
[distortions]
light = ["light"]
"""


@pytest.fixture(scope="session")
def tiny_city(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a catalogue, two layers, what the commands make of them, and slips."""
    folder = tmp_path_factory.mktemp("city")
    catalog = Path(__file__).with_name("data").joinpath("tiny.toml").read_text(encoding="utf-8")
    for name, text in {
        "tiny.toml": catalog,
        "bad.toml": catalog.replace("where =", "wehre ="),
        "noise.toml": "[confusion.bench]\nbench = 0.5\n",
        "rule.json": '{"threshold": "high"}',
        "jump.jsonl": '{"types": "D"}\n{"types": "D"}\n',
        "placeless.csv": "types,bearings\nD,3\n",
        "far.csv": "x,y,types,bearings\n1,2,D,3\n",
        "samples.csv": SAMPLES,
        "route.jsonl": '{"types": "D"}\n{"types": "D", "dx": 10, "dy": 0, "sigma": 1}\n',
        "boxes.json": json.dumps(BOXES),
        "photo.jpg": "a picture",
        "spec.toml": SPEC,
    }.items():
        (folder / name).write_text(text, encoding="utf-8")
    lights = [shapely.Point(X + 23 * i, Y + 31 * (i % 3)) for i in range(20)]
    crossings = shapely.points([(X + 10, Y + 10), (X + 100, Y + 10)])
    for name, shapes, columns in (
        ("lights.gpkg", [*lights, lights[0]], {"kind": ["a"] * 21}),
        ("crossings.geojson", crossings, {"state": ["painted", "worn"]}),
        ("far.gpkg", [shapely.box(0, 0, 9, 9)], {}),
    ):
        gpd.GeoDataFrame(columns, geometry=shapes, crs=2154).to_file(folder / name)
    for name, east in (("streets", X), ("far", X + 9000)):
        street = surroundings(shapely.LineString([(east, Y), (east + 400, Y)]))
        save_surroundings(street, folder / f"{name}.parquet")
    town = random_town().street_objects
    other = dataclasses.replace(town, table=town.table.to_crs("EPSG:32631"))
    save_objects(other, folder / "other.parquet")
    run_in(
        folder,
        "load . --catalog tiny.toml --out objects.parquet",
        "build objects.parquet --out city.parquet",
        "export city.parquet --out cells.gpkg",
        "evaluate city.parquet --queries 5 --out compared",
    )
    city = open_database(folder / "city.parquet")
    crossing = city.taxonomy.by_name("crossing").code
    sees_none = np.add.reduceat(city.codes == crossing, city.offsets[:-1]) == 0
    save_database(city.select(sees_none), folder / "few.parquet")
    half = (folder / "city.parquet").read_bytes()
    (folder / "half.parquet").write_bytes(half[: len(half) // 2])
    by_likelihood = "--method likelihood --types D"  # which keeps its index
    run_in(folder, *(f"localize {name}.parquet {by_likelihood}" for name in ("city", "few")))
    return folder


def run_in(folder: Path, *lines: str) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for line in lines:
            patch.setattr(sys, "argv", ["semsig", *line.split()])
            with pytest.raises(SystemExit, match=r"^0$"):
                main()


@pytest.fixture
def city(tiny_city: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a copy of the folder, which the command runs in."""
    shutil.copytree(tiny_city, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def town(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with a database and its street objects, which the command runs in."""
    monkeypatch.chdir(tmp_path)
    save_objects(random_town().street_objects, "objects.parquet")
    return save_town(tmp_path).parent
