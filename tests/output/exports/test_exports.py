"""Formats by the suffix of the file: their contents, and the refusals."""

from __future__ import annotations

import dataclasses
import json
from functools import partial
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import pandas as pd
import pyogrio
import pytest
from machine import largest_file
from sentences import refused
from small_city import (
    chances_of,
    small_city,
    small_evaluation,
    small_localization,
    small_location,
)

from semsig_gis.core import EmptyResultError, InputError, SemsigError, UnknownNameError
from semsig_gis.localization import search_regions
from semsig_gis.output import LAYERS, RASTERS, export_answer, export_database

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from semsig_gis.localization import Localization, Location

CITY, OBJECTS = small_city()
CHANCES = chances_of(CITY)
OF_OBJECTS: dict[str, Any] = {"objects": OBJECTS}
OF_QUERIES: dict[str, Any] = {"evaluation": small_evaluation()}
TABLES = (".gpkg", ".parquet", ".fgb", ".geojson", ".csv")
ALL = (*TABLES, ".pmtiles", ".tif")


def test_geopackage_contains_all_or_the_chosen_layers(tmp_path: Path) -> None:
    everything = {**OF_OBJECTS, **OF_QUERIES, "identifiability": CHANCES, "h3": 9}
    export_database(CITY, tmp_path / "CITY.GPKG", geometry="point", **everything)
    layers = dict(pyogrio.list_layers(tmp_path / "CITY.GPKG").tolist())
    kinds = [layers[name] for name in LAYERS if name not in {"buildings", "streets"}]  # no ground
    assert kinds == ["Point", "Point", "LineString", "Polygon", "Point"]
    assert layers["evaluation_figures"] is None
    file, names = tmp_path / "queries.gpkg", ["evaluation", "evaluation_lines"]
    export_database(CITY, file, layers=names, **OF_QUERIES)
    names += ["evaluation_figures", "layer_styles"]
    assert pyogrio.list_layers(file)[:, 0].tolist() == names


LOCATION = small_location()


@pytest.mark.parametrize("answer", [LOCATION, small_localization()])
def test_exported_answer_contains_regions_and_candidates(
    answer: Location | Localization, tmp_path: Path
) -> None:
    file = tmp_path / "a.gpkg"
    for path in (file, tmp_path / "a.parquet", tmp_path / "a.csv"):
        regions = export_answer(answer, CITY, path, share=0.99, within=12.0)
    texts = pd.read_csv(tmp_path / "a.csv")
    for read in (
        gpd.read_file(file, layer="regions"),
        gpd.read_parquet(tmp_path / "a.parquet"),
        gpd.GeoDataFrame(texts, geometry=gpd.GeoSeries.from_wkt(texts["WKT"]), crs=CITY.crs),
    ):
        assert read.geometry.geom_equals(regions.table.geometry).all()
        for column in ("searched_km2", "searched_percent"):
            assert read[column].tolist() == regions.table[column].tolist()
    assert pyogrio.list_layers(file)[:, 0].tolist() == [
        *("regions", "candidates"),
        *(("place", "ellipse", "rays") if answer is LOCATION else ()),
        "layer_styles",
    ]
    candidates = gpd.read_file(file, layer="candidates")
    assert candidates["cell_id"].tolist() == answer.candidates["cell_id"].tolist()
    facts = pyogrio.read_info(file, layer="regions")["layer_metadata"]
    searched = search_regions(answer, CITY, share=0.99, within=12.0)
    assert json.loads(facts["searched"]) == regions.to_dict() == searched.to_dict()


def city(rows: slice = slice(None), **options: Any) -> Callable[[Path], object]:  # noqa: ANN401
    return partial(export_database, CITY.select(rows), **options)


def objects(table: gpd.GeoDataFrame) -> Callable[[Path], object]:
    return city(layers="objects", objects=dataclasses.replace(OBJECTS, table=table))


def answer(result: Location | Localization, share: float = 0.9) -> Callable[[Path], object]:
    return lambda path: export_answer(result, CITY, path, share=share)


