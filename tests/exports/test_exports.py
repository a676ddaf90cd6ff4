"""Picking a format by the suffix of the file: what each holds, and what is refused."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import geopandas as gpd
import pandas as pd
import pyogrio
import pytest
import shapely
from cells_told import told_of
from full_disk import largest_file
from sentences import assert_sentence
from small_city import small_city, small_evaluation, small_localization, small_location

from semsig_gis.core.errors import EmptyResultError, InputError, SemsigError, UnknownNameError
from semsig_gis.exports import LAYERS, RASTERS, export_answer, export_database
from semsig_gis.objects.table import StreetObjects

if TYPE_CHECKING:
    from collections.abc import Callable
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


def other_objects(kind: str) -> StreetObjects:
    _, objects = small_city()
    tables = {
        "moved": objects.table.to_crs("EPSG:32632"),
        "far": objects.table.set_geometry(objects.table.translate(9_000.0)),
        "none": objects.table[:0],
    }
    return StreetObjects(tables[kind], objects.taxonomy, ())


OF_OTHERS = ("that of other cells",)
MADE_WITH = ("give the database that it was made with",)
OTHER_CITY: list[tuple[slice, str, Callable[[], dict[str, Any]], tuple[str, ...]]] = [
    (slice(0), "cells", dict, ("city.", "no cell")),
    (slice(3, None), "cells", lambda: {"identifiability": told_of(small_city()[0])}, OF_OTHERS),
    (slice(3, None), "evaluation", lambda: {"evaluation": small_evaluation()}, MADE_WITH),
    (slice(None), "objects", lambda: {"objects": other_objects("moved")}, ("zone 32N", "zone 31N")),
    (slice(None), "objects", lambda: {"objects": other_objects("far")}, ("none of the", "city")),
    (slice(None), "objects", lambda: {"objects": other_objects("none")}, ("city.", "no object")),
]


@pytest.mark.parametrize("suffix", [".gpkg", ".parquet", ".csv"])
@pytest.mark.parametrize(("rows", "layer", "given", "words"), OTHER_CITY)
def test_what_is_of_another_city_or_of_none_is_refused(
    *,
    suffix: str,
    rows: slice,
    layer: str,
    given: Callable[[], dict[str, Any]],
    words: tuple[str, ...],
    tmp_path: Path,
) -> None:
    database = small_city()[0].select(rows)
    with pytest.raises((InputError, EmptyResultError)) as caught:
        export_database(database, tmp_path / f"city{suffix}", layers=layer, **given())
    assert_sentence(caught.value, *words)
    assert not list(tmp_path.iterdir())


def test_rasters_of_another_city_or_of_none_are_refused(tmp_path: Path) -> None:
    database, _ = small_city()
    with pytest.raises(EmptyResultError, match="no cell"):
        export_database(database.select(slice(0)), tmp_path / "a.tif")
    other, evaluation = database.select(slice(3, None)), small_evaluation()
    with pytest.raises(InputError, match="give the database that it was made with"):
        export_database(other, tmp_path / "a.tif", layers="error", evaluation=evaluation)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("answer", "name", "options", "words"),
    [
        (small_localization, "a.tif", {}, ("a.tif", "likelihood")),
        (small_location, "a.geojson", {}, ("a.geojson", ".gpkg")),
        (small_localization, "a.gpkg", {"share": 7}, ("share of 7",)),
    ],
)
def test_answers_that_do_not_fit_are_refused(
    answer: Callable[[], Any],
    name: str,
    options: dict[str, float],
    words: tuple[str, ...],
    tmp_path: Path,
) -> None:
    with pytest.raises(InputError) as caught:
        export_answer(answer(), small_city()[0], tmp_path / name, **options)
    assert_sentence(caught.value, *words)
    assert not list(tmp_path.iterdir())


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


# A share just below 1 is too little for the spatial index of a GeoPackage, which comes last.
@pytest.mark.parametrize("share", [0.0, 0.07, 0.4, 0.95])
@pytest.mark.parametrize("suffix", [".gpkg", ".parquet", ".csv", ".tif"])
def test_a_full_disk_leaves_the_old_file(suffix: str, share: float, tmp_path: Path) -> None:
    database, objects = small_city()
    file = tmp_path / f"city{suffix}"
    given: dict[str, Any] = {"objects": objects} if suffix == ".gpkg" else {}
    export_database(database, file, **given)
    before = file.read_bytes()
    with largest_file(round(share * len(before))), pytest.raises(InputError) as caught:
        export_database(database, file, **given)
    assert_sentence(caught.value, file.name, "unchanged")
    assert file.read_bytes() == before
    assert list(tmp_path.iterdir()) == [file]
