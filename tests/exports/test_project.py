"""The project in a GeoPackage, as QGIS opens it: names, forms, tips, scales and a page."""

from __future__ import annotations

import dataclasses
import io
import json
import re
import sqlite3
import subprocess
import zipfile
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote
from xml.etree import ElementTree as ET

import pyogrio
import pytest
from machine import PATIENCE_S, qgis_variables
from map_pages import HOSTILE
from small_city import chances_of, small_city, small_evaluation, small_localization, small_location

from semsig_gis.core import Taxonomy
from semsig_gis.exports import (
    answer_layers,
    cells_layer,
    evaluation_layers,
    export_answer,
    export_database,
    hexagons_layer,
    layer_fields,
    objects_layer,
    project_archive,
    shown_layers,
    split_figures,
)
from semsig_gis.localization import search_regions
from semsig_gis.objects import Licence

if TYPE_CHECKING:
    from semsig_gis.localization import Localization, Location

PROGRAM = Path(__file__).parents[1] / "qgis_programs.py"
SVG = "{http://www.w3.org/2000/svg}"
CITY, OBJECTS = small_city()
CHANCES, EVALUATION = chances_of(CITY), small_evaluation()
LOCATION, LOCALIZATION = small_location(), small_localization()
NASTY = f"[% env('HOME') %]']{HOSTILE}"


def hostile(path: Path) -> None:
    """Write a city of which every text would run in a page, or in QGIS, if it could."""
    classes = [dataclasses.replace(one, title=NASTY) for one in OBJECTS.taxonomy.classes]
    same: dict[str, Any] = {"taxonomy": Taxonomy(tuple(classes))}
    table = OBJECTS.table.assign(source_id=NASTY)
    licenses = (NASTY, *(f"Town {number} (CC0)" for number in range(8)))
    things = {"table": table, "licenses": tuple(map(Licence, licenses))}
    objects = dataclasses.replace(OBJECTS, **things, **same)
    database = dataclasses.replace(CITY, licenses=(NASTY,), **same)
    export_database(database, path, objects=objects, identifiability=chances_of(database))


