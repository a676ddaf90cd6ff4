"""The QGIS plugin: its zip file, and what it does in a real QGIS."""

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
    """Return what the program defines that makes the zip file."""
    return SimpleNamespace(**runpy.run_path(str(ROOT / "qgis_plugin" / "package.py")))


def test_the_zip_file_is_always_the_same_and_holds_what_a_plugin_needs(
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
        assert {Path(name).suffix for name in names} == {
            ".py",
            ".txt",
            ".svg",
            ".qml",
            ".qm",
            ".md",
            "",
        }
        assert {entry.date_time for entry in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        code = {name for name in names if name.endswith(".py")}
    assert code == {f"semsig/{path.name}" for path in PLUGIN.glob("*.py")}


def test_the_official_repository_would_take_it(
    package: SimpleNamespace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("SEMSIG_REPOSITORY", raising=False)
    (fault,) = package.faults(package.write_zip(tmp_path))
    assert fault.startswith("metadata.txt has no email, tracker, repository, homepage; give the ")
    monkeypatch.setenv("SEMSIG_REPOSITORY", "https://a.org/semsig/")
    plugin = package.write_zip(tmp_path, email="a@a.org")
    assert package.faults(plugin) == []
    told = configparser.ConfigParser()
    with zipfile.ZipFile(plugin) as archive:
        told.read_string(archive.read("semsig/metadata.txt").decode())
    assert {name: told["general"][name] for name in ("email", *package.ADDRESSES)} == {
        "email": "a@a.org",
        "homepage": "https://a.org/semsig",
        "repository": "https://a.org/semsig",
        "tracker": "https://a.org/semsig/issues",
    }


def shown_texts() -> set[str]:
    """Return what the windows and the toolbox show, with the help of the tools."""
    found = set()
    kinds = {"choice", "number", "whole_number", "layers_to_write", "file_to_read", "file_to_write"}
    for path in PLUGIN.glob("*.py"):
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
                    found |= {" ".join(part.split()) for part in parts}
                elif name == "OUTPUTS":
                    found |= {text for _, *shown in ast.literal_eval(node.value) for text in shown}
            texts = [one.value for one in values if isinstance(one, ast.Constant)]
            found |= {one for one in texts if isinstance(one, str)}
    return found - {""}


@pytest.mark.parametrize("language", ["de", "fr"])
def test_what_is_shown_is_translated(package: SimpleNamespace, language: str) -> None:
    words = package.read_words(ROOT / "qgis_plugin" / "i18n" / f"semsig_{language}.ts")
    assert shown_texts() - set(words) == set()
    for source, text in words.items():
        assert set(re.findall(r"{\w*}", source)) == set(re.findall(r"{\w*}", text)), text
    # Any file that Qt reads begins so; what it reads from it is tested in QGIS.
    assert package.compiled(words)[:4] == bytes.fromhex("3cb86418")


QT = re.compile(r"^(Q[A-Z]\w*|Qt|Qgs\w+)$")
# What is no member of an enumeration, but a class or an enumeration itself.
NO_MEMBERS = {"QgsProcessingContext.LayerDetails", "QgsFileWidget.StorageMode"}


def test_the_code_fits_the_qt_of_qgis_3_and_of_4() -> None:
    for path in PLUGIN.glob("*.py"):
        text = path.read_text(encoding="utf-8")
        nodes = [*ast.walk(ast.parse(text))]
        for node in nodes:
            if isinstance(node, ast.ImportFrom | ast.Import):
                told = ast.unparse(node)
                assert "PyQt" not in told.replace("qgis.PyQt", ""), f"{path.name}: {told}"
                # Qt 6 has them in another module than Qt 5.
                assert not re.search(r"\b(QAction|QActionGroup|QShortcut)\b", told), path.name
                assert "QVariant" not in told, path.name
        # Qt 6 knows the members of an enumeration by its name alone: Qt.Key.Key_A.
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


def test_the_metadata_is_that_of_the_package() -> None:
    metadata = configparser.ConfigParser()
    metadata.read(PLUGIN / "metadata.txt", encoding="utf-8")
    general = metadata["general"]
    assert general["version"] == semsig_gis.__version__
    assert general["qgisMinimumVersion"] == "3.22"
    assert general["hasProcessingProvider"] == "yes"
    assert (PLUGIN / general["icon"]).is_file()


@pytest.mark.parametrize("path", [*PLUGIN.rglob("*.qml"), *PLUGIN.rglob("*.svg")], ids=str)
def test_styles_and_the_icon_are_sound(path: Path) -> None:
    root = ET.parse(path).getroot()  # noqa: S314 - our own file
    symbols = {one.get("name") for one in root.iterfind("renderer-v2/symbols/symbol")}
    used = {one.get("symbol") for one in root.iter() if one.get("symbol")}
    assert used == symbols


def test_the_plugin_runs_on_an_old_python() -> None:
    for path in PLUGIN.glob("*.py"):
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
        done = self.process(self.program, "run", f"semsig:{algorithm}", "--", *values)
        assert done.returncode == 0, done.stdout + done.stderr
        results = done.stdout.rpartition("Results\n")[2].splitlines()
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
    # The command is chosen in the settings of the provider; it is not on the path of QGIS.
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
    place.chmod(0o700)  # as Qt wishes its runtime folder to be
    environment = {**qgis_variables(place), "GDAL_DATA": "/usr/share/gdal"}
    return Qgis(place, environment, qgis_process)


def test_load_and_build(qgis: Qgis) -> None:
    objects = qgis.place / "lamps.parquet"
    files = {"OUTPUT": objects, "BUILDINGS": qgis.place / "no_buildings.parquet"}
    done = qgis.run("load", FOLDER=qgis.place, CATALOG_FILE=qgis.place / "town.toml", **files)
    assert done == {"OUTPUT": str(objects)}
    assert len(open_objects(objects)) == 3
    files = {"OUTPUT": qgis.place / "lamps_city.parquet", "CELLS": qgis.place / "lamps.gpkg"}
    done = qgis.run("build", OBJECTS=objects, RADIUS=20, **files)
    database = open_database(done["OUTPUT"])
    assert database.spec.radius == 20.0
    assert done["CELLS"] == f"{files['CELLS']}|layername=cells"
    assert len(gpd.read_file(files["CELLS"], layer="cells")) == len(database)


@pytest.fixture(scope="module")
def session(qgis: Qgis, package: SimpleNamespace) -> dict[str, Any]:
    """Play `qgis_session.py` in QGIS's own Python, and return what it tells."""
    python = shutil.which("python3", path=os.defpath) or "python3"
    shutil.copy(qgis.place / "city.parquet", qgis.place / "session.parquet")
    words = package.read_words(ROOT / "qgis_plugin" / "i18n" / "semsig_de.ts")
    (qgis.place / "sources.json").write_text(json.dumps(sorted(words)), "utf-8")
    database, _ = small_city()
    cell = int(database.lengths.argmax())
    bearings = database.signature(cell).bearings
    assert bearings is not None
    turned = ",".join(f"{bearing:.1f}" for bearing in bearings)
    query = json.dumps({"TYPES": database.types(cell), "BEARINGS": turned})
    done = qgis.process(python, SCRIPT, qgis.place, qgis.place / "town.toml", query)
    if "No module named 'qgis'" in done.stderr:
        unavailable("qgis", f"{python} does not have QGIS's modules")
    assert done.returncode == 0, done.stdout + done.stderr
    happened: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return happened


def test_qgis_lists_the_algorithms_and_loads_a_file(session: dict[str, Any], qgis: Qgis) -> None:
    six = ["load", "build", "localize", "evaluate", "identify", "export"]
    others = ["ambiguity", "demo", "fetchcanvas", "fetch", "draft", "update"]
    assert session["listed"] == [*six, *others]
    assert session["loaded"] is True
    assert len(open_objects(qgis.place / "session_lamps.parquet")) == 3
    text = session["help"]
    assert "<p>Tells where in the city a view was taken from: what is seen, clockwise" in text
    assert "?&lt;=10" in text


@pytest.mark.usefixtures("session")
def test_what_is_localized_is_written_with_its_styles(qgis: Qgis) -> None:
    database, _ = small_city()
    names = ("CANDIDATES", "PLACE", "REGIONS")
    candidates, place, regions = (qgis.place / f"{name}.gpkg" for name in names)
    for file, name in ((candidates, "candidates"), (place, "place")):
        styles = gpd.read_file(file, layer="layer_styles")
        assert styles["styleName"].tolist() == [name]
        assert styles["useAsDefault"].all()
    best, here, where = (gpd.read_file(file, layer=0) for file in (candidates, place, regions))
    assert best["rank"].tolist() == [1, 2, 3]
    assert best["cell_id"][0] == database.cell_ids[database.lengths.argmax()]
    assert best["chance"].is_monotonic_decreasing
    assert best["distance"].isna().all()
    assert best.crs == database.crs
    assert here["answered"].tolist() == ["yes"]
    assert where.geometry[0].distance(best.geometry[0]) == 0
    assert here.geometry[0].centroid.distance(best.geometry[0]) < 10
    assert "<html" in (qgis.place / "place.html").read_text(encoding="utf-8")[:200].lower()


def test_what_is_evaluated_is_written(session: dict[str, Any], qgis: Qgis) -> None:
    folder, layers, map_ = (qgis.place / f"evaluation{end}" for end in ("", ".gpkg", ".html"))
    done = session["evaluated"]
    assert 0 < float(done["WITHIN_50_M"]) <= 1
    asked = json.loads((folder / "evaluation.json").read_text("utf-8"))["settings"]
    assert (asked["queries"], asked["distortions"]) == (20, ["light", "compass:5"])
    assert done["LAYERS"] == f"{layers}|layername=evaluation"
    assert len(gpd.read_file(layers, layer="evaluation")) == 20
    assert done["MAP"] == str(map_)
    assert map_.is_file()


def test_layers_are_shown_with_their_styles(session: dict[str, Any]) -> None:
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
    for language, told in session["spoken"].items():
        words = package.read_words(ROOT / "qgis_plugin" / "i18n" / f"semsig_{language}.ts")
        assert told == [words[source] for source in sorted(words)]


def test_layers_come_in_groups_points_above_areas(session: dict[str, Any]) -> None:
    assert session["groups"]["Localize a query"] == ["Candidates", "Place", "Regions to search"]
    assert session["groups"]["Export cells"] == ["Street objects", "Cells"]


def test_the_other_tools_do_their_work(session: dict[str, Any]) -> None:
    told = session["others"]
    assert told["missing"] == []
    assert told["nowhere"] == ["No place was given; type a name, or choose a layer of polygons."]
    assert set(told["groups"]["Demo city"]) == {
        *("Queries", "From the true to the best place", "Street objects", "Cells")
    }


def test_a_second_run_into_the_same_files_is_shown(session: dict[str, Any]) -> None:
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
    assert "m of the ellipse's middle with a chance of" in placed
    assert searched.startswith("To search: ")


def test_what_cannot_be_is_refused_before_the_work(session: dict[str, Any]) -> None:
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
    source = qgis.place / "session.parquet"  # of which everything is known by now
    cells = gpd.read_file(qgis.place / "cells.gpkg", layer="cells")
    assert cells["chance_found"].between(0, 1).all()
    assert (qgis.place / "cells.html").is_file()
    objects, out = qgis.place / "objects.parquet", qgis.place / "export.gpkg"
    qgis.run("export", DATABASE=source, OBJECTS=objects, GEOMETRY="point", OUTPUT=out)
    layers = dict(pyogrio.list_layers(out).tolist())
    assert layers["cells"] == layers["objects"] == "Point"


def test_a_run_that_fails_or_is_cancelled_says_so_and_leaves_nothing(
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
