"""A session in the Python of QGIS: `qgis_session.py FOLDER CATALOGUE QUERY`.

Its last line of output is JSON with the results. This is not a module of tests.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from qgis import utils
from qgis.core import (
    QgsApplication,
    QgsCoordinateReferenceSystem,
    QgsProcessingAlgRunnerTask,
    QgsProcessingContext,
    QgsProcessingFeedback,
    QgsProcessingOutputLayerDefinition,
    QgsProcessingParameterDefinition,
    QgsProject,
    QgsRectangle,
    QgsRenderContext,
)
from qgis.gui import QgsMapCanvas
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

import semsig.results  # noqa: E402 - from the profile
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

    def pushConsoleInfo(self, info: str) -> None:  # noqa: N802
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
        raise RuntimeError([name, *feedback.errors])
    return feedback


def shown(place: str = TEMPORARY) -> QgsProcessingOutputLayerDefinition:
    """Return an output that is loaded into the project, a temporary one by default."""
    return QgsProcessingOutputLayerDefinition(place, QgsProject.instance())


def described(parameter: Any) -> dict[str, Any]:  # noqa: ANN401
    """Return what the dialog shows of a parameter."""
    flags, names = parameter.flags(), QgsProcessingParameterDefinition.Flag
    details = {name: getattr(parameter, name, lambda: None)() for name in ("minimum", "maximum")}
    return details | {
        "kind": parameter.type(),
        "title": parameter.description(),
        "help": parameter.help(),
        "default": parameter.defaultValue(),
        "choices": parameter.options() if parameter.type() == "enum" else [],
        "optional": bool(flags & names.FlagOptional),
        "advanced": bool(flags & names.FlagAdvanced),
    }


def tools() -> dict[str, Any]:
    """Return title, group, help and parameters of each algorithm."""
    provider = QgsApplication.processingRegistry().providerById("semsig")
    return {
        item.name(): {
            "title": item.displayName(),
            "group": item.group(),
            "help": item.shortHelpString(),
            "parameters": {
                parameter.name(): described(parameter) for parameter in item.parameterDefinitions()
            },
        }
        for item in provider.algorithms()
    }


def default_extent() -> str:
    """Return the default extent of the download where QGIS has a canvas, and make all tools."""
    canvas = QgsMapCanvas()
    canvas.setDestinationCrs(QgsCoordinateReferenceSystem("EPSG:2154"))
    canvas.setExtent(QgsRectangle(700_000, 6_600_000, 700_100, 6_600_100))
    utils.iface = SimpleNamespace(mapCanvas=lambda: canvas)
    for item in QgsApplication.processingRegistry().providerById("semsig").algorithms():
        algorithm(item.name())
    download = algorithm("fetchcanvas")  # its parameters live as long as it does
    utils.iface = None
    return str(download.parameterDefinition("AREA_EXTENT").defaultValue())


def show_twice() -> dict[str, Any]:
    """Write the same file twice while its layers are shown; return both contents."""
    contents = {}
    answer = str(PLACE / "new" / "answer.gpkg")
    (PLACE / "new").mkdir()
    # The layer has the name of its file, which contains other layers as well.
    area = f"{answer}|layername=regions"
    for time_, query in (
        ("first", {"TYPES": "D", "TOP": 20, "METHOD": "edit+edit"}),
        ("second", {"TYPES": "DDB", "TOP": 3, "SHARE": 0.5, "AREA": area}),
    ):
        feedback = run_ok("localize", OUT=shown(answer), **query)
        layers = {
            layer.name(): [len(list(layer.getFeatures())), layer.extent().toString()]
            for layer in QgsProject.instance().mapLayers().values()
        }
        contents[time_] = {"layers": layers, "log": "\n".join(feedback.infos)}
    QgsProject.instance().clear()
    return contents


def show(query: dict[str, str]) -> dict[str, Any]:
    """Run the tools that write layers; return their outputs and the renderer of each layer."""

    def file(name: str) -> str:
        return str(PLACE / name)

    run_ok("localize", TOP=3, MAP=file("place.html"), OUT=shown(file("answer.gpkg")), **query)
    evaluated = run_ok(
        "evaluate",
        QUERIES=20,
        DISTORTION="light,compass:5",
        METHOD="edit+edit",
        OUT=file("evaluation"),
        LAYERS=shown(file("evaluation.gpkg")),
        MAP=file("evaluation.html"),
    )
    cells = shown(file("cells.gpkg"))
    identified = run_ok("identify", NOISE="light", CELLS=cells, MAP=file("cells.html"))
    run_ok("export", OBJECTS=file("objects.parquet"), OUT=shown())
    layers = QgsProject.instance().mapLayers().values()
    renderers = {
        layer.name(): [
            layer.renderer().type(),
            *(
                layer.renderer().usedAttributes(EVERYWHERE)
                & {field.name() for field in layer.fields()}
            ),
        ]
        for layer in layers
    }
    return {"evaluated": evaluated.results, "identified": identified.results, "shown": renderers}


def mute(query: dict[str, str]) -> dict[str, str]:
    """Ask while cells are shown; return how they are drawn before, with the answer, and later."""
    (cells,) = QgsProject.instance().mapLayersByName("Signature cells")[:1]
    kinds = {"before": cells.renderer().type()}
    run_ok("localize", OUT=shown(str(PLACE / "above.gpkg")), **query)
    kinds |= {
        "answered": cells.renderer().type(),
        "colour": cells.renderer().symbol().color().name(),
    }
    semsig.results.restore_cells()
    return kinds | {"restored": cells.renderer().type()}


def groups() -> dict[str, list[str]]:
    """Return the layers of each group, from above."""
    for _ in range(10):
        application.processEvents()
    root = QgsProject.instance().layerTreeRoot()
    return {
        group.name(): [layer.name() for layer in group.findLayers()] for group in root.findGroups()
    }


def others() -> dict[str, Any]:
    """Run other tools, except the downloads."""
    tiff, toml = str(PLACE / "ambiguity.tif"), str(PLACE / "draft.toml")
    updated, objects = str(PLACE / "updated.parquet"), str(PLACE / "objects.parquet")
    run_ok("ambiguity", OUT=tiff, MAP=str(PLACE / "ambiguity.html"))
    run("update", DATABASE=str(PLACE / "city.parquet"), OBJECTS=objects, OUT=updated)
    run_ok("draft", FILE=str(PLACE / "lamps.geojson"), OUT=toml)
    run_ok("demo", OUT=str(PLACE / "demo"), QUERIES=5)
    info = "\n".join(run_ok("info").infos)
    existing = {path.name for path in PLACE.iterdir()}
    expected = {"ambiguity.tif", "ambiguity.html", "updated.parquet", "draft.toml", "demo"}
    return {"missing": sorted(expected - existing), "info": info, "groups": groups()}


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
    area = f"{PLACE / 'answer.gpkg'}|layername=regions"
    query = {"TYPES": "DDB", "METHOD": "types:edit", "OUT": shown()}
    errors = []
    for name, parameters in (
        ("localize", {**query, "HEADING": "unknown", "AREA": area}),
        ("localize", {**query, "AREA": area, "AREA_EXTENT": "0,1,0,1 [EPSG:4326]"}),
        ("build", {"OBJECTS": objects, "OUT": later, "CELLS": str(PLACE / "b.shp")}),
        ("identify", {"CELLS": shown(), "MAP": str(PLACE / "map.json")}),
        ("evaluate", {"OUT": TEMPORARY, "LAYERS": str(PLACE / "lamps.geojson" / "b.gpkg")}),
        ("fetch", {"CATALOG": "openstreetmap", "OUT": str(PLACE / "nowhere.parquet")}),
    ):
        database: dict[str, Any] = {} if name in {"build", "fetch"} else {"DATABASE": DATABASE}
        errors.append(run(name, **database, **parameters).errors)
    ProcessingConfig.setSettingValue("SEMSIG_COMMAND", "/bin/true")
    return [*errors, run("build", OBJECTS=objects, OUT=later).errors]


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
    objects = str(PLACE / "objects.parquet")
    lamps, loaded = [str(PLACE / "lamps.geojson")], str(PLACE / "session_lamps.parquet")
    query = json.loads(sys.argv[3])
    cancelled = {"OUT": str(PLACE / "cancelled.parquet"), "CELLS": shown()}
    results = {
        "tools": tools(),
        "extent": default_extent(),
        "loaded": run("load", FILES=lamps, CATALOG_FILE=sys.argv[2], OUT=loaded).ended[0],
        **show_twice(),
        **show(query),
        "groups": groups(),
        "order": [layer.name() for layer in QgsProject.instance().layerTreeRoot().layerOrder()],
        "failed": stop("export", DATABASE=objects, OUT=str(PLACE / "fails.gpkg")),
        "cancelled": stop(
            "build", cancelling=True, OBJECTS=objects, STEP=1.0, RADIUS=100.0, **cancelled
        ),
    }
    results["muted"] = mute(query)
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
