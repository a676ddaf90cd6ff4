"""The QGIS plugin: its zip file, its translations, and its tools in a real QGIS."""

from __future__ import annotations

import ast
import configparser
import json
import os
import re
import runpy
import shutil
import subprocess
import sys
import zipfile
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree as ET

import geopandas as gpd
import pyogrio
import pytest
from machine import PATIENCE_S, qgis_variables, unavailable
from small_city import small_city

import semsig_gis
from semsig_gis.database import ObjectStore, open_database, save_with_store
from semsig_gis.objects import open_objects, save_objects

ROOT = Path(__file__).parents[2]
PLUGIN = ROOT / "qgis_plugin" / "semsig"
SCRIPT = Path(__file__).with_name("qgis_session.py")
DATA = Path(__file__).with_name("data")  # three lamps, and their catalogue

# The command with few simulated queries.
QUICK = """
import functools
from semsig_gis.evaluation.identifiability import analysis
from semsig_gis.cli import main
analysis.identify = functools.partial(analysis.identify, trials=60, class_trials=5)
main()
"""

pytestmark = pytest.mark.skipif(not PLUGIN.is_dir(), reason="the tests do not run from a checkout")


@pytest.fixture(scope="module")
def package() -> SimpleNamespace:
    """Return the functions of `package.py`."""
    return SimpleNamespace(**runpy.run_path(str(ROOT / "qgis_plugin" / "package.py")))


