"""Picking a format by the suffix of the file: what each holds, and what is refused."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import geopandas as gpd
import pandas as pd
import pyogrio
import pytest
from cells_told import told_of
from sentences import assert_sentence
from small_city import small_city, small_evaluation, small_localization, small_location

from semsig_gis.errors import InputError, SemsigError, UnknownNameError
from semsig_gis.exports import LAYERS, RASTERS, export_answer, export_database

if TYPE_CHECKING:
    from pathlib import Path


def everything() -> dict[str, Any]:
    database, objects = small_city()
    return {
        "objects": objects,
        "evaluation": small_evaluation(),
        "identifiability": told_of(database),
    }


def test_a_geopackage_holds_all(tmp_path: Path) -> None:
    file = tmp_path / "CITY.GPKG"
    export_database(small_city()[0], file, geometry="point", **everything())
    layers = dict(pyogrio.list_layers(file).tolist())
    assert {name: layers[name] for name in LAYERS} == {
        "cells": "Point",
        "objects": "Point",
        "evaluation": "Point",
        "evaluation_lines": "LineString",
    }


def test_a_geopackage_holds_what_is_named(tmp_path: Path) -> None:
    file = tmp_path / "queries.gpkg"
    wanted = ["evaluation", "evaluation_lines"]
    export_database(small_city()[0], file, layers=wanted, evaluation=small_evaluation())
    assert pyogrio.list_layers(file)[:, 0].tolist() == [*wanted, "layer_styles"]


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
@pytest.mark.parametrize("layer", LAYERS)
def test_other_files_hold_one(layer: str, suffix: str, tmp_path: Path) -> None:
    database, objects = small_city()
    file = tmp_path / f"a{suffix}"
    given = {
        "cells": {},
        "objects": {"objects": objects},
    }.get(layer, {"evaluation": small_evaluation()})
    export_database(database, file, layers=[layer], **given)
    read = pd.read_csv(file) if suffix == ".csv" else gpd.read_parquet(file)
    column = {"cells": "bearings", "objects": "source_id", "evaluation": "query_types"}
    assert column.get(layer, "off_m") in read.columns
    queries = small_evaluation()
    rows = {"cells": len(database), "objects": len(objects), "evaluation": len(queries.queries)}
    assert len(read) == rows.get(layer, len(queries.queries) - queries.unlocalized)


def test_regions_of_an_answer(tmp_path: Path) -> None:
    database, location = small_city()[0], small_location()
    found = export_answer(location, database, tmp_path / "a.parquet", share=0.99, within=20.0)
    read = gpd.read_parquet(tmp_path / "a.parquet")
    assert read.geometry.geom_equals(found.table.geometry).all()
    assert read["searched_km2"].iloc[-1] == found.to_dict()["km2"]
    export_answer(location, database, tmp_path / "a.csv", share=0.99, within=20.0)
    texts = pd.read_csv(tmp_path / "a.csv")
    shapes = gpd.GeoSeries.from_wkt(texts["WKT"])
    assert shapes.geom_equals(found.table.geometry.set_crs(None, allow_override=True)).all()
    assert texts["chance"].tolist() == found.table["chance"].tolist()


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("city.shp", {}, ("city.shp", ".gpkg, .parquet, .csv or .tif")),
        ("city", {}, ("does not end in",)),
        ("city.gpkg", {"layers": ["cell"]}, ("'cell'", "the nearest is 'cells'")),
        ("city.gpkg", {"layers": ["cells", "objects"]}, ("no objects",)),
        ("city.gpkg", {"layers": ["cells"], "objects": 1}, ("cells alone", "no objects")),
        ("city.csv", {"layers": ["cells", "objects"], "objects": 1}, ("one layer", "GeoPackage")),
        ("city.csv", {"layers": ["object"]}, ("'object'", "the nearest is 'objects'")),
        ("city.csv", {"layers": ["ambiguity"]}, ("'ambiguity'", *LAYERS)),
        ("city.tif", {"layers": ["cells"]}, ("'cells'", *RASTERS)),
        ("city.csv", {"layers": ["objects"]}, ("no objects",)),
        ("city.parquet", {"layers": ["evaluation_lines"]}, ("no evaluation",)),
        ("city.tif", {"layers": ["identifiability"]}, ("no identifiability",)),
        ("city.tif", {"layers": ["error"]}, ("no evaluation",)),
        ("city.csv", {"objects": 1, "evaluation": 1}, ("cells alone", "no evaluation or objects")),
        ("city.tif", {"layers": ["error"], "evaluation": 1, "objects": 1}, ("error alone",)),
        ("city.gpkg", {"geometry": "square"}, ("'square'", "'polygon' or 'point'")),
    ],
)
def test_what_does_not_fit_is_refused(
    name: str, options: dict[str, Any], words: tuple[str, ...], tmp_path: Path
) -> None:
    given = {key: everything()[key] if value == 1 else value for key, value in options.items()}
    with pytest.raises((InputError, UnknownNameError)) as caught:
        export_database(small_city()[0], tmp_path / name, **given)
    assert_sentence(caught.value, *words)
    assert not list(tmp_path.iterdir())


def test_answers_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    database = small_city()[0]
    with pytest.raises(InputError) as caught:
        export_answer(small_localization(), database, tmp_path / "a.tif")
    assert_sentence(caught.value, "a.tif", "likelihood")
    with pytest.raises(InputError) as caught:
        export_answer(small_location(), database, tmp_path / "a.geojson")
    assert_sentence(caught.value, "a.geojson", ".gpkg")


@pytest.mark.parametrize("suffix", [".gpkg", ".parquet", ".csv", ".tif"])
def test_a_folder_that_cannot_be_written(suffix: str, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("here")
    with pytest.raises(SemsigError) as caught:
        export_database(small_city()[0], tmp_path / "file" / f"city{suffix}")
    assert_sentence(caught.value, f"city{suffix}", "folder")
    (tmp_path / f"b{suffix}").mkdir()
    with pytest.raises(SemsigError) as caught:
        export_database(small_city()[0], tmp_path / f"b{suffix}")
    assert_sentence(caught.value, f"b{suffix} is a folder")
    assert (tmp_path / "file").read_text() == "here"
