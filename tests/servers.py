"""An HTTP server on the loopback interface that simulates the services of the readers.

Each path has a script: answers that are sent in order; the last one is repeated. An answer is an
`Answer`, or a function from a `Request` to one. All requests are recorded in order::

    with Server() as server:
        server.on("/busy", Answer(status=429, headers={"Retry-After": "2"}), Answer(b"[]"))
        server.on("/trees", published(content, etag='"1"', cuts=[1000]))  # cut once, then resumable
        fetch(server.url + "/busy", ...)  # http://127.0.0.1:PORT/busy
    assert [request.path for request in server.requests] == ["/busy", "/busy"]

A path without a script is answered with 404.
"""

from __future__ import annotations

import contextlib
import gzip
import http.server
import io
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Self
from urllib.parse import parse_qsl, urlsplit

import pytest
from machine import PATIENCE_S

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence


@dataclass(frozen=True, slots=True)
class Answer:
    """An answer of the server."""

    body: bytes = b""
    status: int = 200
    type: str = "application/json"  # not sent if it is empty
    headers: Mapping[str, str] = field(default_factory=dict)  # further ones
    chunked: bool = False  # sent in chunks, without a length
    cut: int | None = None  # bytes after which the connection is closed, to simulate a failure
    drip: tuple[int, float] | None = None  # bytes to send at a time, seconds to wait after each
    slow_head: bool = False  # send the headers slowly, too


@dataclass(frozen=True, slots=True)
class Request:
    """A request to the server; the names of the headers are in lower case."""

    method: str
    path: str
    query: Mapping[str, str]
    headers: Mapping[str, str]
    body: bytes = b""

    @property
    def form(self) -> Mapping[str, str]:
        """Return the fields of a form that was posted."""
        return dict(parse_qsl(self.body.decode("utf-8")))


Script = Answer | Callable[[Request], Answer]


def zipped(body: bytes, **headers: str) -> Answer:
    """Return an answer with a body compressed by gzip; `headers` are further headers."""
    return Answer(gzip.compress(body, mtime=0), headers={"Content-Encoding": "gzip", **headers})


def published(
    body: bytes,
    *,
    etag: str = "",
    modified: str = "",
    ranges: bool = True,
    cuts: Sequence[int | None] = (),
) -> Callable[[Request], Answer]:
    """Return a script for a file, as on a good web server: with conditional and range requests.

    `etag` is quoted; `modified` is the date of the last change. `cuts` are the bytes after which
    each of the first answers with a body is cut.
    """
    remaining_cuts = list(cuts)

    def answer(request: Request) -> Answer:
        headers = {"Accept-Ranges": "bytes" if ranges else "none"}
        headers |= {"ETag": etag} if etag else {}
        headers |= {"Last-Modified": modified} if modified else {}
        same_tag = etag and request.headers.get("if-none-match") == etag
        same_date = modified and request.headers.get("if-modified-since") == modified
        if same_tag or same_date:
            return Answer(status=304, type="", headers=headers)
        part = request.headers.get("range", "") if ranges else ""
        condition = request.headers.get("if-range")
        cut = remaining_cuts.pop(0) if remaining_cuts else None
        if not part or condition not in {None, etag, modified}:
            return Answer(body, headers=headers, cut=cut)
        first, _, last = part.removeprefix("bytes=").partition("-")
        start, end = int(first), min(int(last or len(body)), len(body) - 1)
        if start >= len(body):
            return Answer(status=416, headers={"Content-Range": f"bytes */{len(body)}"})
        headers["Content-Range"] = f"bytes {start}-{end}/{len(body)}"
        return Answer(body[start : end + 1], status=206, headers=headers, cut=cut)

    return answer


