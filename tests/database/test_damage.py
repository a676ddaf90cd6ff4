"""Files with one changed byte: refused, or read unchanged."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
import pytest
import shapely
from sentences import assert_sentence, refused
from worlds import ARRAYS, CORNER, random_town

from semsig_gis.core import DatabaseError, SemsigError
from semsig_gis.database import build_tiles, database_specs, open_database, save_database
from semsig_gis.evaluation import evaluate, open_evaluation, save_evaluation
from semsig_gis.objects import (
    objects_specs,
    open_objects,
    read_surroundings,
    save_objects,
    save_surroundings,
)

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

TOWN = random_town(count=20, side=60.0)
HOUSES = gpd.GeoDataFrame(
    {"half_width": [1.0, 2.0, 3.0]},
    geometry=[shapely.box(*(CORNER + 20 * i), *(CORNER + 20 * i + 9)) for i in range(3)],
    crs="EPSG:2154",
)
TRIES = 60


def database_in(path: Path) -> object:
    database = open_database(path)
    arrays = [getattr(database, name).tolist() for name in ARRAYS]
    return database_specs(database), database.crs.to_json(), arrays


def objects_in(path: Path) -> object:
    objects = open_objects(path)
    table = objects.table.drop(columns="geometry").to_dict("list")
    return objects_specs(objects), objects.crs.to_json(), objects.xy.tolist(), table


def houses_in(path: Path) -> object:
    houses = read_surroundings(path, role="buildings", crs="EPSG:2154")
    return houses.to_wkb().to_dict("list"), houses.attrs


def evaluation_in(path: Path) -> object:
    evaluation = open_evaluation(path.parent)
    return str(evaluation.queries.to_wkb().to_dict("list")), evaluation.summary()


@pytest.mark.parametrize(
    ("name", "save", "content"),
    [
        ("city.parquet", lambda path: save_database(TOWN.database, path), database_in),
        ("objects.parquet", lambda path: save_objects(TOWN.street_objects, path), objects_in),
        ("houses.parquet", lambda path: save_surroundings(HOUSES, path), houses_in),
        (
            "queries.parquet",
            lambda path: save_evaluation(evaluate(TOWN.database, queries=5), path.parent),
            evaluation_in,
        ),
    ],
)
def test_a_changed_byte_is_detected_or_has_no_effect(
    tmp_path: Path, name: str, save: Callable[[Path], None], content: Callable[[Path], object]
) -> None:
    path = tmp_path / name
    save(path)
    intact, expected = path.read_bytes(), content(path)
    rng = np.random.default_rng(17)
    detected = 0
    for _ in range(TRIES):
        changed = bytearray(intact)
        changed[rng.integers(len(intact))] ^= int(rng.integers(1, 256))
        path.write_bytes(changed)
        try:
            assert content(path) == expected
        except SemsigError as error:
            assert_sentence(error, name)
            detected += 1
    assert detected > TRIES // 2


def test_a_changed_number_in_a_manifest_is_detected(tmp_path: Path) -> None:
    save_objects(TOWN.street_objects, tmp_path / "objects.parquet")
    folder = tmp_path / "city"
    build_tiles(tmp_path / "objects.parquet", folder)
    manifest = folder / "_manifest.json"
    text = manifest.read_text()
    manifest.write_text(text.replace('"entries": ', '"entries": 1'))
    with refused(DatabaseError, "_manifest.json is damaged"):
        open_database(folder)
    old = json.loads(text)
    del old["sum"]  # as in older versions
    manifest.write_text(json.dumps(old))
    assert len(open_database(folder)) == len(TOWN.database)
