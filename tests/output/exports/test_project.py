"""The project in a GeoPackage as QGIS opens it: names, forms, map tips, scales and layout."""

from __future__ import annotations

import dataclasses
import io
import json
import re
import sqlite3
import subprocess
import zipfile
from contextlib import closing
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote
from xml.etree import ElementTree as ET

import pyogrio
import pytest
from machine import PATIENCE_S, qgis_variables
from map_pages import HOSTILE
from small_city import (
    chances_of,
    small_city,
    small_evaluation,
    small_ground,
    small_localization,
    small_location,
)

from semsig_gis.core import PICTOGRAMS, Taxonomy, place_links
from semsig_gis.localization import search_regions
from semsig_gis.objects import Licence
from semsig_gis.output import (
    answer_layers,
    cells_layer,
    evaluation_layer,
    evaluation_lines_layer,
    export_answer,
    export_database,
    hexagons_layer,
    objects_layer,
    project_archive,
    shown_layers,
)

if TYPE_CHECKING:
    from semsig_gis.localization import Localization, Location

PROGRAM = Path(__file__).parents[2] / "qgis_programs.py"
SVG = "{http://www.w3.org/2000/svg}"
CITY, OBJECTS = small_city()
CHANCES, EVALUATION = chances_of(CITY), small_evaluation()
LOCATION, LOCALIZATION = small_location(), small_localization()
NASTY = f"[% env('HOME') %]']{HOSTILE}"


def export_hostile_city(path: Path) -> None:
    """Export a city with texts that are scripts for a browser and expressions for QGIS."""
    classes = [dataclasses.replace(item, title=NASTY) for item in OBJECTS.taxonomy.classes]
    taxonomy = Taxonomy(tuple(classes))
    table = OBJECTS.table.assign(source_id=NASTY)
    licenses = tuple(map(Licence, (NASTY, *(f"Town {number} (CC0)" for number in range(8)))))
    objects = dataclasses.replace(OBJECTS, table=table, licenses=licenses, taxonomy=taxonomy)
    database = dataclasses.replace(CITY, licenses=(NASTY,), taxonomy=taxonomy)
    export_database(database, path, objects=objects, identifiability=chances_of(database))


