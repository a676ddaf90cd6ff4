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

import geopandas as gpd
import pyogrio
import pytest
from machine import PATIENCE_S, qgis_variables, unavailable
from semsig.arguments import KINDS_OF_ONE
from semsig.tools import LEFT_OUT
from small_city import small_city

import semsig_gis
from semsig_gis.commands import commands
from semsig_gis.commands.schema import command_schema
from semsig_gis.database import ObjectStore, open_database, save_with_store
from semsig_gis.objects import open_objects, save_objects

ROOT = Path(__file__).parents[2]
PLUGIN = ROOT / "qgis_plugin" / "semsig"
LAYERS = ROOT / "semsig_gis" / "output" / "layers"
SCRIPT = Path(__file__).with_name("qgis_session.py")
LAYERS_OF_ANSWER = ("candidates", "place", "regions")
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
        suffixes = {".py", ".txt", ".svg", ".json", ".qm", ".md", ""}
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


def paragraphs(text: str) -> set[str]:
    """Return the paragraphs of a text without line breaks, as they are shown."""
    return {" ".join(part.split()) for part in text.strip().split("\n\n")}


def schema_texts(command: dict[str, Any]) -> set[str]:
    """Return the texts of a command and its options."""
    texts = {command["title"], command["group"], *paragraphs(command["description"])}
    for option in command["request"]["properties"].values():
        texts |= {option["title"], *paragraphs(option["description"])}
        texts |= {option.get("x-default", ""), option.get("x-unit", "")}
    return texts


def code_texts(path: Path) -> set[str]:
    """Return the texts in the code of the plugin, and the titles of layers."""
    values: list[ast.expr | None] = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Dict):  # options of a tool
            keys = [key.value if isinstance(key, ast.Constant) else None for key in node.keys]
            pairs = zip(keys, node.values, strict=True)
            values += [value for key, value in pairs if key == "description"]
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name)):
            continue
        if node.func.id in {"tr", "Extra"}:
            values += node.args[:1]
        elif node.func.id.endswith(("layer", "Layer", "Tool")):
            values += [key.value for key in node.keywords if key.arg in {"title", "help"}]
    texts = [value.value for value in values if isinstance(value, ast.Constant)]
    return {part for text in texts if isinstance(text, str) for part in paragraphs(text)}


def shown_texts() -> set[str]:
    """Return all texts of the windows, the toolbox, its help and the titles of layers."""
    schemas = [command_schema(item) for name, item in commands().items() if name not in LEFT_OUT]
    files = [*PLUGIN.glob("*.py"), *LAYERS.glob("*.py")]
    texts = {text for schema in schemas for text in schema_texts(schema)}
    texts |= {text for path in files for text in code_texts(path)}
    return texts - {""} | {*KINDS_OF_ONE.values()}


@pytest.mark.parametrize("language", ["de", "fr"])
def test_all_texts_are_translated(package: SimpleNamespace, language: str) -> None:
    file = ROOT / "qgis_plugin" / "i18n" / f"semsig_{language}.ts"
    translations = package.read_translations(file)
    assert shown_texts() == set(translations)
    # Places for values, commands and options are the same in each language.
    names = r"{\w*}|`semsig [^`]*`|(?<!\w)--[a-z][a-z-]*"
    for source, text in translations.items():
        assert set(re.findall(names, source)) == set(re.findall(names, text)), text
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
    files = {"OUT": objects, "BUILDINGS": qgis.place / "no_buildings.parquet"}
    outputs = qgis.run("load", FILES=qgis.place, CATALOG_FILE=qgis.place / "town.toml", **files)
    assert outputs == {"OUT": str(objects)}
    assert len(open_objects(objects)) == 3
    files = {"OUT": qgis.place / "lamps_city.parquet", "CELLS": qgis.place / "lamps.gpkg"}
    outputs = qgis.run("build", OBJECTS=objects, RADIUS=20, **files)
    database = open_database(outputs["OUT"])
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


