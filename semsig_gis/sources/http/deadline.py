"""A deadline for a whole request; the timeout of a socket starts again with every byte."""

from __future__ import annotations

import http.client
import io
import time
import types
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from requests.adapters import HTTPAdapter

if TYPE_CHECKING:
    import socket

    from urllib3.connectionpool import HTTPConnectionPool


class DeadlineError(Exception):
    """The time for a request is over."""


class SlowError(Exception):
    """The server sends fewer bytes per second than accepted."""


@dataclass(frozen=True, slots=True)
class Deadline:
    """End of a request that starts now, with its redirects, headers, body and retries.

    No byte within `read_timeout` seconds raises TimeoutError, fewer than `min_bytes_per_s` over
    that time SlowError, and the end of `seconds` DeadlineError.
    """

    seconds: float
    read_timeout: float
    min_bytes_per_s: float
    start: float = field(default_factory=time.monotonic)

    @property
    def seconds_left(self) -> float:
        """Seconds until the end, below 0 after it."""
        return self.start + self.seconds - time.monotonic()


class _Stream(io.RawIOBase):
    """Bytes that a socket receives until a deadline."""

    def __init__(self, sock: socket.socket, deadline: Deadline) -> None:
        self._sock = sock
        self._raw: Any = sock.makefile("rb", buffering=0)
        self._deadline = deadline
        # Start of the interval over which the speed is measured, and the bytes received in it.
        self._interval_start, self._interval_bytes = 0.0, 0

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int | None:  # noqa: ANN401 - typeshed's WriteableBuffer
        remaining = self._deadline.seconds_left
        if remaining <= 0:
            raise DeadlineError
        self._sock.settimeout(min(remaining, self._deadline.read_timeout))
        try:
            size: int | None = self._raw.readinto(buffer)
        except TimeoutError as error:
            if self._deadline.seconds_left <= 0:
                raise DeadlineError from error
            raise
        now = time.monotonic()
        if not self._interval_bytes:  # the time before the first byte does not count
            self._interval_start = now
        self._interval_bytes += size or 0
        elapsed = now - self._interval_start
        if size and elapsed >= self._deadline.read_timeout:
            if self._interval_bytes < self._deadline.min_bytes_per_s * elapsed:
                raise SlowError
            self._interval_start, self._interval_bytes = now, 0
        return size

    def close(self) -> None:
        self._raw.close()
        super().close()


class DeadlineAdapter(HTTPAdapter):
    """Transport adapter of a session; its requests end at a deadline."""

    def __init__(self, deadline: Deadline) -> None:
        super().__init__()
        self._deadline = deadline

    def get_connection_with_tls_context(self, *args: Any, **kwargs: Any) -> HTTPConnectionPool:  # noqa: ANN401
        """Return connections that read their responses until the deadline."""
        pool: HTTPConnectionPool = super().get_connection_with_tls_context(*args, **kwargs)

        def response(sock: socket.socket, *args: Any, **kwargs: Any) -> http.client.HTTPResponse:  # noqa: ANN401
            # The only method of a socket that a response uses.
            stream = types.SimpleNamespace(
                makefile=lambda _: io.BufferedReader(_Stream(sock, self._deadline))
            )
            return http.client.HTTPResponse(stream, *args, **kwargs)  # type: ignore[arg-type]

        # urllib3 has no option for it, so the pool gets a subclass of its connection class.
        connection = {"response_class": staticmethod(response)}
        pool.ConnectionCls = type("DeadlineConnection", (pool.ConnectionCls,), connection)
        return pool
