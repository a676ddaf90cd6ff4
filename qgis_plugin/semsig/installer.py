"""The dialog that installs the engine, and the task that does it."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from qgis.core import QgsApplication, QgsTask
from qgis.gui import QgsFileWidget
from qgis.PyQt.QtCore import pyqtSignal
from qgis.PyQt.QtWidgets import (
    QDialog,
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QPlainTextEdit,
    QProgressBar,
    QPushButton,
    QVBoxLayout,
)

from . import settings
from .command import Cancelled, CommandError, Watcher
from .translation import tr

if TYPE_CHECKING:
    from qgis.PyQt.QtWidgets import QWidget

    from .engine import Engine, Wishes

__all__ = ["EngineDialog", "Installation"]


class Installation(QgsTask):
    """Installs the engine in the background; it can be cancelled."""

    logged = pyqtSignal(str)
    """A line for the log."""
    progressed = pyqtSignal(int, str)
    """The finished percentage and the name of the step."""
    ended = pyqtSignal(bool, str)
    """Whether it succeeded, and a message."""

    def __init__(self, engine: Engine, wishes: Wishes) -> None:
        super().__init__(tr("Installing the engine of Semantic signatures"))
        self.engine, self.wishes = engine, wishes
        self.message = ""

    def run(self) -> bool:
        """Install the engine; QGIS calls this in a separate thread."""
        watcher = Watcher(self._progress, self.logged.emit, self.isCanceled)
        try:
            program = self.engine.install(self.wishes, os.environ, watcher)
        except Cancelled:
            self.message = tr("Cancelled; the previous state was not changed.")
            return False
        except CommandError as error:
            self.message = str(error)
            return False
        self.message = tr("The engine is installed: {}").format(program)
        return True

    def _progress(self, percent: int, label: str) -> None:
        self.setProgress(percent)
        self.progressed.emit(percent, label)

    def finished(self, result: bool) -> None:  # noqa: FBT001 - as QGIS calls it
        """Report the end; QGIS calls this in the thread of the windows."""
        self.ended.emit(result, self.message)


class EngineDialog(QDialog):
    """Shows the state of the engine, installs it, repairs it and removes it."""

    changed = pyqtSignal()
    """The engine was installed or removed."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("SemsigEngine")
        self.setWindowTitle(tr("Engine of Semantic signatures"))
        self.resize(640, 420)
        self.task: Installation | None = None
        self.state = QLabel()
        self.state.setWordWrap(True)
        self.python = self._chooser(settings.PYTHON, tr("looked for"))
        self.wheels = self._chooser(settings.WHEELS, tr("downloaded"), folder=True)
        form = QFormLayout()
        form.addRow(tr("Python (3.11 or newer)"), self.python)
        form.addRow(tr("Folder of wheels"), self.wheels)
        self.bar, self.stage = QProgressBar(), QLabel()
        self.log = QPlainTextEdit()
        self.log.setReadOnly(True)
        self.install = QPushButton()
        self.install.clicked.connect(self.start)
        self.remove = QPushButton(tr("Remove"))
        self.remove.clicked.connect(self.remove_engine)
        self.stop = QPushButton(tr("Cancel"))
        self.stop.clicked.connect(self.cancel)
        close = QPushButton(tr("Close"))
        close.clicked.connect(self.hide)
        buttons = QHBoxLayout()
        for button in (self.install, self.stop, self.remove):
            buttons.addWidget(button)
        buttons.addStretch()
        buttons.addWidget(close)
        layout = QVBoxLayout(self)
        layout.addWidget(self.state)
        layout.addLayout(form)
        layout.addWidget(self.stage)
        layout.addWidget(self.bar)
        layout.addWidget(self.log)
        layout.addLayout(buttons)
        self.show_state()

    def _chooser(self, name: str, empty: str, *, folder: bool = False) -> QgsFileWidget:
        """Return a widget for a path in the settings; `empty` is shown if it is not set."""
        widget = QgsFileWidget()
        mode = QgsFileWidget.StorageMode
        widget.setStorageMode(mode.GetDirectory if folder else mode.GetFile)
        widget.lineEdit().setPlaceholderText(empty)
        widget.setFilePath(settings.value(name))
        widget.fileChanged.connect(lambda path: settings.set_value(name, path))
        return widget

    def show_state(self, message: str = "") -> None:
        """Show the state of the engine, and enable the buttons.

        Parameters
        ----------
        message : str, optional
            A message below the state.
        """
        engine, running = settings.engine(), self.task is not None
        if not engine.command:
            text = tr(
                "The tools need an engine: the program semsig in a Python environment of its own, "
                "in the folder of your QGIS profile. It takes about 1 GB; nothing else on this "
                "computer is changed."
            )
        elif engine.current:
            text = tr("The engine is ready: {}").format(engine.command)
        else:
            text = tr("The engine is of another version than the plugin; install it again.")
        self.state.setText(text)
        self.stage.setText(message)
        self.install.setText(tr("Install again") if engine.command else tr("Install"))
        for widget in (self.install, self.python, self.wheels):
            widget.setEnabled(not running)
        self.remove.setEnabled(not running and bool(engine.command))
        self.stop.setEnabled(running)
        self.bar.setVisible(running)

    def start(self) -> None:
        """Install the engine, or install it again."""
        self.log.clear()
        self.task = Installation(settings.engine(), settings.wishes())
        self.task.logged.connect(self.log.appendPlainText)
        self.task.progressed.connect(self._progress)
        self.task.ended.connect(self._end)
        self.bar.setValue(0)
        self.show_state(tr("Looking for Python..."))
        QgsApplication.taskManager().addTask(self.task)

    def cancel(self) -> None:
        """Stop an installation."""
        if self.task is not None:
            self.stage.setText(tr("Stopping..."))
            self.task.cancel()

    def remove_engine(self) -> None:
        """Remove the engine."""
        settings.engine().remove()
        self.show_state(tr("The engine was removed."))
        self.changed.emit()

    def _progress(self, percent: int, label: str) -> None:
        self.bar.setValue(percent)
        self.stage.setText(f"{label[:1].upper()}{label[1:]}...")

    def _end(self, _success: bool, message: str) -> None:  # noqa: FBT001
        self.task = None
        self.show_state(message)
        self.log.appendPlainText(message)
        self.changed.emit()
