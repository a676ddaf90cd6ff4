"""A city that answers at once: `semsig serve` as a process, asked over this machine's own network.

The command opens the database once, so that a click is answered in a moment.
"""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

from qgis.PyQt.QtCore import QObject, QProcess, QProcessEnvironment, QUrl, pyqtSignal
from qgis.PyQt.QtNetwork import QNetworkAccessManager, QNetworkProxy, QNetworkRequest

from . import settings
from .command import CommandError
from .words import tr

if TYPE_CHECKING:
    from collections.abc import Callable

    from qgis.PyQt.QtNetwork import QNetworkReply

__all__ = ["Bench"]

ADDRESS = re.compile(r"(http://127\.0\.0\.1:\d+)/\?token=(\S+)")
SENTENCE = "semsig: "
PATIENCE_MS = 3000


class Bench(QObject):
    """Asks a database; one at a time."""

    opened = pyqtSignal(dict)
    """What is to be known of the city."""
    failed = pyqtSignal(str)
    """Why a city cannot be opened, or a question not be answered."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.network = QNetworkAccessManager(self)
        # Whatever proxy QGIS has, this stays on the machine.
        self.network.setProxy(QNetworkProxy(QNetworkProxy.ProxyType.NoProxy))
        self.process: QProcess | None = None
        self.address, self.token = "", ""
        self.said: list[str] = []

    def open(self, database: str) -> None:
        """Open a database; `opened` or `failed` tells the end.

        Parameters
        ----------
        database : str
            The file that “Build signature database” wrote.
        """
        self.close()
        try:
            program = settings.command()
        except CommandError as error:
            self.failed.emit(str(error))
            return
        process = QProcess(self)
        variables = QProcessEnvironment()
        for name, value in settings.environment().items():
            variables.insert(name, value)
        process.setProcessEnvironment(variables)
        process.readyReadStandardOutput.connect(lambda: self._listen(process))
        process.readyReadStandardError.connect(lambda: self._note(process))
        process.finished.connect(lambda *_: self._end(process))
        process.errorOccurred.connect(lambda _error: self._end(process))
        self.process, self.said = process, []
        process.start(program, ["serve", "--no-browser", "--", database])

    def close(self) -> None:
        """Close the database; the process ends with its input."""
        process, self.process, self.address = self.process, None, ""
        if process is None:
            return
        process.closeWriteChannel()
        if not process.waitForFinished(PATIENCE_MS):
            process.kill()
            process.waitForFinished(PATIENCE_MS)
        process.deleteLater()

    def _listen(self, process: QProcess) -> None:
        told = ADDRESS.search(bytes(process.readAllStandardOutput()).decode("utf-8", "replace"))
        if told is not None and process is self.process:
            self.address, self.token = told[1], told[2]
            self.ask("city", None, self.opened.emit)

    def _note(self, process: QProcess) -> None:
        text = bytes(process.readAllStandardError()).decode("utf-8", "replace")
        self.said += [line for line in text.splitlines() if line.startswith(SENTENCE)]

    def _end(self, process: QProcess) -> None:
        if process is not self.process:
            return
        self.process, self.address = None, ""
        reason = self.said[-1].removeprefix(SENTENCE) if self.said else tr("The engine ended.")
        self.failed.emit(reason)

    def ask(
        self, what: str, told: dict[str, Any] | None, then: Callable[[dict[str, Any]], None]
    ) -> None:
        """Ask, and hand the answer on when it is there.

        Parameters
        ----------
        what : str
            Such as ``"answer"``, see `semsig_gis.serve.server`.
        told : dict or None
            The question; None to ask without one.
        then : callable
            Takes the answer. A refusal goes to `failed` instead.
        """
        if not self.address:
            self.failed.emit(tr("Open a database first."))
            return
        request = QNetworkRequest(QUrl(f"{self.address}/api/{what}"))
        request.setRawHeader(b"x-semsig-token", self.token.encode())
        request.setRawHeader(b"Content-Type", b"application/json")
        if told is None:
            reply = self.network.get(request)
        else:
            reply = self.network.post(request, json.dumps(told).encode())
        reply.finished.connect(lambda: self._read(reply, then))

    def _read(self, reply: QNetworkReply, then: Callable[[dict[str, Any]], None]) -> None:
        reply.deleteLater()
        try:
            answer = json.loads(bytes(reply.readAll()).decode())
        except ValueError:
            self.failed.emit(tr("The engine did not answer."))
            return
        if isinstance(answer, dict) and "error" in answer:
            self.failed.emit(str(answer["error"]))
        else:
            then(answer)