@pytest.mark.parametrize("name", sorted(set(commands()) - {*LEFT_OUT}))
def test_parameters_are_those_of_the_schema(session: dict[str, Any], name: str) -> None:
    command, tool = commands()[name], session["tools"][name]
    assert (tool["title"].lstrip("1234. "), tool["group"]) == (command.title, command.group)
    hidden = {"localize": {"more", "queries", "adapt", "symbols"}}.get(name, set())
    fields = [field for field in command.fields if field.name not in hidden]
    parameters = dict(tool["parameters"])
    for extra in {"build": ["CELLS"], "draft": ["OUT"], "evaluate": ["LAYERS", "MAP"],
                  "identify": ["CELLS", "MAP"]}.get(name, []):  # fmt: skip
        del parameters[extra]
    for field in fields:
        unit = f" ({field.option.unit})" if field.option.unit else ""
        key = field.name.strip("_").upper()
        names = [key, *(f"{key}_{part}" for part in ("EXTENT", "FILE", "TEXT"))]
        shown = [parameters.pop(name) for name in names if name in parameters]
        assert shown, field.name
        for parameter in shown:
            assert parameter["title"].partition(": ")[0] == field.title + unit
            assert parameter["advanced"] == field.option.advanced
            if len(shown) == 1 and field.option.writes is None:
                assert parameter["optional"] == (not field.required and field.default is None)
        parameter = shown[0]
        if field.kind in {int, float} and not field.many:
            low, high = field.option.low, field.option.high
            bounds = [low, None if high is None else min(high, 2**31 - 1)]
            for bound, limit in zip(bounds, ("minimum", "maximum"), strict=True):
                assert bound is None or parameter[limit] == bound
        if field.choices:
            assert parameter["choices"] == list(field.choices)
        if not field.many and field.option.writes is None:
            assert parameter["default"] == field.default
    assert not parameters


def test_tools_have_numbers_help_and_variants(session: dict[str, Any], qgis: Qgis) -> None:
    tools = session["tools"]
    numbered = {tool["title"][0]: name for name, tool in tools.items() if tool["title"][1] == "."}
    assert numbered == {"1": "load", "2": "build", "3": "localize", "4": "evaluate"}
    assert set(tools) == set(commands()) - {*LEFT_OUT} | {"ambiguity", "fetchcanvas"}
    assert set(tools["fetchcanvas"]["parameters"]) == {"AREA_EXTENT", "OUT", "BUILDINGS", "STREETS"}
    assert re.fullmatch(r"[\d.,]+ \[EPSG:2154\]", session["extent"])
    assert set(tools["ambiguity"]["parameters"]) == {"DATABASE", "OUT", "MAP"}
    text = tools["localize"]["help"]
    assert "“2. Build signature database”" in text
    assert "?&lt;=10" in text
    assert "--" not in re.sub(r"&\w+;", "", tools["build"]["help"])
    assert session["loaded"] is True
    assert len(open_objects(qgis.place / "session_lamps.parquet")) == 3


@pytest.mark.usefixtures("session")
def test_answer_is_written_with_styles(qgis: Qgis) -> None:
    database, _ = small_city()
    file = qgis.place / "answer.gpkg"
    styles = gpd.read_file(file, layer="layer_styles")
    assert set(styles["f_table_name"]) == {*LAYERS_OF_ANSWER, "ellipse"}
    best, place, area = (gpd.read_file(file, layer=name) for name in LAYERS_OF_ANSWER)
    assert best["rank"].tolist() == [1, 2, 3]
    assert best["cell_id"][0] == database.cell_ids[database.lengths.argmax()]
    assert best["chance"].is_monotonic_decreasing
    assert area.geometry[0].distance(best.geometry[0]) == 0
    assert place.geometry[0].distance(best.geometry[0]) < 10
    assert "<html" in (qgis.place / "place.html").read_text(encoding="utf-8")[:200].lower()


