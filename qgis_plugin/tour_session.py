"""The steps of the tour, run in QGIS by its option `--code`: see `tour.py`."""

from __future__ import annotations

import json
import os
import time
import traceback
from pathlib import Path
from typing import TYPE_CHECKING

from processing.core.ProcessingConfig import ProcessingConfig
from processing.gui.Postprocessing import handleAlgorithmResults
from qgis.core import (
    QgsApplication,
    QgsCoordinateReferenceSystem,
    QgsCoordinateTransform,
    QgsProcessingAlgRunnerTask,
    QgsProcessingContext,
    QgsProcessingFeedback,
    QgsProcessingOutputLayerDefinition,
    QgsProject,
    QgsRectangle,
)
from qgis.PyQt.QtCore import QCoreApplication, QPoint, Qt, QTimer
from qgis.PyQt.QtTest import QTest
from qgis.PyQt.QtWidgets import QApplication, QDockWidget
from qgis.utils import iface, plugins

if TYPE_CHECKING:
    from collections.abc import Callable

STORY = json.loads(os.environ["SEMSIG_TOUR"])
OUT, WORK = Path(STORY["out"]), Path(STORY["work"])


def wait(ready: Callable[[], object], seconds: float = 300.0) -> None:
    """Process events of QGIS until `ready` returns true."""
    end = time.monotonic() + seconds
    while not ready():
        if time.monotonic() > end:
            raise TimeoutError
        QCoreApplication.processEvents()
        time.sleep(0.02)


def rest(seconds: float = 1.0) -> None:
    """Give QGIS time to draw."""
    begin = time.monotonic()
    wait(lambda: time.monotonic() > begin + seconds)


def picture(name: str) -> None:
    """Take a picture of the screen."""
    rest()
    QApplication.primaryScreen().grabWindow(0).save(str(OUT / f"{name}.png"))


def install_plugin() -> None:
    """Install the plugin from its zip file, as the plugin manager does."""
    import pyplugin_installer

    pyplugin_installer.instance().installFromZipFile(STORY["plugin"])
    wait(lambda: "semsig" in plugins)


def install_engine() -> None:
    """Install the engine with the button of its dialog."""
    plugin = plugins["semsig"]
    plugin.show_engine()
    dialog = plugin.dialog
    picture("1_engine_missing")
    dialog.wheels.setFilePath(STORY["wheels"])
    dialog.install.click()
    wait(lambda: dialog.bar.value() > 20 or dialog.task is None)
    picture("2_engine_under_way")
    wait(lambda: dialog.task is None)
    picture("3_engine_ready")
    if not dialog.remove.isEnabled():
        raise RuntimeError(dialog.stage.text())
    dialog.hide()


def run(name: str, **parameters: object) -> dict[str, object]:
    """Run a tool in the background, as its dialog does, and load its layers."""
    context = QgsProcessingContext()
    context.setProject(QgsProject.instance())
    feedback = QgsProcessingFeedback()
    algorithm = QgsApplication.processingRegistry().createAlgorithmById(f"semsig:{name}")
    ended: list[tuple[bool, dict[str, object]]] = []
    task = QgsProcessingAlgRunnerTask(algorithm, parameters, context, feedback)
    task.executed.connect(lambda success, results: ended.append((success, results)))
    QgsApplication.taskManager().addTask(task)
    wait(lambda: ended)
    success, results = ended[0]
    if not success:
        raise RuntimeError(feedback.textLog())
    handleAlgorithmResults(algorithm, context, feedback)
    rest()
    return results


def shown(place: str) -> QgsProcessingOutputLayerDefinition:
    """Return an output that is loaded into the project."""
    return QgsProcessingOutputLayerDefinition(place, QgsProject.instance())


