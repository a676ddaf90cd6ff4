"""Picking a format by the suffix of the file: what each holds, and what is refused."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import geopandas as gpd
import pandas as pd
import pyogrio
import pytest
import shapely
from machine import largest_file
from sentences import refused
from small_city import chances_of, small_city, small_evaluation, small_localization, small_location

from semsig_gis.core.errors import EmptyResultError, InputError, SemsigError, UnknownNameError
from semsig_gis.exports import LAYERS, RASTERS, export_answer, export_database
from semsig_gis.objects.table import StreetObjects

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


def contents() -> dict[str, Any]:
    database, objects = small_city()
    return {
        "objects": objects,
        "evaluation": small_evaluation(),
        "identifiability": chances_of(database),
    }


def test_a_geopackage_holds_all(tmp_path: Path) -> None:
    file = tmp_path / "CITY.GPKG"
    export_database(small_city()[0], file, geometry="point", **contents())
    layers = dict(pyogrio.list_layers(file).tolist())
    assert {name: layers[name] for name in LAYERS} == {
        "cells": "Point",
        "objects": "Point",
        "evaluation": "Point",
        "evaluation_lines": "LineString",
    }


def test_a_geopackage_holds_what_is_named(tmp_path: Path) -> None:
    file, names = tmp_path / "queries.gpkg", ["evaluation", "evaluation_lines"]
    export_database(small_city()[0], file, layers=names, evaluation=small_evaluation())
    assert pyogrio.list_layers(file)[:, 0].tolist() == [*names, "layer_styles"]


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
@pytest.mark.parametrize("layer", LAYERS)
def test_other_files_hold_one(layer: str, suffix: str, tmp_path: Path) -> None:
    file, everything = tmp_path / f"a{suffix}", contents()
    needed = {"cells": [], "objects": ["objects"]}.get(layer, ["evaluation"])
    database, queries = small_city()[0], small_evaluation().queries
    export_database(database, file, layers=[layer], **{name: everything[name] for name in needed})
    read = pd.read_csv(file) if suffix == ".csv" else gpd.read_parquet(file)
    true = shapely.get_coordinates(queries.geometry.array)
    off = (queries[["best_x", "best_y"]].to_numpy(float) != true).any(axis=1)
    column, rows = {
        "cells": ("bearings", len(database)),
        "objects": ("source_id", len(everything["objects"])),
        "evaluation": ("query_types", len(queries)),
        "evaluation_lines": ("off_m", int(off.sum()) - small_evaluation().unlocalized),
    }[layer]
    assert column in read.columns
    assert len(read) == rows


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
    given = {key: contents()[key] if value == 1 else value for key, value in options.items()}
    with refused((InputError, UnknownNameError), *words):
        export_database(small_city()[0], tmp_path / name, **given)
    assert not list(tmp_path.iterdir())


def other_objects(kind: str) -> StreetObjects:
    _, objects = small_city()
    tables = {
        "moved": objects.table.to_crs("EPSG:32632"),
        "far": objects.table.set_geometry(objects.table.translate(9_000.0)),
        "none": objects.table[:0],
    }
    return StreetObjects(tables[kind], objects.taxonomy, ())


MADE_WITH = "give the database that it was made with"
TABLES, ALL = (".gpkg", ".parquet", ".csv"), (".gpkg", ".parquet", ".csv", ".tif")
OTHERS: list[tuple[tuple[str, ...], slice, str, Callable[[], object], tuple[str, ...]]] = [
    (ALL, slice(0), "", dict, ("city.", "no cell")),
    (
        TABLES,
        slice(3, None),
        "identifiability",
        lambda: chances_of(small_city()[0]),
        ("other cells",),
    ),
    (ALL, slice(3, None), "evaluation", small_evaluation, (MADE_WITH,)),
    (TABLES, slice(None), "objects", lambda: other_objects("moved"), ("zone 32N", "zone 31N")),
    (TABLES, slice(None), "objects", lambda: other_objects("far"), ("none of the", "city")),
    (TABLES, slice(None), "objects", lambda: other_objects("none"), ("city.", "no object")),
]


@pytest.mark.parametrize(("suffixes", "rows", "name", "value", "words"), OTHERS)
def test_what_is_of_another_city_or_of_none_is_refused(
    *,
    suffixes: tuple[str, ...],
    rows: slice,
    name: str,
    value: Callable[[], object],
    words: tuple[str, ...],
    tmp_path: Path,
) -> None:
    for suffix in suffixes:
        raster = {"": "ambiguity", "evaluation": "error"}
        table = {"": "cells", "identifiability": "cells"}
        options: dict[str, Any] = {name: value()} if name else {}
        options["layers"] = raster[name] if suffix == ".tif" else table.get(name, name)
        with refused((InputError, EmptyResultError), *words):
            export_database(small_city()[0].select(rows), tmp_path / f"city{suffix}", **options)
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
    with refused(InputError, *words):
        export_answer(answer(), small_city()[0], tmp_path / name, **options)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", [".gpkg", ".parquet", ".csv", ".tif"])
def test_a_folder_that_cannot_be_written(suffix: str, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("here")
    with refused(SemsigError, f"city{suffix}", "folder"):
        export_database(small_city()[0], tmp_path / "file" / f"city{suffix}")
    (tmp_path / f"b{suffix}").mkdir()
    with refused(SemsigError, f"b{suffix} is a folder"):
        export_database(small_city()[0], tmp_path / f"b{suffix}")
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
    with largest_file(round(share * len(before))), refused(InputError, file.name, "unchanged"):
        export_database(database, file, **given)
    assert file.read_bytes() == before
    assert list(tmp_path.iterdir()) == [file]