def test_evaluation_is_written(session: dict[str, Any], qgis: Qgis) -> None:
    folder, layers, map_ = (qgis.place / f"evaluation{end}" for end in ("", ".gpkg", ".html"))
    outputs = session["evaluated"]
    settings = json.loads((folder / "evaluation.json").read_text("utf-8"))["settings"]
    assert (settings["queries"], settings["distortions"]) == (20, ["light", "compass:5"])
    assert outputs == {
        "OUT": str(folder),
        "LAYERS": f"{layers}|layername=evaluation",
        "MAP": str(map_),
    }
    assert len(gpd.read_file(layers, layer="evaluation")) == 20
    assert map_.is_file()


def test_layers_are_shown_with_styles(session: dict[str, Any]) -> None:
    assert session["shown"] == {
        "Candidates": ["graduatedSymbol", "rank"],
        "Place": ["categorizedSymbol", "answer"],
        "Ellipse of the place": ["categorizedSymbol", "answer"],
        "Regions to search": ["graduatedSymbol", "rank"],
        "Signature cells": ["graduatedSymbol", "chance_found"],
        "Street objects": ["categorizedSymbol", "class_code"],
        "Queries": ["categorizedSymbol", "outcome"],
        "From the true to the best place": ["categorizedSymbol", "outcome"],
    }
    order = session["order"]
    assert order.index("Queries") < order.index("From the true to the best place")


def test_cells_turn_grey_below_an_answer(session: dict[str, Any]) -> None:
    muted = session["muted"]
    assert muted["before"] == muted["restored"] == "graduatedSymbol"
    assert muted["answered"] == "singleSymbol"
    red, green, blue = bytes.fromhex(muted["colour"][1:])
    assert max(red, green, blue) - min(red, green, blue) < 10


def test_qgis_reads_the_translations(session: dict[str, Any], package: SimpleNamespace) -> None:
    for language, texts in session["translations"].items():
        file = ROOT / "qgis_plugin" / "i18n" / f"semsig_{language}.ts"
        translations = package.read_translations(file)
        assert texts == [translations[source] for source in sorted(translations)]


def test_layers_are_in_groups_with_points_above_areas(session: dict[str, Any]) -> None:
    title = commands()["localize"].title
    assert sorted(session["groups"][title][:2]) == ["Candidates", "Place"]
    assert session["groups"][title][-1] == "Regions to search"
    assert session["groups"][commands()["export"].title] == ["Street objects", "Signature cells"]


def test_other_tools_write_their_outputs(session: dict[str, Any]) -> None:
    others = session["others"]
    assert others["missing"] == []
    assert "cells" in others["info"]
    assert "│" not in others["info"]
    assert set(others["groups"][commands()["demo"].title]) == {
        *("Queries", "From the true to the best place", "Street objects", "Signature cells"),
        *("Streets", "Buildings"),
    }


def test_second_run_into_the_same_file_updates_the_layers(session: dict[str, Any]) -> None:
    first, second = session["first"], session["second"]
    for name in ("Candidates", "Regions to search"):
        (rows, extent), (new_rows, new_extent) = first["layers"][name], second["layers"][name]
        assert new_rows < rows
        assert new_extent != extent
    assert ("Place" in first["layers"], "Place" in second["layers"]) == (False, True)
    for log in (first["log"], second["log"]):
        assert "to search: " in log.lower()
        assert "rank | cell" in log  # a table


def test_invalid_parameters_are_refused(session: dict[str, Any]) -> None:
    expected = (
        ("--heading and --area work only with the likelihood method",),
        ("Area was given as", "give one of them"),
        ("b.shp does not end in .gpkg",),
        ("map.json does not end in .html",),
        ("lamps.geojson is not a folder",),
        ("Area was not given",),
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
    qgis.run("export", DATABASE=source, OBJECTS=objects, GEOMETRY="point", OUT=out)
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