def fetch_and_build() -> str:
    """Download OpenStreetMap for the canvas, and build a database of it."""
    from processing.gui.AlgorithmDialog import AlgorithmDialog

    ProcessingConfig.setSettingValue("SEMSIG_OVERPASS", STORY["overpass"])
    canvas = iface.mapCanvas()
    QgsProject.instance().setCrs(QgsCoordinateReferenceSystem("EPSG:3857"))
    degrees = QgsCoordinateReferenceSystem("EPSG:4326")
    to_canvas = QgsCoordinateTransform(
        degrees, canvas.mapSettings().destinationCrs(), QgsProject.instance()
    )
    canvas.setExtent(to_canvas.transformBoundingBox(QgsRectangle(*STORY["extent"])))
    algorithm = QgsApplication.processingRegistry().createAlgorithmById("semsig:fetchcanvas")
    dialog = AlgorithmDialog(algorithm, parent=iface.mainWindow())
    dialog.show()
    picture("4_fetch_dialog")
    parameters = dialog.createProcessingParameters()
    dialog.close()
    objects, city = str(WORK / "objects.parquet"), str(WORK / "city.parquet")
    run("fetchcanvas", AREA_EXTENT=parameters["AREA_EXTENT"], OUT=objects)
    run("build", OBJECTS=objects, OUT=city, CELLS=shown(str(WORK / "cells.gpkg")))
    picture("5_cells")
    return city


def ask(city: str) -> None:
    """Click a cell, compose the view from another place, and find that place."""
    plugin = plugins["semsig"]
    plugin.show_dock()
    dock, canvas = plugin.dock, iface.mapCanvas()
    dock.database.setFilePath(city)
    dock.open.click()
    wait(dock.find.isEnabled)
    dock.cell_tool.click()
    press(0.42, 0.55)
    wait(lambda: dock.table.rowCount() > 0 and dock.bands)
    picture("6_cell_and_lookalikes")
    dock.clear_view()
    dock.view_tool.click()
    press(0.56, 0.47)
    wait(lambda: dock.dial.marks)
    picture("7_view_composed")
    marks = list(dock.dial.marks)
    dock.dial.bearing_clicked.emit(33.0)  # adds an object of the class chosen in the palette
    if len(dock.dial.marks) != len(marks) + 1:
        raise RuntimeError(dock.dial.marks)
    dock.dial.mark_clicked.emit(len(marks))  # removes it again
    dock.find.click()
    wait(lambda: dock.answered > 0)
    picture("8_places")
    dock.table.selectRow(0)
    picture("9_rank_1")
    canvas.unsetMapTool(canvas.mapTool())


def press(across: float, down: float) -> None:
    """Click the canvas at shares of its width and height."""
    canvas = iface.mapCanvas()
    spot = QPoint(int(canvas.width() * across), int(canvas.height() * down))
    QTest.mouseClick(
        canvas.viewport(), Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier, spot
    )


def localize(city: str) -> None:
    """Localize with the tool, which puts its layers into a group."""
    from processing.gui.AlgorithmDialog import AlgorithmDialog

    run("localize", DATABASE=city, TYPES="DDBDL", OUT=shown(str(WORK / "answer.gpkg")))
    picture("10_localize")
    algorithm = QgsApplication.processingRegistry().createAlgorithmById("semsig:localize")
    dialog = AlgorithmDialog(algorithm, parent=iface.mainWindow())
    dialog.resize(1100, 860)
    dialog.show()
    picture("11_localize_dialog")
    dialog.close()
    groups = [group.name() for group in QgsProject.instance().layerTreeRoot().findGroups()]
    (OUT / "groups.txt").write_text("\n".join(groups), "utf-8")


def play() -> None:
    """Run all steps, and end QGIS."""
    try:
        iface.mainWindow().resize(1440, 900)
        iface.mainWindow().move(0, 0)
        for dock in iface.mainWindow().findChildren(QDockWidget):
            dock.setVisible(dock.objectName() == "Layers")
        install_plugin()
        if STORY["command"]:
            ProcessingConfig.setSettingValue("SEMSIG_COMMAND", STORY["command"])
        else:
            install_engine()
        city = fetch_and_build()
        ask(city)
        localize(city)
        (OUT / "done.txt").write_text("all scenes were played", "utf-8")
    except BaseException:
        (OUT / "failed.txt").write_text(traceback.format_exc(), "utf-8")
        picture("failed")
    QgsProject.instance().clear()  # or QGIS asks whether to save it
    iface.actionExit().trigger()


for name in ("done.txt", "failed.txt"):
    (OUT / name).unlink(missing_ok=True)
QTimer.singleShot(2000, play)