MADE_WITH = "give the database that it was made with"
PLACES = OBJECTS.table
REFUSALS: list[tuple[Callable[[Path], object], str, tuple[str, ...]]] = [
    (city(), "city.shp", ("city.shp", ".csv, .fgb, .geojson, .gpkg, .parquet, .pmtiles or .tif")),
    (city(), "city", ("does not end in",)),
    (city(layers=["cell"]), "city.gpkg", ("'cell'", "the nearest is 'cells'")),
    (city(layers=["cells", "objects"]), "city.gpkg", ("no objects",)),
    (city(layers=["cells"], **OF_OBJECTS), "city.gpkg", ("only the cells", "not the objects")),
    (city(layers=["cells", "objects"], **OF_OBJECTS), "city.csv", ("one layer", "GeoPackage")),
    (city(h3=16), "city.fgb", ("resolution 16", "0 to 15")),
    (city(layers="hexagons"), "city.fgb", ("no resolution",)),
    (city(layers="cells", h3=9), "city.fgb", ("only the cells", "not the resolution")),
    (city(layers="objects"), "city.pmtiles", ("cannot contain 'objects'", "give one of cells")),
    (city(geometry="point"), "city.pmtiles", ("only the cells", "not the geometry")),
    (city(layers=["object"]), "city.csv", ("'object'", "the nearest is 'objects'")),
    (city(layers=["ambiguity"]), "city.csv", ("'ambiguity'", *LAYERS)),
    (city(layers=["cells"]), "city.tif", ("'cells'", *RASTERS)),
    (city(layers=["objects"]), "city.csv", ("no objects",)),
    (city(layers=["evaluation_lines"]), "city.parquet", ("no evaluation",)),
    (city(layers=["identifiability"]), "city.tif", ("no identifiability",)),
    (city(layers=["error"]), "city.tif", ("no evaluation",)),
    (city(layers="field"), "city.tif", ("no evaluation",)),
    (city(smooth=250.0), "city.tif", ("not the smoothing",)),
    (
        city(**OF_OBJECTS, **OF_QUERIES),
        "a.csv",
        ("only the cells", "not the evaluation or objects"),
    ),
    (city(layers=["error"], **OF_OBJECTS, **OF_QUERIES), "city.tif", ("only the error",)),
    (city(geometry="square"), "city.gpkg", ("'square'", "'polygon' or 'point'")),
    (city(geometry="point"), "city.tif", ("only the ambiguity", "not the geometry")),
    (city(layers="objects", geometry="point", **OF_OBJECTS), "city.csv", ("not the geometry",)),
    (answer(small_localization()), "a.tif", ("a.tif", "likelihood")),
    (answer(small_location()), "a.shp", ("a.shp", ".gpkg")),
    (answer(small_localization(), share=7), "a.gpkg", ("share of 7",)),
    # Empty cities, and objects or evaluations of another city.
    *((city(slice(0)), f"city{suffix}", ("city.", "no cell")) for suffix in ALL),
    (city(slice(3, None), layers="error", **OF_QUERIES), "city.tif", (MADE_WITH,)),
    *(
        (export, f"city{suffix}", words)
        for suffix in TABLES
        for export, words in (
            (city(slice(3, None), identifiability=CHANCES), ("other cells",)),
            (city(slice(3, None), layers="evaluation", **OF_QUERIES), (MADE_WITH,)),
            (objects(PLACES.to_crs("EPSG:32632")), ("zone 32N", "zone 31N")),
            (objects(PLACES.set_geometry(PLACES.translate(9_000.0))), ("none of the", "city")),
            (objects(PLACES[:0]), ("city.", "no object")),
        )
    ),
]


@pytest.mark.parametrize(("export", "name", "words"), REFUSALS)
def test_wrong_arguments_are_refused_and_write_nothing(
    export: Callable[[Path], object], name: str, words: tuple[str, ...], tmp_path: Path
) -> None:
    with refused((InputError, UnknownNameError, EmptyResultError), *words):
        export(tmp_path / name)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", ALL)
def test_folder_that_cannot_be_written_is_refused(suffix: str, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("here")
    with refused(SemsigError, f"city{suffix}", "folder"):
        export_database(CITY, tmp_path / "file" / f"city{suffix}")
    (tmp_path / f"b{suffix}").mkdir()
    with refused(SemsigError, f"b{suffix} is a folder"):
        export_database(CITY, tmp_path / f"b{suffix}")
    assert (tmp_path / "file").read_text() == "here"


# At a share just below 1, the spatial index of a GeoPackage fails, which is written last.
@pytest.mark.parametrize("share", [0.0, 0.07, 0.4, 0.95])
@pytest.mark.parametrize("suffix", ALL)
def test_full_disk_leaves_the_old_file(suffix: str, share: float, tmp_path: Path) -> None:
    file, layers = tmp_path / f"city{suffix}", OF_OBJECTS if suffix == ".gpkg" else {}
    export_database(CITY, file, **layers)
    before, files = file.read_bytes(), {*tmp_path.iterdir()}
    with largest_file(round(share * len(before))), refused(InputError, file.name, "unchanged"):
        export_database(CITY, file, **layers)
    assert file.read_bytes() == before
    assert {*tmp_path.iterdir()} == files
