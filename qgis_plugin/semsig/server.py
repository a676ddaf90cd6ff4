"""Send requests to `semsig serve`, which runs as a process on this machine.

The process opens the database once, so that each click is answered quickly.
"""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

from qgis.PyQt.QtCore import QObject, QProcess, QProcessEnvironment, QUrl, pyqtSignal
from qgis.PyQt.QtNetwork import QNetworkAccessManager, QNetworkProxy, QNetworkRequest

from . import settings
from .command import CommandError
from .translation import tr

if TYPE_CHECKING:
    from collections.abc import Callable

    from qgis.PyQt.QtNetwork import QNetworkReply

__all__ = ["CityServer"]

ADDRESS = re.compile(r"(http://127\.0\.0\.1:\d+)/\?token=(\S+)")
SENTENCE = "semsig: "
PATIENCE_MS = 3000


class CityServer(QObject):
    """A process that answers requests for one database at a time."""

    opened = pyqtSignal(dict)
    """The description of the city."""
    failed = pyqtSignal(str)
    """The reason why a city cannot be opened or a request not be answered."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.network = QNetworkAccessManager(self)
        # Without the proxy of QGIS: the requests stay on this machine.
        self.network.setProxy(QNetworkProxy(QNetworkProxy.ProxyType.NoProxy))
        self.process: QProcess | None = None
        self.address, self.token = "", ""
        self.messages: list[str] = []

    def open(self, database: str) -> None:
        """Open a database; then `opened` or `failed` is emitted.

        Parameters
        ----------
        database : str
            The path of the signature database.
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
        process.readyReadStandardOutput.connect(lambda: self._read_address(process))
        process.readyReadStandardError.connect(lambda: self._read_messages(process))
        process.finished.connect(lambda *_: self._end(process))
        process.errorOccurred.connect(lambda _error: self._end(process))
        self.process, self.messages = process, []
        process.start(program, ["serve", "--no-browser", "--", database])

    def close(self) -> None:
        """Close the database; the process ends when its input is closed."""
        process, self.process, self.address = self.process, None, ""
        if process is None:
            return
        process.closeWriteChannel()
        if not process.waitForFinished(PATIENCE_MS):
            process.kill()
            process.waitForFinished(PATIENCE_MS)
        process.deleteLater()

    def _read_address(self, process: QProcess) -> None:
        output = bytes(process.readAllStandardOutput()).decode("utf-8", "replace")
        address = ADDRESS.search(output)
        if address is not None and process is self.process:
            self.address, self.token = address[1], address[2]
            self.ask("city", None, self.opened.emit)

    def _read_messages(self, process: QProcess) -> None:
        text = bytes(process.readAllStandardError()).decode("utf-8", "replace")
        self.messages += [line for line in text.splitlines() if line.startswith(SENTENCE)]

    def _end(self, process: QProcess) -> None:
        """Report that the current process ended, with its last message."""
        if process is not self.process:
            return
        self.process, self.address = None, ""
        self.failed.emit(
            self.messages[-1].removeprefix(SENTENCE) if self.messages else tr("The engine ended.")
        )

    def ask(self, what: str, question: dict[str, Any] | None, then: Callable[[Any], None]) -> None:
        """Send a request, and pass the answer on when it arrives.

        Parameters
        ----------
        what : str
            Such as ``"answer"``, see `semsig_gis.serve.server`.
        question : dict or None
            The body of the request, if it has one.
        then : callable
            Called with the answer: the values of JSON, or the content of another file. An error
            is emitted by `failed` instead.
        """
        if not self.address:
            self.failed.emit(tr("Open a database first."))
            return
        request = QNetworkRequest(QUrl(f"{self.address}/api/{what}"))
        request.setRawHeader(b"x-semsig-token", self.token.encode())
        request.setRawHeader(b"Content-Type", b"application/json")
        if question is None:
            reply = self.network.get(request)
        else:
            reply = self.network.post(request, json.dumps(question).encode())
        reply.finished.connect(lambda: self._read(reply, then))

    def _read(self, reply: QNetworkReply, then: Callable[[Any], None]) -> None:
        reply.deleteLater()
        content = bytes(reply.readAll())
        kind = str(reply.header(QNetworkRequest.KnownHeaders.ContentTypeHeader) or "")
        if content and kind and "json" not in kind:
            then(content)
            return
        try:
            answer = json.loads(content.decode())
        except ValueError:
            self.failed.emit(tr("The engine did not answer."))
            return
        if isinstance(answer, dict) and "error" in answer:
            self.failed.emit(str(answer["error"]))
        else:
            then(answer)