@pytest.fixture(scope="module")
def projects(qgis_python: str, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return the contents of the projects in several files, as QGIS reports them."""
    folder = tmp_path_factory.mktemp("projects")
    files = [folder / f"{name}.gpkg" for name in ("Old Town & é", "likely", "near", "hostile")]
    layers: dict[str, Any] = {"identifiability": CHANCES, "evaluation": EVALUATION, "h3": 9}
    export_database(CITY, files[0], objects=OBJECTS, **layers, **small_ground())
    export_answer(LOCATION, CITY, files[1], **small_ground())
    export_answer(LOCALIZATION, CITY, files[2])
    export_hostile_city(files[3])
    result = subprocess.run(
        (qgis_python, PROGRAM, "project", *files),
        check=False,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        env=qgis_variables(folder),
    )
    assert result.returncode == 0, result.stdout + result.stderr
    lines = [line for line in result.stdout.splitlines() if line.startswith("{")]
    contents = {file.stem: json.loads(line) for file, line in zip(files, lines, strict=True)}
    for project in contents.values():
        assert project["found"]
        assert project["drawn"]
        assert not any(layer["errors"] for layer in project["layers"].values())
    return contents


def signs(types: str) -> list[str]:
    """Return what stands for the classes on a wheel: a pictogram, or else the symbol."""
    classes = {item.symbol: item.name for item in CITY.taxonomy.classes}
    return [PICTOGRAMS.get(classes[symbol], symbol) for symbol in types]


def wheel_signs(tip: str) -> list[str]:
    """Return the signs on the compass wheel of a map tip, which must be valid SVG."""
    image = re.search(r'src="data:image/svg\+xml,([^"]+)"', tip)
    assert image is not None
    root = ET.fromstring(unquote(image[1]))  # noqa: S314 - our own
    assert all("NaN" not in group.get("transform", "") for group in root.iter(f"{SVG}g"))
    marks = [next(iter(group)) for group in root.iter(f"{SVG}g") if "fill" in group.attrib]
    return [mark.get("d") or str(mark.text) for mark in marks]


def test_city_opens_as_a_project(projects: dict[str, Any]) -> None:
    project = projects["Old Town & é"]
    layers = project["layers"]
    assert (project["title"], project["crs"]) == ("Old Town & é", "EPSG:32631")
    lines, figures = "From the true to the best place", "Figures of the queries"
    assert project["groups"] == {
        "Evaluation": ["Queries", lines, figures],
        "City": ["Hexagons", "Street objects", "Signature cells"],
        "Ground": ["Streets", "Buildings"],
    }
    assert layers["Streets"]["features"] == len(small_ground()["streets"])
    assert layers["Buildings"]["features"] == len(small_ground()["buildings"]) - 1  # one is far
    assert project["off"] == [lines]
    assert project["relations"] == [[figures, True]]
    assert {"Old Town & é", f"1:{project['scale']:,}"} < {*project["texts"]}
    assert any("Town (CC0)\n" in text for text in project["texts"])
    cells, objects, queries = (layers[n] for n in ("Signature cells", "Street objects", "Queries"))
    assert (cells["seen"], objects["seen"]) == ([10_000, 5_000, 1_000], [5_000, 1_000])
    assert layers["Hexagons"]["seen"] == [50_000]
    hostile_cells = projects["hostile"]["layers"]["Signature cells"]
    assert hostile_cells["seen"] == [50_000, 10_000, 5_000, 1_000]  # there are no hexagons
    assert cells["styles"] == ["Ambiguity", "Identifiability"]
    assert cells["aliases"]["gain_street_light"] == "Gain by: Street light"
    assert cells["form"]["What it is mistaken for"][:2] == ["lookalike_1", "lookalike_2"]
    assert wheel_signs(cells["tip"]) == signs(CITY.types(0))
    assert cells["name"] == f"cell {CITY.cell_ids[0]}"
    assert wheel_signs(queries["tip"]) == signs(EVALUATION.queries["query_types"].iloc[0])
    assert not any(re.fullmatch(r"p\d+|near\d+", name) for name in queries["aliases"])
    assert queries["form"]["Figures"] == ["evaluation_figures"]
    assert layers[figures]["aliases"]["p50"] == "Error at most 50 m"
    assert layers[figures]["features"] == len(EVALUATION.queries)


@pytest.mark.parametrize(("name", "answer"), [("likely", LOCATION), ("near", LOCALIZATION)])
def test_answer_opens_as_a_project(
    name: str, answer: Location | Localization, projects: dict[str, Any]
) -> None:
    layers = projects[name]["layers"]
    candidates = layers["Candidates"]
    groups = ["Answer", "Ground"] if name == "likely" else ["Answer"]
    assert list(projects[name]["groups"]) == groups
    assert (candidates["name"], candidates["label"]) == ("candidate 1", 1)
    assert wheel_signs(candidates["tip"]) == signs(answer.candidates["types"].iloc[0])
    lat, lon = (answer.candidate_rows()[0][name] for name in ("lat", "lon"))
    links = place_links(lat, lon)
    assert [*map(tuple, candidates["actions"])] == [*links.items()]
    assert all(f'<a href="{escape(link)}">{title}</a>' in candidates["tip"]
               for title, link in links.items())  # fmt: skip
    assert layers["Regions to search"]["aliases"]["km2"] == "Area (km²)"


def test_candidates_with_a_chance_below_1_percent_are_not_drawn(projects: dict[str, Any]) -> None:
    likely = int((LOCATION.candidates["chance"] >= 0.01).sum())
    layers = projects["likely"]["layers"]
    assert layers["Candidates"]["shown"] == likely < len(LOCATION.candidates)
    assert layers["Candidates"]["features"] == len(LOCATION.candidates)
    near = projects["near"]["layers"]["Candidates"]
    assert near["shown"] == near["features"]  # this method has no chances


def test_qgis_evaluates_no_texts_from_data(projects: dict[str, Any]) -> None:
    project = projects["hostile"]
    tips = [layer["tip"] for layer in project["layers"].values()]
    for text in (*tips, *project["texts"][:1]):
        assert "env('HOME')" in text
    assert "Town 4 (CC0)\nand 3 more, which" in project["texts"][0]
    assert not any("<script" in tip or "<img src=x" in tip for tip in tips)


def test_every_field_has_an_alias_and_a_description(tmp_path: Path) -> None:
    file = tmp_path / "city.gpkg"
    queries, lines = (make(EVALUATION, CITY) for make in (evaluation_layer, evaluation_lines_layer))
    answers = (
        answer_layers(answer, CITY, search_regions(answer, CITY))
        for answer in (LOCATION, LOCALIZATION)
    )
    layers = [
        *(cells_layer(CITY, identifiability=CHANCES), objects_layer(OBJECTS), lines),
        *(hexagons_layer(CITY, 9, objects=OBJECTS, evaluation=EVALUATION), *queries.parts),
        *(layer for answer in answers for layer in answer),
    ]
    for layer in layers:
        assert all(column.about and column.alias != column.name for column in layer.columns)
        assert len({column.alias for column in layer.columns}) == len(layer.names)
    name = "a\udcff\x01 b"
    first, second = (project_archive(layers, shown_layers(layers, name), name) for _ in range(2))
    assert first == second
    with zipfile.ZipFile(io.BytesIO(first)) as archive:
        assert ET.fromstring(archive.read("project.qgs")).get("projectname") == "a\ufffd b"  # noqa: S314 - our own
    export_database(CITY, file, objects=OBJECTS)
    with closing(sqlite3.connect(file)) as connection:
        query = "SELECT title, description FROM gpkg_data_columns WHERE column_name = 'bearings'"
        titles = connection.execute(query).fetchall()
        query = "SELECT extension_name FROM gpkg_extensions WHERE table_name = ?"
        extensions = connection.execute(query, ["gpkg_data_columns"]).fetchall()
    assert titles == [("Bearings (°)", "Of the same objects, clockwise from grid north.")]
    assert extensions == [("gpkg_schema",)]
    assert "qgis_projects" not in pyogrio.list_layers(file)[:, 0]
