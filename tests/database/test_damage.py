"""Files with one changed byte: refused, or read unchanged."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import shapely
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mutations import with_mistakes
from sentences import assert_sentence, refused
from worlds import ARRAYS, CORNER, random_town

from semsig_gis.core import DatabaseError, SemsigError
from semsig_gis.database import (
    build_database,
    build_tiles,
    database_specs,
    open_city,
    open_database,
    save_database,
)
from semsig_gis.database.tile_inputs import widest_street
from semsig_gis.evaluation import (
    evaluate,
    identify,
    open_evaluation,
    open_identifiability,
    save_evaluation,
    save_identifiability,
)
from semsig_gis.localization import build_index, named_noise
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
LONGEST = 400  # characters of a message with a path


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


def identified_in(path: Path) -> object:
    database = open_city(path).database
    cells = open_identifiability(database, path)
    return None if cells is None else str(cells.table().to_pydict())


def save_identified(path: Path) -> None:
    save_database(TOWN.database, path)
    index = build_index(TOWN.database, named_noise("light"))
    save_identifiability(identify(index, trials=5, class_trials=2), path)


FILES: dict[str, tuple[Callable[[Path], None], Callable[[Path], object]]] = {
    "city.parquet": (lambda path: save_database(TOWN.database, path), database_in),
    "objects.parquet": (lambda path: save_objects(TOWN.street_objects, path), objects_in),
    "houses.parquet": (lambda path: save_surroundings(HOUSES, path), houses_in),
    "identified.parquet": (save_identified, identified_in),
    "queries.parquet": (
        lambda path: save_evaluation(evaluate(TOWN.database, queries=5), path.parent),
        evaluation_in,
    ),
}
KINDS = [pa.uint8(), pa.int64(), pa.float64(), pa.bool_(), pa.string(), pa.binary(), pa.date32()]
KINDS += [pa.large_string(), pa.list_(pa.uint16()), pa.struct({"a": pa.int8()}), pa.null()]
VALUES = [0, 1, -5, 300, 2**60, 1.5, float("nan"), float("inf"), "", "x", "7", b"x", [], [3]]


@pytest.fixture(scope="module")
def intact(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return one file of each kind."""
    folder = tmp_path_factory.mktemp("intact")
    for name, (save, _) in FILES.items():
        save(folder / name)
    return {name: folder / name for name in FILES}


@st.composite
def _with_other_content(draw: st.DrawFn, table: pa.Table) -> pa.Table:
    """Return a table with another JSON value in its metadata, or with other values in a column."""
    documents = {key: json.loads(text) for key, text in table.schema.metadata.items()}
    if draw(st.booleans()):
        key = draw(st.sampled_from([*documents]))
        names = [*documents[key], "geometry", "columns", "bbox", "crs", "primary_column"]
        changed = draw(with_mistakes(documents[key], *names))
        text = json.dumps(changed, default=str).encode()
        return table.replace_schema_metadata({**table.schema.metadata, key: text})
    field = draw(st.sampled_from([*table.schema]))
    kind = draw(st.sampled_from([field.type, *KINDS]))
    values = table[field.name].to_pylist() if kind == field.type else [None] * len(table)
    value = draw(st.sampled_from([None, *VALUES]))
    rows = draw(st.sampled_from([range(1), range(len(table))]))
    for row in rows:
        values[row] = value
    try:
        column = pa.array(values, kind)
    except (pa.ArrowException, TypeError, ValueError, OverflowError):
        column = pa.nulls(len(table), kind)
    return table.set_column(table.column_names.index(field.name), field.name, column)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("name", FILES)
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_other_metadata_and_columns_are_read_or_refused_in_a_sentence(
    name: str, intact: dict[str, Path], data: st.DataObject
) -> None:
    table = pq.read_table(intact[name])
    folder = intact[name].parent / "changed"
    folder.mkdir(exist_ok=True)
    pq.write_table(data.draw(_with_other_content(table)), folder / name)
    try:
        FILES[name][1](folder / name)
    except SemsigError as error:
        assert_sentence(error)
        message = str(error)
    else:
        message = ""
    assert len(message) < LONGEST


def test_street_objects_without_source_or_identifier_have_empty_ones(
    intact: dict[str, Path], tmp_path: Path
) -> None:
    path, table = tmp_path / "objects.parquet", pq.read_table(intact["objects.parquet"])
    for name in ("source", "source_id"):
        place = table.column_names.index(name)
        for column in (pa.nulls(len(table)), pa.array(["a", *[None] * (len(table) - 1)])):
            pq.write_table(table.set_column(place, name, column), path)
            objects = open_objects(path)
            assert objects.table[name].iloc[-1] == ""
            assert len(build_database(objects)) == len(TOWN.database)
            save_objects(objects, path)
            assert open_objects(path).table[name].iloc[-1] == ""


def test_widths_of_streets_that_are_no_numbers_are_named(tmp_path: Path) -> None:
    lines = HOUSES.set_geometry(HOUSES.boundary).assign(half_width=["4.5", "wide", None])
    save_surroundings(lines, tmp_path / "streets.parquet")
    remarks: list[str] = []
    streets = read_surroundings(
        tmp_path / "streets.parquet", role="streets", crs="EPSG:2154", remark=remarks.append
    )
    assert streets["half_width"].fillna(0).tolist() == [4.5, 0, 0]
    assert "half_width is no number in 1 rows" in remarks[0]
    assert widest_street(tmp_path / "streets.parquet") == 4.5


@pytest.mark.parametrize("name", [name for name in FILES if name != "identified.parquet"])
def test_a_changed_byte_is_detected_or_has_no_effect(tmp_path: Path, name: str) -> None:
    path, (save, content) = tmp_path / name, FILES[name]
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