def test_zip_file_is_reproducible_and_contains_the_plugin(
    package: SimpleNamespace, tmp_path: Path
) -> None:
    first, second = package.write_zip(tmp_path / "a"), package.write_zip(tmp_path / "b")
    assert first.name == second.name == f"semsig-qgis-{semsig_gis.__version__}.zip"
    assert first.read_bytes() == second.read_bytes()
    with zipfile.ZipFile(first) as archive:
        names = archive.namelist()
        assert names == sorted(names)
        assert {name.partition("/")[0] for name in names} == {"semsig"}
        assert {"semsig/__init__.py", "semsig/metadata.txt", "semsig/LICENSE"} <= set(names)
        suffixes = {".py", ".txt", ".svg", ".qml", ".qm", ".md", ""}
        assert {Path(name).suffix for name in names} == suffixes
        assert {entry.date_time for entry in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        code = {name for name in names if name.endswith(".py")}
    assert code == {path.relative_to(PLUGIN.parent).as_posix() for path in PLUGIN.rglob("*.py")}


def test_official_repository_would_accept_the_zip_file(
    package: SimpleNamespace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("SEMSIG_REPOSITORY", raising=False)
    (fault,) = package.faults(package.write_zip(tmp_path))
    assert fault.startswith("metadata.txt has no email, tracker, repository, homepage; give the ")
    monkeypatch.setenv("SEMSIG_REPOSITORY", "https://a.org/semsig/")
    plugin = package.write_zip(tmp_path, email="a@a.org")
    assert package.faults(plugin) == []
    metadata = configparser.ConfigParser()
    with zipfile.ZipFile(plugin) as archive:
        metadata.read_string(archive.read("semsig/metadata.txt").decode())
    assert {name: metadata["general"][name] for name in ("email", *package.ADDRESSES)} == {
        "email": "a@a.org",
        "homepage": "https://a.org/semsig",
        "repository": "https://a.org/semsig",
        "tracker": "https://a.org/semsig/issues",
    }


def shown_texts() -> set[str]:
    """Return all texts of the windows, the toolbox and the help of the tools."""
    texts: set[str] = set()
    kinds = {"choice", "number", "whole_number", "layers_to_write", "file_to_read", "file_to_write"}
    for path in PLUGIN.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            values: list[ast.expr] = []
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                name = node.func.id
                values += node.args[:1] if name in {"tr", "area", "map_to_write"} else []
                if name in kinds:
                    values += node.args[1:]
                elif name == "described" or name.startswith("QgsProcessingParameter"):
                    values += node.args[1:2]
            elif isinstance(node, ast.Assign):
                name = ast.unparse(node.targets[0])
                if name in {"TITLE", "METHOD_HELP", "text"}:
                    values.append(node.value)
                elif name == "HELP":
                    parts = str(ast.literal_eval(node.value)).split("\n\n")
                    texts |= {" ".join(part.split()) for part in parts}
                elif name == "OUTPUTS":
                    texts |= {text for _, *shown in ast.literal_eval(node.value) for text in shown}
            constants = [value.value for value in values if isinstance(value, ast.Constant)]
            texts |= {text for text in constants if isinstance(text, str)}
    return texts - {""}


@pytest.mark.parametrize("language", ["de", "fr"])
def test_all_texts_are_translated(package: SimpleNamespace, language: str) -> None:
    file = ROOT / "qgis_plugin" / "i18n" / f"semsig_{language}.ts"
    translations = package.read_translations(file)
    # The title of a layer, in a dictionary.
    assert shown_texts() | {"From the true to the best place"} == set(translations)
    for source, text in translations.items():
        assert set(re.findall(r"{\w*}", source)) == set(re.findall(r"{\w*}", text)), text
    # The header of Qt; the contents are tested in QGIS.
    assert package.compiled(translations)[:4] == bytes.fromhex("3cb86418")


QT = re.compile(r"^(Q[A-Z]\w*|Qt|Qgs\w+)$")
# Classes and enumerations, not members of enumerations.
NO_MEMBERS = {"QgsProcessingContext.LayerDetails", "QgsFileWidget.StorageMode"}


def test_code_works_with_qt_5_and_qt_6() -> None:
    for path in PLUGIN.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        nodes = [*ast.walk(ast.parse(text))]
        for node in nodes:
            if isinstance(node, ast.ImportFrom | ast.Import):
                imported = ast.unparse(node)
                assert "PyQt" not in imported.replace("qgis.PyQt", ""), f"{path.name}: {imported}"
                # Qt 6 has these classes in another module than Qt 5.
                assert not re.search(r"\b(QAction|QActionGroup|QShortcut)\b", imported), path.name
                assert "QVariant" not in imported, path.name
        # Qt 6 accepts members of an enumeration only with its name: Qt.Key.Key_A.
        scopes = {id(node.value) for node in nodes if isinstance(node, ast.Attribute)}
        members = {
            ast.unparse(node)
            for node in nodes
            if isinstance(node, ast.Attribute)
            and id(node) not in scopes
            and isinstance(node.value, ast.Name)
            and QT.match(node.value.id)
            and node.attr[:1].isupper()
        }
        assert members <= NO_MEMBERS, path.name
        assert ".exec_(" not in text, path.name


def test_metadata_matches_the_package() -> None:
    metadata = configparser.ConfigParser()
    metadata.read(PLUGIN / "metadata.txt", encoding="utf-8")
    general = metadata["general"]
    assert general["version"] == semsig_gis.__version__
    assert general["qgisMinimumVersion"] == "3.22"
    assert general["hasProcessingProvider"] == "yes"
    assert (PLUGIN / general["icon"]).is_file()


@pytest.mark.parametrize("path", [*PLUGIN.rglob("*.qml"), *PLUGIN.rglob("*.svg")], ids=str)
def test_styles_and_icon_are_valid(path: Path) -> None:
    root = ET.parse(path).getroot()  # noqa: S314 - our own file
    symbols = {symbol.get("name") for symbol in root.iterfind("renderer-v2/symbols/symbol")}
    used = {element.get("symbol") for element in root.iter() if element.get("symbol")}
    assert used == symbols


def test_plugin_has_the_syntax_of_python_3_9() -> None:
    for path in PLUGIN.rglob("*.py"):
        ast.parse(path.read_text(encoding="utf-8"), path.name, feature_version=(3, 9))


@dataclass(frozen=True)
class Qgis:
    """A fresh profile with the plugin from its zip file, and a small city."""

    place: Path
    environment: dict[str, str]
    program: Path

    def process(self, *arguments: object) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [str(argument) for argument in arguments],
            cwd=self.place,
            env=self.environment,
            check=False,
            capture_output=True,
            text=True,
            timeout=6 * PATIENCE_S,
        )

    def run(self, algorithm: str, **parameters: object) -> dict[str, str]:
        """Run an algorithm with `qgis_process`, and return its outputs."""
        values = [f"{name}={value}" for name, value in parameters.items()]
        process = self.process(self.program, "run", f"semsig:{algorithm}", "--", *values)
        assert process.returncode == 0, process.stdout + process.stderr
        results = process.stdout.rpartition("Results\n")[2].splitlines()
        return dict(line.split(":\t", 1) for line in results if ":\t" in line)


@pytest.fixture(scope="module")
def qgis(
    qgis_process: Path, package: SimpleNamespace, tmp_path_factory: pytest.TempPathFactory
) -> Qgis:
    place = tmp_path_factory.mktemp("qgis")
    shutil.copytree(DATA, place, dirs_exist_ok=True)
    database, objects = small_city()
    save_objects(objects, place / "objects.parquet")
    save_with_store(database, ObjectStore.of(objects), place / "city.parquet")
    profile = place / "profile" / "profiles" / "default"
    with zipfile.ZipFile(package.write_zip(place)) as archive:
        archive.extractall(profile / "python" / "plugins")
    # The command is in the settings of the provider, not on the path of QGIS.
    command = place / "semsig of this test"
    (place / "run.py").write_text(QUICK)
    command.write_text(
        f'#!/bin/sh\necho $$ >> "{place}/processes"\n'
        f'test -z "$PYTHONPATH$QT_QPA_PLATFORM$GDAL_DATA" || exit 9\n'
        f'PYTHONPATH="{ROOT}" exec "{sys.executable}" "{place}/run.py" "$@"\n'
    )
    command.chmod(0o755)
    settings = profile / "QGIS" / "QGIS3.ini"
    settings.parent.mkdir(parents=True)
    settings.write_text(
        f"[Processing]\nConfiguration\\SEMSIG_COMMAND={command}\n[PythonPlugins]\nsemsig=true\n"
    )
    place.chmod(0o700)  # required by Qt for its runtime folder
    environment = {**qgis_variables(place), "GDAL_DATA": "/usr/share/gdal"}
    return Qgis(place, environment, qgis_process)


def test_load_and_build_write_their_outputs(qgis: Qgis) -> None:
    objects = qgis.place / "lamps.parquet"
    files = {"OUTPUT": objects, "BUILDINGS": qgis.place / "no_buildings.parquet"}
    outputs = qgis.run("load", FOLDER=qgis.place, CATALOG_FILE=qgis.place / "town.toml", **files)
    assert outputs == {"OUTPUT": str(objects)}
    assert len(open_objects(objects)) == 3
    files = {"OUTPUT": qgis.place / "lamps_city.parquet", "CELLS": qgis.place / "lamps.gpkg"}
    outputs = qgis.run("build", OBJECTS=objects, RADIUS=20, **files)
    database = open_database(outputs["OUTPUT"])
    assert database.spec.radius == 20.0
    assert outputs["CELLS"] == f"{files['CELLS']}|layername=cells"
    assert len(gpd.read_file(files["CELLS"], layer="cells")) == len(database)


@pytest.fixture(scope="module")
def session(qgis: Qgis, package: SimpleNamespace) -> dict[str, Any]:
    """Run `qgis_session.py` in the Python of QGIS, and return its results."""
    python = shutil.which("python3", path=os.defpath) or "python3"
    shutil.copy(qgis.place / "city.parquet", qgis.place / "session.parquet")
    translations = package.read_translations(ROOT / "qgis_plugin" / "i18n" / "semsig_de.ts")
    (qgis.place / "sources.json").write_text(json.dumps(sorted(translations)), "utf-8")
    database, _ = small_city()
    cell = int(database.lengths.argmax())
    bearings = database.signature(cell).bearings
    assert bearings is not None
    turned = ",".join(f"{bearing:.1f}" for bearing in bearings)
    query = json.dumps({"TYPES": database.types(cell), "BEARINGS": turned})
    process = qgis.process(python, SCRIPT, qgis.place, qgis.place / "town.toml", query)
    if "No module named 'qgis'" in process.stderr:
        unavailable("qgis", f"{python} does not have QGIS's modules")
    assert process.returncode == 0, process.stdout + process.stderr
    results: dict[str, Any] = json.loads(process.stdout.splitlines()[-1])
    return results


def test_algorithms_are_listed_and_files_are_loaded(session: dict[str, Any], qgis: Qgis) -> None:
    six = ["load", "build", "localize", "evaluate", "identify", "export"]
    others = ["ambiguity", "demo", "fetchcanvas", "fetch", "draft", "update"]
    assert session["listed"] == [*six, *others]
    assert session["loaded"] is True
    assert len(open_objects(qgis.place / "session_lamps.parquet")) == 3
    text = session["help"]
    assert "<p>Finds where in the city a view was taken from: what is seen, clockwise" in text
    assert "?&lt;=10" in text


@pytest.mark.usefixtures("session")
def test_answer_is_written_with_styles(qgis: Qgis) -> None:
    database, _ = small_city()
    names = ("CANDIDATES", "PLACE", "REGIONS")
    candidates, place, regions = (qgis.place / f"{name}.gpkg" for name in names)
    for file, name in ((candidates, "candidates"), (place, "place")):
        styles = gpd.read_file(file, layer="layer_styles")
        assert styles["styleName"].tolist() == [name]
        assert styles["useAsDefault"].all()
    best, ellipse, area = (gpd.read_file(file, layer=0) for file in (candidates, place, regions))
    assert best["rank"].tolist() == [1, 2, 3]
    assert best["cell_id"][0] == database.cell_ids[database.lengths.argmax()]
    assert best["chance"].is_monotonic_decreasing
    assert best["distance"].isna().all()
    assert best.crs == database.crs
    assert ellipse["answered"].tolist() == ["yes"]
    assert area.geometry[0].distance(best.geometry[0]) == 0
    assert ellipse.geometry[0].centroid.distance(best.geometry[0]) < 10
    assert "<html" in (qgis.place / "place.html").read_text(encoding="utf-8")[:200].lower()


def test_evaluation_is_written(session: dict[str, Any], qgis: Qgis) -> None:
    folder, layers, map_ = (qgis.place / f"evaluation{end}" for end in ("", ".gpkg", ".html"))
    outputs = session["evaluated"]
    assert 0 < float(outputs["WITHIN_50_M"]) <= 1
    settings = json.loads((folder / "evaluation.json").read_text("utf-8"))["settings"]
    assert (settings["queries"], settings["distortions"]) == (20, ["light", "compass:5"])
    assert outputs["LAYERS"] == f"{layers}|layername=evaluation"
    assert len(gpd.read_file(layers, layer="evaluation")) == 20
    assert outputs["MAP"] == str(map_)
    assert map_.is_file()


def test_layers_are_shown_with_styles(session: dict[str, Any]) -> None:
    assert session["shown"] == {
        "Candidates": ["graduatedSymbol", "rank"],
        "Place": ["categorizedSymbol", "answered"],
        "Regions to search": ["graduatedSymbol", "rank"],
        "Cells": ["graduatedSymbol", "chance_found"],
        "Street objects": ["categorizedSymbol", "class_code"],
        "Queries": ["categorizedSymbol", "outcome"],
        "From the true to the best place": ["categorizedSymbol", "outcome"],
    }
    order = session["order"]
    assert order.index("Queries") < order.index("From the true to the best place")


def test_qgis_reads_the_translations(session: dict[str, Any], package: SimpleNamespace) -> None:
    for language, texts in session["translations"].items():
        file = ROOT / "qgis_plugin" / "i18n" / f"semsig_{language}.ts"
        translations = package.read_translations(file)
        assert texts == [translations[source] for source in sorted(translations)]


def test_layers_are_in_groups_with_points_above_areas(session: dict[str, Any]) -> None:
    assert session["groups"]["Localize a query"] == ["Candidates", "Place", "Regions to search"]
    assert session["groups"]["Export cells"] == ["Street objects", "Cells"]


def test_other_tools_write_their_outputs(session: dict[str, Any]) -> None:
    others = session["others"]
    assert others["missing"] == []
    assert others["nowhere"] == ["No place was given; type a name, or choose a layer of polygons."]
    assert set(others["groups"]["Demo city"]) == {
        *("Queries", "From the true to the best place", "Street objects", "Cells")
    }


def test_second_run_into_the_same_files_updates_the_layers(session: dict[str, Any]) -> None:
    first, second = session["first"], session["second"]
    for name in ("Candidates", "Regions to search"):
        ((rows, extent, _),), ((new_rows, new_extent, _),) = first[name], second[name]
        assert new_rows < rows
        assert new_extent != extent
    columns, new_columns = first["Regions to search"][0][2], second["Regions to search"][0][2]
    assert "chance" in set(new_columns) - set(columns)
    assert ("Place" in first, "Place" in second) == (False, True)
    shared, tied, searched = first["infos"]
    assert shared.startswith("The best ")
    assert tied.endswith("further cells tie with the last candidate.")
    assert searched.startswith("To search: ")
    placed, searched = second["infos"][-2:]
    assert "m of the ellipse's middle: chance " in placed
    assert searched.startswith("To search: ")


def test_invalid_parameters_are_refused(session: dict[str, Any]) -> None:
    expected = (
        ("--heading and --area work only with the likelihood method",),
        ("Place was given with the method types:edit",),
        ("Detector was given with the method edit+edit",),
        ("b.shp does not end in .gpkg",),
        ("map.json does not end in .html",),
        ("lamps.geojson is not a folder",),
        ("/bin/true is not the semsig command", "later.parquet"),
    )
    for (sentence,), words in zip(session["refused"], expected, strict=True):
        assert all(word in sentence for word in words), sentence
    assert "install it with Plugins > Semantic signatures > Engine..." in session["lost"]


def test_cells_are_identified_and_exported(session: dict[str, Any], qgis: Qgis) -> None:
    assert set(session["identified"]) == {"CELLS", "MAP"}
    source = qgis.place / "session.parquet"  # with the columns of the session
    cells = gpd.read_file(qgis.place / "cells.gpkg", layer="cells")
    assert cells["chance_found"].between(0, 1).all()
    assert (qgis.place / "cells.html").is_file()
    objects, out = qgis.place / "objects.parquet", qgis.place / "export.gpkg"
    qgis.run("export", DATABASE=source, OBJECTS=objects, GEOMETRY="point", OUTPUT=out)
    layers = dict(pyogrio.list_layers(out).tolist())
    assert layers["cells"] == layers["objects"] == "Point"


def test_failed_or_cancelled_run_reports_it_and_leaves_no_files(
    session: dict[str, Any],
) -> None:
    run = session["failed"]
    (sentence,) = run["errors"]
    assert "objects.parquet is a street objects file; give a signature database file." in sentence
    assert (run["successful"], run["left"]) == (False, [])
    run = session["cancelled"]
    assert run["errors"] == ["Cancelled; no file is half-written."]
    assert (run["successful"], run["left"]) == (False, [])
    assert run["percents"] != []
    with pytest.raises(ProcessLookupError):
        os.kill(run["process"], 0)
