"""What every format of files does with every layer that it holds, as other programs read it."""

from __future__ import annotations

import dataclasses
import io
import json
import zipfile
from typing import TYPE_CHECKING, Any, NoReturn

import geopandas as gpd
import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pyogrio
import pytest
from pyogrio._err import CPLE_FileIOError
from pyproj import CRS
from sentences import refused
from small_city import chances_of, small_city, small_evaluation, small_ground

from semsig_gis.core import InputError
from semsig_gis.output import (
    FORMATS,
    LAYERS,
    Writer,
    as_written,
    cells_layer,
    export_database,
    export_suffixes,
    layer_names,
    project_archive,
    raster_names,
    shown_layers,
)

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from semsig_gis.output import Layer

CITY, OBJECTS = small_city()
RESULTS: dict[str, Any] = {
    "objects": OBJECTS,
    "evaluation": small_evaluation(),
    "identifiability": chances_of(CITY),
    **small_ground(),
}
OPTIONS: dict[str, tuple[str, ...]] = {
    "cells": ("identifiability",),
    "objects": ("objects",),
    "buildings": ("buildings",),
    "streets": ("streets",),
    "evaluation": ("evaluation",),
    "evaluation_lines": ("evaluation",),
    "hexagons": ("objects", "evaluation", "identifiability"),
}
KEYS: dict[str, tuple[str, ...]] = {
    "cells": ("cell_id",),
    "objects": ("source", "source_id"),
    "buildings": ("name",),
    "streets": ("name",),
    "evaluation": ("seed", "number"),
    "evaluation_lines": ("seed", "number"),
    "hexagons": ("h3",),
}
# Formats of layers that other programs read row by row; `test_tiles.py` reads tiles.
TABLES = [
    name
    for name in FORMATS
    if FORMATS[name].holds in {"layer", "layers"} and not FORMATS[name].layers
]


def layer_of(name: str) -> Layer:
    """Return a layer of the small city."""
    results = {key: RESULTS[key] for key in OPTIONS[name]}
    if name == "hexagons":
        results["resolution"] = 11
    return LAYERS[name](**({} if name == "objects" else {"database": CITY}), **results)


def export(file: Path, layer: str, **options: Any) -> None:  # noqa: ANN401 - as it has
    """Write one layer of the small city."""
    results = {key: RESULTS[key] for key in OPTIONS[layer]}
    options |= {"h3": 11} if layer == "hexagons" else {}
    export_database(CITY, file, layers=layer, **results, **options)


def read(file: Path, layer: Layer) -> gpd.GeoDataFrame:
    """Read a layer as another program does, in the CRS of the layer."""
    if file.suffix == ".csv":
        texts = {name: str for name in layer.names if is_text(layer, name)}
        table = pd.read_csv(file, dtype=texts, keep_default_na=False, na_values=[""])
        if "WKT" in table:
            return gpd.GeoDataFrame(table, geometry=gpd.GeoSeries.from_wkt(table.pop("WKT")))
        x, y = table["x"], table["y"]
        return gpd.GeoDataFrame(table, geometry=gpd.points_from_xy(x, y))
    if file.suffix == ".parquet":
        return gpd.read_parquet(file)
    table = gpd.read_file(file, layer=layer.name)
    return table.to_crs(layer.crs) if file.suffix == ".geojson" else table


def is_text(layer: Layer, name: str) -> bool:
    """Return whether a column holds texts."""
    return str(layer.read(slice(0, 1)).schema.field(name).type) == "string"


@pytest.mark.parametrize("name", [*LAYERS])
@pytest.mark.parametrize("suffix", TABLES)
def test_columns_shapes_and_crs_are_read_back(suffix: str, name: str, tmp_path: Path) -> None:
    file, layer = tmp_path / f"a.{suffix}", layer_of(name)
    point = {"geometry": "polygon"} if name == "cells" and suffix == "csv" else {}
    export(file, name, **point)
    table, expected = read(file, layer), layer.read(slice(0, layer.rows)).to_pandas()
    assert len(table) == len(expected) > 10
    if suffix != "csv":
        assert table.crs == layer.crs
    if suffix == "gpkg" and layer.parts:  # many columns are in a table of their own
        others = gpd.read_file(file, layer=layer.parts[1].name)
        table = table.merge(others, on=["seed", "number"])
    # FlatGeobuf orders the rows along a curve.
    shapes = gpd.GeoSeries.from_wkb(expected.pop("geometry"), crs=table.crs)
    expected = gpd.GeoDataFrame(expected, geometry=shapes)
    table, expected = (rows.sort_values([*KEYS[name]]) for rows in (table, expected))
    shapes = expected.geometry.reset_index(drop=True)
    assert table.geometry.reset_index(drop=True).hausdorff_distance(shapes).max() < 0.02
    for column in layer.names:
        got, want = table[column], expected[column]
        if is_text(layer, column):
            texts = got.fillna("").map(as_written if suffix == "csv" else str)
            assert texts.tolist() == want.fillna("").tolist(), column
        else:
            numbers = pd.to_numeric(got).to_numpy(np.float64)
            assert np.allclose(numbers, want.to_numpy(np.float64), equal_nan=True), column


