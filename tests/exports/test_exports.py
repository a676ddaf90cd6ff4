"""Picking a format by the suffix of the file: what each holds, and what is refused."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import geopandas as gpd
import pandas as pd
import pyogrio
import pytest
import shapely
from cells_told import told_of
from sentences import assert_sentence
from small_city import small_city, small_evaluation, small_localization, small_location

from semsig_gis.core.errors import EmptyResultError, InputError, SemsigError, UnknownNameError
from semsig_gis.exports import LAYERS, RASTERS, export_answer, export_database
from semsig_gis.objects.table import StreetObjects

if TYPE_CHECKING:
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

    from semsig_gis.evaluation.result import Evaluation


def everything() -> dict[str, Any]:
    database, objects = small_city()
    return {
        "objects": objects,
        "evaluation": small_evaluation(),
        "identifiability": told_of(database),
    }


def places(evaluation: Evaluation) -> NDArray[np.float64]:
    return shapely.get_coordinates(evaluation.queries.geometry.array)


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
    away = (queries.queries[["best_x", "best_y"]].to_numpy(float) - places(queries)).any(axis=1)
    assert len(read) == rows.get(layer, int(away.sum()) - queries.unlocalized)


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
        ("city.tif", {"geometry": "point"}, ("ambiguity alone", "no geometry")),
        ("city.csv", {"layers": "objects", "objects": 1, "geometry": "point"}, ("no geometry",)),
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


@pytest.mark.parametrize("suffix", [".gpkg", ".parquet", ".csv", ".tif"])
def test_what_is_of_another_city_or_of_none_is_refused(suffix: str, tmp_path: Path) -> None:
    database, objects = small_city()
    layer = "error" if suffix == ".tif" else "evaluation"
    given: dict[str, Any] = {"layers": layer, "evaluation": small_evaluation()}
    with pytest.raises(InputError) as caught:
        export_database(database.select(slice(1, None)), tmp_path / f"a{suffix}", **given)
    assert_sentence(caught.value, "give the database that it was made with")
    with pytest.raises(EmptyResultError) as caught_empty:
        export_database(database.select(slice(0)), tmp_path / f"a{suffix}")
    assert_sentence(caught_empty.value, f"a{suffix}", "no cell")
    if suffix != ".tif":
        layers = "objects"
        moved = StreetObjects(objects.table.to_crs("EPSG:32632"), objects.taxonomy, ())
        with pytest.raises(InputError) as caught:
            export_database(database, tmp_path / f"a{suffix}", layers=layers, objects=moved)
        assert_sentence(caught.value, "zone 32N", "zone 31N")
        table = objects.table.set_geometry(objects.table.translate(9_000.0))
        far = StreetObjects(table, objects.taxonomy, ())
        with pytest.raises(InputError) as caught:
            export_database(database, tmp_path / f"a{suffix}", layers=layers, objects=far)
        assert_sentence(caught.value, "none of the", "same city")
        nothing = StreetObjects(objects.table[:0], objects.taxonomy, objects.licenses)
        with pytest.raises(EmptyResultError) as caught_empty:
            export_database(database, tmp_path / f"a{suffix}", layers=layers, objects=nothing)
        assert_sentence(caught_empty.value, f"a{suffix}", "no object")
    assert not list(tmp_path.iterdir())


def test_answers_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    database = small_city()[0]
    with pytest.raises(InputError) as caught:
        export_answer(small_localization(), database, tmp_path / "a.tif")
    assert_sentence(caught.value, "a.tif", "likelihood")
    with pytest.raises(InputError) as caught:
        export_answer(small_location(), database, tmp_path / "a.geojson")
    assert_sentence(caught.value, "a.geojson", ".gpkg")
    with pytest.raises(InputError) as caught:
        export_answer(small_localization(), database, tmp_path / "a.gpkg", share=7)
    assert_sentence(caught.value, "share of 7")


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
