"""What the tour does in QGIS, whose `--code` runs this: see `tour.py`."""

from __future__ import annotations

import json
import os
import time
import traceback
from pathlib import Path
from typing import TYPE_CHECKING

from qgis.core import (
    QgsProject,
)
from qgis.PyQt.QtCore import QCoreApplication, QTimer
from qgis.PyQt.QtWidgets import QApplication
from qgis.utils import iface, plugins

if TYPE_CHECKING:
    from collections.abc import Callable

STORY = json.loads(os.environ["SEMSIG_TOUR"])
OUT, WORK = Path(STORY["out"]), Path(STORY["work"])


def wait(ready: Callable[[], object], seconds: float = 600.0) -> None:
    """Let QGIS work until something is so."""
    end = time.monotonic() + seconds
    while not ready():
        if time.monotonic() > end:
            raise TimeoutError
        QCoreApplication.processEvents()
        time.sleep(0.02)


def rest(seconds: float = 1.0) -> None:
    """Let QGIS draw."""
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
    """Press the button."""
    plugin = plugins["semsig"]
    plugin.show_engine()
    dialog = plugin.dialog
    picture("1_engine_missing")
    dialog.wheels.setFilePath(STORY["wheels"])
    dialog.install.click()
    wait(lambda: dialog.bar.value() > 20)
    picture("2_engine_under_way")
    wait(lambda: dialog.task is None)
    picture("3_engine_ready")
    dialog.hide()


def play() -> None:
    """Play all scenes, and end QGIS."""
    try:
        iface.mainWindow().showMaximized()
        install_plugin()
        install_engine()
        (OUT / "done.txt").write_text("all scenes were played", "utf-8")
    except BaseException:
        (OUT / "failed.txt").write_text(traceback.format_exc(), "utf-8")
        picture("failed")
    QgsProject.instance().setDirty(False)
    iface.actionExit().trigger()


for old in ("done.txt", "failed.txt"):
    (OUT / old).unlink(missing_ok=True)
QTimer.singleShot(2000, play)