@pytest.mark.parametrize("name", [*LAYERS])
@pytest.mark.parametrize("suffix", [name for name in TABLES if name != "csv"])
def test_units_licences_and_specs_are_in_the_metadata(
    suffix: str, name: str, tmp_path: Path
) -> None:
    file, layer = tmp_path / f"a.{suffix}", layer_of(name)
    export(file, name)
    if suffix == "parquet":
        metadata = json.loads(pq.read_schema(file).metadata[b"semsig"])
    elif suffix == "geojson":
        metadata = json.loads(file.read_text())["semsig"]
    else:
        texts = pyogrio.read_info(file, layer=name)["layer_metadata"]
        metadata = {key: json.loads(text) for key, text in texts.items() if key.islower()}
    assert metadata["licenses"] == list(layer.licenses)
    plain = json.loads(json.dumps(layer.facts))
    assert {key: metadata[key] for key in plain if key != "kind"} == {
        key: value for key, value in plain.items() if key != "kind"
    }
    described = {column.name: column for column in layer.columns}
    for key in layer.parts[0].names if suffix == "gpkg" and layer.parts else layer.names:
        about = {"title": described[key].title, "unit": described[key].unit}
        assert metadata["columns"][key] == about


@pytest.mark.parametrize("suffix", [*TABLES, "pmtiles"])
def test_progress_ends_at_the_total(suffix: str, tmp_path: Path) -> None:
    steps: list[tuple[int, int]] = []
    export(tmp_path / f"a.{suffix}", "cells", progress=lambda *step: steps.append(step))
    (total,) = {total for _, total in steps}
    assert steps == sorted(steps)
    assert len(steps) > 1
    assert steps[-1] == (total, total)


@pytest.mark.parametrize("suffix", [*TABLES, "pmtiles"])
def test_interruption_leaves_the_old_file(suffix: str, tmp_path: Path) -> None:
    file = tmp_path / f"a.{suffix}"
    export(file, "cells")
    before = file.read_bytes()

    def stop(*_: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        export(file, "cells", progress=stop)
    assert file.read_bytes() == before
    assert [*tmp_path.iterdir()] == [file]


@pytest.mark.parametrize("error", [RuntimeError, CPLE_FileIOError])
@pytest.mark.parametrize("suffix", ["fgb", "geojson", "gpkg", "pmtiles"])
def test_any_error_of_gdal_is_one_sentence(
    suffix: str, error: type[Exception], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / f"a.{suffix}"
    file.write_bytes(b"old")
    failed = error("disk") if error is RuntimeError else error(3, 3, "disk")

    def write(*_: object, **__: object) -> NoReturn:
        raise failed

    monkeypatch.setattr(pyogrio, "write_arrow", write)
    with refused(InputError, file.name, "unchanged"):
        export(file, "cells")
    assert file.read_bytes() == b"old"
    assert [*tmp_path.iterdir()] == [file]


@pytest.mark.parametrize("suffix", TABLES)
def test_layer_without_rows_has_its_columns(suffix: str, tmp_path: Path) -> None:
    evaluation = RESULTS["evaluation"]
    empty = evaluation.queries[evaluation.queries["query_length"] == 0]
    results = dataclasses.replace(evaluation, queries=empty)
    file = tmp_path / f"a.{suffix}"
    export_database(CITY, file, layers="evaluation_lines", evaluation=results)
    table = read(file, layer_of("evaluation_lines"))
    assert len(table) == 0
    assert suffix == "geojson" or {"off_m", "outcome"} <= {*table.columns}


def test_help_names_the_formats_layers_and_rasters() -> None:
    assert export_suffixes() == [f".{name}" for name in FORMATS if FORMATS[name].holds != "answer"]
    evaluated, ground = ["evaluation", "evaluation_lines"], ["buildings", "streets"]
    assert layer_names() == sorted(["cells", "hexagons", "objects", *evaluated, *ground])
    assert raster_names() == ["ambiguity", "error", "field", "identifiability"]


CODE = """
from semsig_gis.output import Writer, table_layer
def write(layer, path, *, progress=None):
    with open(path, "w") as file:
        file.write(f"{layer.name}: {layer.rows}")
lines = Writer(write=write, holds="layer")
def lamps(objects):
    table = objects.table[["source", "geometry"]]
    about = dict(name="lamps", title="Lamps", description="Lamps.", geometry="point")
    return table_layer(table, **about, licenses=(), facts={})
"""


def test_packages_add_formats_and_layers(install: Callable[..., None], tmp_path: Path) -> None:
    install("lamp_files", "semsig_gis.exports", CODE, lines="lines")
    install("lamp_layers", "semsig_gis.layers", CODE, lamps="lamps")
    export_database(CITY, tmp_path / "a.lines", layers="lamps", objects=OBJECTS)
    assert (tmp_path / "a.lines").read_text() == f"lamps: {len(OBJECTS)}"
    assert isinstance(FORMATS["lines"], Writer)
    export_database(CITY, tmp_path / "a.gpkg", objects=OBJECTS)
    assert "lamps" in pyogrio.list_layers(tmp_path / "a.gpkg")[:, 0]


def test_format_of_another_package_does_not_replace_ours(
    install: Callable[..., None], tmp_path: Path
) -> None:
    install("other_files", "semsig_gis.exports", CODE, csv="lines")
    with refused(InputError, "'csv' of semsig_gis.exports is provided by semsig_gis itself"):
        export_database(CITY, tmp_path / "b.lines")


@pytest.mark.parametrize("suffix", ["gpkg", "fgb"])
def test_crs_that_is_only_similar_to_a_code_is_kept(suffix: str, tmp_path: Path) -> None:
    # PROJ finds the code 25831 for it, which has another datum.
    similar = CRS("+proj=utm +zone=31 +ellps=GRS80 +units=m")
    city = dataclasses.replace(CITY, crs=similar)
    export_database(city, tmp_path / f"a.{suffix}", layers="cells")
    assert gpd.read_file(tmp_path / f"a.{suffix}", layer="cells").crs.equals(similar)
    layers = [cells_layer(city)]
    with zipfile.ZipFile(
        io.BytesIO(project_archive(layers, shown_layers(layers, "a"), "a"))
    ) as file:
        assert b"EPSG:25831" not in file.read("project.qgs")