@pytest.fixture(scope="module")
def opened(qgis_python: str, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return what QGIS says of the projects in some files."""
    folder = tmp_path_factory.mktemp("projects")
    files = [folder / f"{name}.gpkg" for name in ("Old Town & é", "likely", "near", "hostile")]
    whole: dict[str, Any] = {"identifiability": CHANCES, "evaluation": EVALUATION, "h3": 9}
    export_database(CITY, files[0], objects=OBJECTS, **whole)
    export_answer(LOCATION, CITY, files[1])
    export_answer(LOCALIZATION, CITY, files[2])
    hostile(files[3])
    done = subprocess.run(
        (qgis_python, PROGRAM, "project", *files),
        check=False,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        env=qgis_variables(folder),
    )
    assert done.returncode == 0, done.stdout + done.stderr
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    said = {file.stem: json.loads(line) for file, line in zip(files, lines, strict=True)}
    for project in said.values():
        assert project["found"]
        assert project["drawn"]
        assert not any(layer["errors"] for layer in project["layers"].values())
    return said


def wheel(tip: str) -> list[str]:
    """Return the letters on the wheel in a tip, which must be sound SVG."""
    image = re.search(r'src="data:image/svg\+xml,([^"]+)"', tip)
    assert image is not None
    root = ET.fromstring(unquote(image[1]))  # noqa: S314 - our own
    assert all("NaN" not in part.get("transform", "") for part in root.iter(f"{SVG}g"))
    return [str(text.text) for text in root.iter(f"{SVG}text")]


def test_a_city_opens_as_a_project(opened: dict[str, Any]) -> None:
    said = opened["Old Town & é"]
    layers = said["layers"]
    assert (said["title"], said["crs"]) == ("Old Town & é", "EPSG:32631")
    lines, figures = "From the true to the best place", "Figures of the queries"
    assert said["groups"] == {
        "Evaluation": ["Queries", lines, figures],
        "City": ["Hexagons", "Street objects", "Signature cells"],
    }
    assert said["off"] == [lines]
    assert said["relations"] == [[figures, True]]
    assert {"Old Town & é", f"1:{said['scale']:,}"} < {*said["texts"]}
    assert any(CITY.licenses[0] in text for text in said["texts"])
    cells, objects, asked = (layers[n] for n in ("Signature cells", "Street objects", "Queries"))
    assert (cells["seen"], objects["seen"]) == ([10_000, 5_000, 1_000], [5_000, 1_000])
    assert layers["Hexagons"]["seen"] == [50_000]
    assert opened["hostile"]["layers"]["Signature cells"]["seen"] == [50_000, 10_000, 5_000, 1_000]
    assert cells["styles"] == ["Ambiguity", "Identifiability"]
    assert cells["aliases"]["gain_street_light"] == "Gain by: Street light"
    assert cells["form"]["What it is mistaken for"][:2] == ["lookalike_1", "lookalike_2"]
    assert wheel(cells["tip"]) == [*CITY.types(0)]
    assert cells["name"] == f"cell {CITY.cell_ids[0]}, {CITY.types(0)}"
    assert wheel(asked["tip"]) == [*EVALUATION.queries["query_types"].iloc[0]]
    assert not any(re.fullmatch(r"p\d+|near\d+", name) for name in asked["aliases"])
    assert asked["form"]["Figures"] == ["evaluation_figures"]
    assert layers[figures]["aliases"]["p50"] == "Error at most 50 m"
    assert layers[figures]["features"] == len(EVALUATION.queries)


@pytest.mark.parametrize(("name", "answer"), [("likely", LOCATION), ("near", LOCALIZATION)])
def test_an_answer_opens_as_a_project(
    name: str, answer: Location | Localization, opened: dict[str, Any]
) -> None:
    said = opened[name]
    best = said["layers"]["Candidates"]
    assert list(said["groups"]) == ["Answer"]
    assert (best["name"], best["label"]) == ("candidate 1", 1)
    assert wheel(best["tip"]) == [*answer.candidates["types"].iloc[0]]
    assert said["layers"]["Regions to search"]["aliases"]["km2"] == "Area (km²)"


def test_texts_from_data_are_shown_as_they_are(opened: dict[str, Any]) -> None:
    said = opened["hostile"]
    tips = [layer["tip"] for layer in said["layers"].values()]
    for text in (*tips, *said["texts"][:1]):
        assert "env('HOME')" in text
    assert "Town 4 (CC0)\nand 3 more, which" in said["texts"][0]
    assert not any("<script" in tip or "<img src=x" in tip for tip in tips)


def test_every_field_has_a_name_that_people_read(tmp_path: Path) -> None:
    file = tmp_path / "city.gpkg"
    queries, lines = evaluation_layers(EVALUATION, CITY)
    answers = (
        answer_layers(one, CITY, search_regions(one, CITY)) for one in (LOCATION, LOCALIZATION)
    )
    layers = [
        *(cells_layer(CITY, identifiability=CHANCES), objects_layer(OBJECTS), lines),
        *(hexagons_layer(CITY, 9, objects=OBJECTS, evaluation=EVALUATION), *split_figures(queries)),
        *(layer for answer in answers for layer in answer),
    ]
    for layer in layers:
        fields = layer_fields(layer)
        assert all(field.about and field.alias != field.name for field in fields), layer.name
        assert len({field.alias for field in fields}) == len(fields)
    name = "a\udcff\x01 b"
    again = [project_archive(layers, shown_layers(layers, name), name) for _ in "ab"]
    assert again[0] == again[1]
    with zipfile.ZipFile(io.BytesIO(again[0])) as archive:
        assert ET.fromstring(archive.read("project.qgs")).get("projectname") == "a\ufffd b"  # noqa: S314 - our own
    export_database(CITY, file, objects=OBJECTS)
    with closing(sqlite3.connect(file)) as connection:
        said = "SELECT title, description FROM gpkg_data_columns WHERE column_name = 'bearings'"
        told = connection.execute(said).fetchall()
        extension = "SELECT extension_name FROM gpkg_extensions WHERE table_name = ?"
        known = connection.execute(extension, ["gpkg_data_columns"]).fetchall()
    assert told == [("Bearings (°)", "Of the same objects, clockwise from grid north.")]
    assert known == [("gpkg_schema",)]
    assert "qgis_projects" not in pyogrio.list_layers(file)[:, 0]
