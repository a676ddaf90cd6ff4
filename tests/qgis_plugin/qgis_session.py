"""A session in the Python of QGIS: `qgis_session.py FOLDER CATALOGUE QUERY`.

Its last line of output is JSON with the results. This is not a module of tests.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

from qgis.core import (
    QgsApplication,
    QgsProcessingAlgRunnerTask,
    QgsProcessingContext,
    QgsProcessingFeedback,
    QgsProcessingOutputLayerDefinition,
    QgsProject,
    QgsRenderContext,
)
from qgis.PyQt.QtCore import QCoreApplication, QTranslator

PLACE = Path(sys.argv[1])
DATABASE = str(PLACE / "session.parquet")
TEMPORARY = "TEMPORARY_OUTPUT"
EVERYWHERE = QgsRenderContext()

application = QgsApplication([], True)  # noqa: FBT003 - with a screen, which may be virtual
application.initQgis()
sys.path += [
    str(Path(application.pkgDataPath(), "python", "plugins")),
    str(PLACE / "profile" / "profiles" / "default" / "python" / "plugins"),
]

import semsig  # noqa: E402 - from the profile
from processing.core.Processing import Processing  # noqa: E402
from processing.core.ProcessingConfig import ProcessingConfig  # noqa: E402
from processing.gui.Postprocessing import handleAlgorithmResults  # noqa: E402


class Feedback(QgsProcessingFeedback):
    """Records messages and progress; can cancel at the first step of a build."""

    def __init__(self, *, cancelling: bool = False) -> None:
        super().__init__()
        self.cancelling = cancelling
        self.errors: list[str] = []
        self.infos: list[str] = []
        self.percents: list[float] = []
        self.ended: list[bool] = []  # whether it succeeded
        self.results: dict[str, Any] = {}

    def setProgress(self, percent: float) -> None:  # noqa: N802
        self.percents.append(percent)

    def reportError(self, error: str, fatalError: bool = False) -> None:  # noqa: ARG002, FBT001, FBT002, N802, N803
        self.errors.append(error)

    def pushInfo(self, info: str) -> None:  # noqa: N802
        self.infos.append(info)

    def setProgressText(self, text: str) -> None:  # noqa: N802
        if self.cancelling and text == "Building":
            self.cancel()


def algorithm(name: str) -> Any:  # noqa: ANN401
    """Return an algorithm as the toolbox does."""
    return QgsApplication.processingRegistry().createAlgorithmById(f"semsig:{name}")


def run(name: str, *, cancelling: bool = False, **parameters: Any) -> Feedback:  # noqa: ANN401
    """Run an algorithm as its dialog does, and load its layers."""
    feedback = Feedback(cancelling=cancelling)
    context = QgsProcessingContext()
    context.setProject(QgsProject.instance())
    ready = algorithm(name)
    task = QgsProcessingAlgRunnerTask(ready, parameters, context, feedback)

    def end(successful: bool, results: dict[str, Any]) -> None:  # noqa: FBT001 - as Qt calls it
        feedback.results = results
        feedback.ended.append(successful)

    task.executed.connect(end)
    QgsApplication.taskManager().addTask(task)
    while not feedback.ended:
        application.processEvents()
        time.sleep(0.01)
    if feedback.ended[0]:
        handleAlgorithmResults(ready, context, feedback)
    return feedback


def run_ok(name: str, **parameters: Any) -> Feedback:  # noqa: ANN401
    """Run an algorithm on the database, which must succeed."""
    feedback = run(name, DATABASE=DATABASE, **parameters)
    if not feedback.ended[0]:
        raise RuntimeError(feedback.errors)
    return feedback


def shown(place: str = TEMPORARY) -> QgsProcessingOutputLayerDefinition:
    """Return an output that is loaded into the project, a temporary one by default."""
    return QgsProcessingOutputLayerDefinition(place, QgsProject.instance())


def layer_contents() -> dict[str, Any]:
    """Return rows, extent and columns of all layers of the project, by name."""
    layers: dict[str, Any] = {}
    for layer in QgsProject.instance().mapLayers().values():
        rows = len(list(layer.getFeatures()))
        facts = [rows, layer.extent().toString(), layer.fields().names()]
        layers.setdefault(layer.name(), []).append(facts)
    return layers


def show_twice() -> dict[str, Any]:
    """Write the same files twice while their layers are shown; return both contents."""
    layers = {}
    regions = str(PLACE / "regions.gpkg")
    # The layer has the name of its file, which contains another layer as well.
    area = f"{regions}|layername=regions"
    files = {
        "CANDIDATES": shown(str(PLACE / "new" / "candidates.gpkg")),
        "PLACE": shown(),
        "REGIONS": shown(regions),
    }
    for time_, query in (
        ("first", {"TYPES": "D", "TOP": 20, "METHOD": "edit+edit"}),
        ("second", {"TYPES": "DDB", "TOP": 3, "SHARE": 0.5, "AREA": area}),
    ):
        feedback = run_ok("localize", **files, **query)
        layers[time_] = {**layer_contents(), "infos": feedback.infos}
    QgsProject.instance().clear()
    return layers


def show(query: dict[str, str]) -> dict[str, Any]:
    """Run the tools that write layers; return their outputs and the renderer of each layer."""

    def file(name: str) -> str:
        return str(PLACE / name)

    places = {name: shown(file(f"{name}.gpkg")) for name in ("CANDIDATES", "PLACE", "REGIONS")}
    run_ok("localize", TOP=3, METHOD="likelihood", MAP=file("place.html"), **places, **query)
    evaluated = run_ok(
        "evaluate",
        QUERIES=20,
        DISTORTION="light",
        MORE="compass:5",
        METHOD="edit+edit",
        OUTPUT=file("evaluation"),
        LAYERS=shown(file("evaluation.gpkg")),
        MAP=file("evaluation.html"),
    )
    cells = shown(file("cells.gpkg"))
    identified = run_ok("identify", NOISE="light", CELLS=cells, MAP=file("cells.html"))
    run_ok("export", OBJECTS=file("objects.parquet"), OUTPUT=shown())
    layers = QgsProject.instance().mapLayers().values()
    renderers = {
        layer.name(): [layer.renderer().type(), *layer.renderer().usedAttributes(EVERYWHERE)]
        for layer in layers
    }
    return {"evaluated": evaluated.results, "identified": identified.results, "shown": renderers}


def groups() -> dict[str, list[str]]:
    """Return the layers of each group, from above."""
    for _ in range(10):
        application.processEvents()
    root = QgsProject.instance().layerTreeRoot()
    return {
        group.name(): [layer.name() for layer in group.findLayers()] for group in root.findGroups()
    }


def others() -> dict[str, Any]:
    """Run the tools without a number, except the downloads."""
    tiff, toml = str(PLACE / "ambiguity.tif"), str(PLACE / "draft.toml")
    updated, objects = str(PLACE / "updated.parquet"), str(PLACE / "objects.parquet")
    run_ok("ambiguity", OUTPUT=tiff, MAP=str(PLACE / "ambiguity.html"))
    run("update", DATABASE=str(PLACE / "city.parquet"), OBJECTS=objects, OUTPUT=updated)
    run_ok("draft", FILE=str(PLACE / "lamps.geojson"), OUTPUT=toml)
    run_ok("demo", OUTPUT=str(PLACE / "demo"), QUERIES=5)
    nowhere = run("fetch", OUTPUT=str(PLACE / "nowhere.parquet")).errors
    existing = {path.name for path in PLACE.iterdir()}
    expected = {"ambiguity.tif", "ambiguity.html", "updated.parquet", "draft.toml", "demo"}
    return {"missing": sorted(expected - existing), "nowhere": nowhere, "groups": groups()}


def translations() -> dict[str, list[str]]:
    """Return the translations of all texts, by language."""
    texts = {}
    sources = json.loads((PLACE / "sources.json").read_text("utf-8"))
    for language in ("de", "fr"):
        translator = QTranslator()
        translator.load(str(Path(semsig.__file__).with_name("i18n") / f"semsig_{language}.qm"))
        QCoreApplication.installTranslator(translator)
        texts[language] = [QCoreApplication.translate("Semsig", source) for source in sources]
        QCoreApplication.removeTranslator(translator)
    return texts


def refuse() -> list[list[str]]:
    """Return the errors of runs with invalid parameters."""
    objects, later = str(PLACE / "objects.parquet"), str(PLACE / "later.parquet")
    area = f"{PLACE / 'regions.gpkg'}|layername=regions"
    query = {"TYPES": "DDB", "METHOD": "types:edit", "CANDIDATES": shown()}
    errors = []
    for name, parameters in (
        ("localize", {**query, "HEADING": "unknown", "AREA": area}),
        ("localize", {**query, "PLACE": str(PLACE / "place.gpkg")}),
        ("evaluate", {"METHOD": "edit+edit", "NOISE": "light", "OUTPUT": TEMPORARY}),
        ("build", {"OBJECTS": objects, "OUTPUT": later, "CELLS": str(PLACE / "b.shp")}),
        ("identify", {"CELLS": shown(), "MAP": str(PLACE / "map.json")}),
        ("evaluate", {"OUTPUT": TEMPORARY, "LAYERS": str(PLACE / "lamps.geojson" / "b.gpkg")}),
    ):
        database: dict[str, Any] = {} if name == "build" else {"DATABASE": DATABASE}
        errors.append(run(name, **database, **parameters).errors)
    ProcessingConfig.setSettingValue("SEMSIG_COMMAND", "/bin/true")
    return [*errors, run("build", OBJECTS=objects, OUTPUT=later).errors]


def stop(name: str, **parameters: Any) -> dict[str, Any]:  # noqa: ANN401
    """Run an algorithm that fails; return its messages and new files."""
    log = PLACE / "processes"
    before = {*PLACE.rglob("*"), log}
    feedback = run(name, **parameters)
    return {
        "successful": feedback.ended[0],
        "errors": feedback.errors,
        "percents": feedback.percents,
        "process": int(log.read_text().split()[-1]),
        "left": [str(path) for path in set(PLACE.rglob("*")) - before],
    }


def play() -> dict[str, Any]:
    """Run all parts, and return their results."""
    registry = QgsApplication.processingRegistry()
    provider = registry.providerById("semsig")
    listed = sorted((item.displayName(), item.name()) for item in provider.algorithms())
    objects = str(PLACE / "objects.parquet")
    lamps, loaded = [str(PLACE / "lamps.geojson")], str(PLACE / "session_lamps.parquet")
    cancelled = {"OUTPUT": str(PLACE / "cancelled.parquet"), "CELLS": shown()}
    results = {
        "listed": [name for _, name in listed],
        "help": algorithm("localize").shortHelpString(),
        "loaded": run("load", FILES=lamps, CATALOG_FILE=sys.argv[2], OUTPUT=loaded).ended[0],
        **show_twice(),
        **show(json.loads(sys.argv[3])),
        "groups": groups(),
        "order": [layer.name() for layer in QgsProject.instance().layerTreeRoot().layerOrder()],
        "failed": stop("export", DATABASE=objects, OUTPUT=str(PLACE / "fails.gpkg")),
        "cancelled": stop(
            "build", cancelling=True, OBJECTS=objects, STEP=1.0, RADIUS=100.0, **cancelled
        ),
    }
    results["translations"] = translations()
    QgsProject.instance().clear()
    results["others"] = others()
    results["refused"] = refuse()
    ProcessingConfig.setSettingValue("SEMSIG_COMMAND", "")
    _, results["lost"] = algorithm("build").canExecute()
    return results


Processing.initialize()
plugin = semsig.classFactory(None)
plugin.initGui()
ProcessingConfig.setSettingValue("SEMSIG_COMMAND", str(PLACE / "semsig of this test"))
output = play()
plugin.unload()
print(json.dumps(output), flush=True)  # noqa: T201 - read by the tests
