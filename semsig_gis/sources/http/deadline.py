"""A deadline for a whole request; a socket's own timeout begins anew with every byte."""

from __future__ import annotations

import functools
import http.client
import io
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from requests.adapters import HTTPAdapter

if TYPE_CHECKING:
    import socket

    from urllib3.connectionpool import HTTPConnectionPool


class OverdueError(Exception):
    """The time for a request is over."""


class SlowError(Exception):
    """A server sends, but next to nothing."""


@dataclass(frozen=True, slots=True)
class Deadline:
    """How long a request may take, from now: its redirects, headers, body and further attempts.

    No bytes at all for `patience` seconds raise TimeoutError, fewer than `slowest` a second over so
    long SlowError, and the end of the `seconds` OverdueError.
    """

    seconds: float
    patience: float
    slowest: float
    begin: float = field(default_factory=time.monotonic)

    @property
    def seconds_left(self) -> float:
        """Seconds until the end, below 0 after it."""
        return self.begin + self.seconds - time.monotonic()


class _Stream(io.RawIOBase):
    """What comes in by a socket until a deadline."""

    def __init__(self, sock: socket.socket, deadline: Deadline) -> None:
        self._sock = sock
        self._raw: Any = sock.makefile("rb", buffering=0)
        self._deadline = deadline
        self._since, self._got = 0.0, 0

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int | None:  # noqa: ANN401 - typeshed's WriteableBuffer
        left = self._deadline.seconds_left
        if left <= 0:
            raise OverdueError
        self._sock.settimeout(min(left, self._deadline.patience))
        try:
            size: int | None = self._raw.readinto(buffer)
        except TimeoutError as error:
            if self._deadline.seconds_left <= 0:
                raise OverdueError from error
            raise
        self._require_pace(size or 0)
        return size

    def _require_pace(self, size: int) -> None:
        now = time.monotonic()
        if not self._got:  # a server may think before it says the first byte
            self._since = now
        self._got += size
        elapsed = now - self._since
        if size and elapsed >= self._deadline.patience:
            if self._got < self._deadline.slowest * elapsed:
                raise SlowError
            self._since, self._got = now, 0

    def close(self) -> None:
        self._raw.close()
        super().close()


class _Socket:
    """As much of a socket as an HTTP response asks for."""

    def __init__(self, sock: socket.socket, deadline: Deadline) -> None:
        self._stream = functools.partial(_Stream, sock, deadline)

    def makefile(self, _: str) -> io.BufferedReader:
        return io.BufferedReader(self._stream())


class PunctualAdapter(HTTPAdapter):
    """Transport of a session whose requests end by a deadline."""

    def __init__(self, deadline: Deadline) -> None:
        super().__init__()
        self._deadline = deadline

    def get_connection_with_tls_context(self, *args: Any, **kwargs: Any) -> HTTPConnectionPool:  # noqa: ANN401
        """Return connections that read their responses until the deadline."""
        pool: HTTPConnectionPool = super().get_connection_with_tls_context(*args, **kwargs)

        def response(sock: socket.socket, *args: Any, **kwargs: Any) -> http.client.HTTPResponse:  # noqa: ANN401
            return http.client.HTTPResponse(_Socket(sock, self._deadline), *args, **kwargs)  # type: ignore[arg-type]

        connection = {"response_class": staticmethod(response)}
        pool.ConnectionCls = type("PunctualConnection", (pool.ConnectionCls,), connection)
        return pool