class Server(contextlib.ExitStack):
    """A threaded server on a free port of 127.0.0.1, for use as a context manager."""

    def __init__(self) -> None:
        super().__init__()
        self.requests: list[Request] = []
        self.port = 0
        self._scripts: dict[str, list[Script]] = {}
        self._lock = threading.Lock()
        self._closing = threading.Event()

    @property
    def url(self) -> str:
        """Return the base address."""
        return f"http://127.0.0.1:{self.port}"

    @property
    def other_host(self) -> str:
        """Return the base address with another host name, for redirects to another host."""
        return f"http://localhost:{self.port}"

    def on(self, path: str, *answers: Script) -> None:
        """Set the answers to requests for a path, with any query."""
        with self._lock:
            self._scripts[path] = list(answers)

    def paths(self) -> list[str]:
        """Return the paths of all requests."""
        return [request.path for request in self.requests]

    def answer(self, request: Request) -> Answer:
        """Return the next answer to a request."""
        with self._lock:
            self.requests.append(request)
            script = self._scripts.get(request.path)
            if not script:
                return Answer(b'{"message": "there is no such thing"}', status=404)
            step = script[0] if len(script) == 1 else script.pop(0)
            return step(request) if callable(step) else step

    def wait(self, seconds: float) -> bool:
        """Wait until the server is closing, at most some seconds; return whether it is closing."""
        return self._closing.wait(seconds)

    def __enter__(self) -> Self:
        handler = type("Handler", (_Handler,), {"playing": self})
        web = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
        web.daemon_threads = False  # so that closing waits for pending answers
        self.port = web.server_address[1]
        patch = self.enter_context(pytest.MonkeyPatch.context())
        for name in ("NO_PROXY", "no_proxy"):
            patch.setenv(name, "127.0.0.1,localhost")
        thread = threading.Thread(target=web.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        for end in (thread.join, web.server_close, web.shutdown, self._closing.set):
            self.callback(end)
        return super().__enter__()


class _Handler(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    timeout = PATIENCE_S  # for a client that connects and sends nothing
    playing: Server

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - the base class's name
        """Log nothing: the tests check the recorded requests."""

    def do_GET(self) -> None:
        self.close_connection = True
        parts = urlsplit(self.path)
        body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
        query = dict(parse_qsl(parts.query, keep_blank_values=True))
        headers = {name.lower(): value for name, value in self.headers.items()}
        answer = self.playing.answer(Request(self.command, parts.path, query, headers, body))
        # A client may close the connection early.
        with contextlib.suppress(OSError):
            self._send(answer)

    do_POST = do_HEAD = do_GET  # noqa: N815

    def _send(self, answer: Answer) -> None:
        stream, head = self.wfile, io.BytesIO()
        self.wfile = head
        self._send_head(answer)
        self.wfile = stream
        drip = answer.drip or (2**16, 0.0)
        self._write([head.getvalue()], drip if answer.slow_head else (2**16, 0.0))
        if self.command != "HEAD":
            self._write(self._body(answer, drip[0]), drip)

    def _send_head(self, answer: Answer) -> None:
        self.send_response(answer.status)
        for name, value in answer.headers.items():
            self.send_header(name, value)
        if answer.type:
            self.send_header("Content-Type", answer.type)
        if answer.chunked:
            self.send_header("Transfer-Encoding", "chunked")
        else:
            self.send_header("Content-Length", str(len(answer.body)))
        self.send_header("Connection", "close")
        self.end_headers()

    @staticmethod
    def _body(answer: Answer, size: int) -> Iterator[bytes]:
        body = answer.body[: answer.cut]
        if not answer.chunked:
            yield body
            return
        for start in range(0, len(body), size):
            piece = body[start : start + size]
            yield b"%x\r\n%b\r\n" % (len(piece), piece)
        if answer.cut is None:
            yield b"0\r\n\r\n"

    def _write(self, pieces: Iterable[bytes], drip: tuple[int, float]) -> None:
        """Send `drip[0]` bytes at a time; OSError if the server ends meanwhile."""
        size, pause = drip
        for piece in pieces:
            for start in range(0, len(piece), size):
                self.wfile.write(piece[start : start + size])
                self.wfile.flush()
                if pause and self.playing.wait(pause):
                    raise BrokenPipeError
