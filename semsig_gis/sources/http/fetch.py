"""HTTP requests with retries, resumed downloads, size and time limits, and a cache.

The only module that uses the network, but for Overture Maps. Requests go only to hosts that the
caller names.
"""

from __future__ import annotations

import contextlib
import email.utils
import functools
import gzip
import hashlib
import itertools
import math
import threading
import time
import zlib
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING
from urllib.parse import urljoin, urlsplit

import requests
import urllib3.exceptions

from semsig_gis import __version__
from semsig_gis.core import InputError, SourceError
from semsig_gis.sources.compression import decompression_bomb_error, ratio_too_high
from semsig_gis.sources.http.cache import FileVersion, cache_key
from semsig_gis.sources.http.errors import error_text

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from semsig_gis.sources.http.access_token import AccessToken
    from semsig_gis.sources.http.cache import Cache, CacheEntry, Fetched

USER_AGENT = f"semsig_gis/{__version__} (reads open data once, into a cache)"
MAX_REDIRECTS = 5
RETRY_STATUSES = frozenset({408, 429, 500, 502, 503, 504})
REDIRECTS = frozenset({301, 302, 303, 307, 308})
BLOCK_BYTES = 2**16
ANYTHING = "*/*;q=0.1"
NOT_MODIFIED, PARTIAL, RANGE_NOT_SATISFIABLE = 304, 206, 416

Progress = Callable[[int, int], None]
Pairs = tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class HttpSpec:
    """Settings of requests: times in seconds, sizes in bytes.

    A request ends after `deadline_s`, with all redirects, attempts and pauses, or with the first
    bytes that arrive after it. `timeout` is for the connection and for the next bytes; fewer than
    `min_bytes_per_s` over the latter count as stalled and are tried `slow_attempts` times. The
    pause after a failure, `backoff_s`, doubles each time; a server that asks for more than
    `longest_wait_s` is an error. `max_bytes` limits a file as sent and as unpacked. A cached file
    that the server cannot confirm is used for `fresh_s`. `report` takes a line about each pause. A
    server may redirect to `hosts` in addition to itself. `token` authorizes every request; it is
    hidden in messages.
    """

    deadline_s: float = 600.0
    timeout: tuple[float, float] = (10.0, 60.0)
    min_bytes_per_s: float = 100.0
    attempts: int = 5
    slow_attempts: int = 2
    backoff_s: float = 2.0
    longest_wait_s: float = 180.0
    max_bytes: int = 2**31
    fresh_s: float = 86_400.0
    offline: bool = False
    sleep: Callable[[float], None] = time.sleep
    report: Callable[[str], None] = lambda _: None
    hosts: frozenset[str] = frozenset()
    token: AccessToken | None = None

    def __post_init__(self) -> None:
        """Raise InputError for fewer attempts than 1 or a deadline that is not in the future."""
        if self.attempts < 1:
            raise InputError(f"attempts is {self.attempts}; it takes at least 1.")
        if not 0 < self.deadline_s < math.inf:
            raise InputError(f"deadline_s is {self.deadline_s}; give seconds above 0.")


DEFAULT_HTTP: HttpSpec = HttpSpec()


class HttpError(SourceError):
    """A request failed; `status` is the HTTP status of the answer, 0 without an answer."""

    def __init__(self, message: str, status: int = 0) -> None:
        super().__init__(message)
        self.status = status


class TransientError(Exception):
    """A failure that a retry may solve, after `wait` seconds if the server sent Retry-After.

    `slow` marks a failure that took long, so that it is retried less often.
    """

    def __init__(
        self, what: str, status: int = 0, wait: float | None = None, *, slow: bool = False
    ) -> None:
        super().__init__(what)
        self.status = status
        self.wait = wait
        self.slow = slow


class _Session(requests.Session):
    """A session with our User-Agent that accepts only gzip, until the deadline of a request."""

    def __init__(self, spec: HttpSpec) -> None:
        super().__init__()
        self.headers.update({"User-Agent": USER_AGENT, "Accept-Encoding": "gzip"})
        self.auth = lambda prepared: prepared  # no password from the user's .netrc
        self.spec = spec
        self.end = time.monotonic() + spec.deadline_s

    @property
    def seconds_left(self) -> float:
        """Seconds until the deadline, 0 after it."""
        return max(0.0, self.end - time.monotonic())

    @contextlib.contextmanager
    def response(
        self,
        url: str,
        headers: Mapping[str, str] | None = None,
        params: Pairs | None = None,
        data: Pairs = (),
    ) -> Iterator[requests.Response]:
        """Send a request, follow redirects within the host, and provide the response unread."""
        address = url
        connect, read = self.spec.timeout
        for _ in range(MAX_REDIRECTS + 1):
            left = self.seconds_left + 0.01  # a timeout of 0 is not accepted
            send = functools.partial(
                self.request,
                "POST" if data else "GET",
                address,
                params=params,
                data=data or None,
                headers=headers,
                timeout=(min(connect, left), min(read, left)),
                stream=True,
                allow_redirects=False,
            )
            try:
                response = _call_within(self.seconds_left, send)
            except (TimeoutError, requests.RequestException, urllib3.exceptions.HTTPError) as error:
                raise _connection_error(error, url) from error
            with response:
                if response.status_code not in REDIRECTS:
                    yield response
                    return
                target = urljoin(response.url, response.headers.get("Location", ""))
                _check_redirect(response.url, target, self.spec)
                address, params = target, None
        raise HttpError(f"{host_of(url)} redirects too often from {url}; check the address.")

    def blocks(self, response: requests.Response) -> Iterator[bytes]:
        """Yield the body as it is sent; TransientError if the server hangs up, stops or is slow."""
        start, size = time.monotonic(), 0
        try:
            while block := response.raw.read1(BLOCK_BYTES, decode_content=False):
                yield block
                if not self.seconds_left:
                    raise TransientError("did not finish in time")
                size += len(block)
                elapsed = time.monotonic() - start
                if elapsed >= self.spec.timeout[1]:
                    if size < self.spec.min_bytes_per_s * elapsed:
                        raise TransientError("sent too slowly", slow=True)
                    start, size = time.monotonic(), 0
        except urllib3.exceptions.ReadTimeoutError as error:
            raise TransientError("stopped sending", slow=True) from error
        except (urllib3.exceptions.HTTPError, OSError) as error:
            raise TransientError("cut the connection") from error

    def start_of_body(self, response: requests.Response) -> bytes:
        """Return up to `BLOCK_BYTES` of a body, decompressed."""
        body = bytearray()
        for block in self.blocks(response):
            body += block
            if len(body) > BLOCK_BYTES:
                break
        if response.headers.get("Content-Encoding", "") == "gzip":
            with contextlib.suppress(zlib.error):
                return zlib.decompressobj(wbits=31).decompress(body, BLOCK_BYTES)
        return bytes(body[:BLOCK_BYTES])

    def check_status(self, response: requests.Response) -> None:
        """Raise HttpError if a response is not a file or a part of it; TransientError to retry."""
        status = response.status_code
        if status in {requests.codes.ok, requests.codes.partial}:
            return
        what = f"answered {status} {response.reason or ''}".rstrip()
        if status in RETRY_STATUSES:
            retry_after = response.headers.get("Retry-After", "").strip()
            wait = float(retry_after) if retry_after.isdecimal() else None
            if wait is None:
                with contextlib.suppress(ValueError):  # a date, or no time at all
                    date = email.utils.parsedate_to_datetime(retry_after).astimezone(UTC)
                    wait = max(0.0, (date - datetime.now(UTC)).total_seconds())
            raise TransientError(what, status, wait)
        # The error message of the service, if the body contains one.
        text = ""
        with contextlib.suppress(TransientError):
            text = error_text(self.start_of_body(response))
        detail = f" ({text})" if text else ""
        address = response.url.partition("?")[0]
        msg = f"{host_of(response.url)} {what} to {address}{detail}; correct it."
        raise HttpError(msg, status)


def _call_within(seconds: float, send: Callable[[], requests.Response]) -> requests.Response:
    """Send a request in a thread; TimeoutError if the headers of its response take too long.

    The timeout of a socket starts again with every byte of the headers.
    """
    result: Future[requests.Response] = Future()

    def run() -> None:
        try:
            result.set_result(send())
        except Exception as error:  # noqa: BLE001 - raised in the other thread
            result.set_exception(error)

    threading.Thread(target=run, daemon=True).start()
    try:
        return result.result(timeout=seconds)
    except TimeoutError:
        result.add_done_callback(_close)
        raise


def _close(late: Future[requests.Response]) -> None:
    if late.exception() is None:
        late.result().close()


def _check_redirect(source: str, target: str, spec: HttpSpec) -> None:
    """Raise SourceError for a redirect to another host, except to `spec.hosts` without a token."""
    old, new = urlsplit(source), urlsplit(target)
    try:
        same = (old.scheme, old.hostname, old.port) == (new.scheme, new.hostname, new.port)
        # http to https of the same host, both on their usual ports
        safer = (old.scheme, new.scheme) == ("http", "https") and old.hostname == new.hostname
        safer = safer and old.port in {None, 80} and new.port in {None, 443}
    except ValueError:  # a port that is no number
        same = safer = False
    listed = new.hostname in spec.hosts and new.scheme in {old.scheme, "https"}
    if not (same or safer or (listed and spec.token is None)):
        raise SourceError(
            f"{old.netloc} redirects to {new.netloc or target}, which neither you nor the "
            f"catalogue named; if you trust it, put its address in the catalogue."
        )


def _connection_error(error: Exception, url: str) -> Exception:
    """Return the error for a failed connection: HttpError, or TransientError to retry."""
    if isinstance(error, requests.exceptions.SSLError):
        msg = f"{host_of(url)} has no certificate that this machine trusts; check the address."
        return HttpError(msg)
    if isinstance(error, TimeoutError | requests.exceptions.Timeout):
        return TransientError("did not answer in time", slow=True)
    if isinstance(error, requests.exceptions.ConnectionError):
        return TransientError("could not be reached or hung up")
    msg = f"{url} cannot be requested ({' '.join(str(error).split()).rstrip('.')}); correct it."
    return HttpError(msg)


def check_url(url: str) -> None:
    """Raise InputError for an address that is not HTTP, or has a password: it would be cached."""
    try:
        parts = urlsplit(url)
        usable = parts.scheme in {"http", "https"} and parts.hostname and parts.password is None
    except ValueError:  # an unclosed bracket
        usable = False
    if not usable:
        raise InputError(
            f"{url!r} is not an address; write one that begins with https://, without a password."
        )


def host_of(url: str) -> str:
    """Return the host of an address, with its port if there is one."""
    return urlsplit(url).netloc


class TooLargeError(SourceError):
    """A server sends more bytes than accepted."""


class NotCachedError(SourceError):
    """A file is not in the cache, and the network is off."""


def fetch(
    url: str,
    *,
    params: Mapping[str, str | float] | None = None,
    data: Mapping[str, str | float] | None = None,
    cache: Cache,
    spec: HttpSpec = DEFAULT_HTTP,
    accept: tuple[str, ...] = (),
    suffix: str = ".json",
    identity: str = "",
    check: Callable[[Path], object] | None = None,
    before: Callable[[], None] | None = None,
    progress: Progress | None = None,
) -> Fetched:
    """Fetch a file into the cache, or find it there; with `data`, post a form.

    `accept` lists the accepted content types, by default all. `identity` replaces the address in
    the key of the cache, for services that mirror each other. `check` raises SourceError for a file
    that must not be cached. `before` is called before each attempt. `progress` takes the bytes
    received and their total, 0 if it is unknown. A cached file with an ETag or a date is confirmed
    by a conditional request; another one is used for ``spec.fresh_s``. A download that was cut is
    resumed (RFC 9110, If-Range), also in a later run, if the server supports it.

    Raises HttpError, TooLargeError, NotCachedError or another SourceError.
    """
    check_url(url)
    query, form = (
        tuple(sorted((name, str(value)) for name, value in (pairs or {}).items()))
        for pairs in (params, data)
    )
    key = cache_key(["POST" if form else "GET", identity or url, query, form])
    if spec.offline:
        return cached_file(cache, key, what=url)
    with cache.locked(key) as entry:
        cached = entry.cached_file()
        if cached is not None and not cached.condition:
            age = datetime.now(UTC) - datetime.fromisoformat(cached.fetched_at)
            if age.total_seconds() < spec.fresh_s:
                return cached
        download = _Download(url, query, form, entry, cached, spec, accept, suffix, check, progress)
        try:
            return download.run(before)
        except SourceError as error:
            if isinstance(error, TooLargeError):
                entry.drop_part()
            if spec.token is None:
                raise
            error.args = (spec.token.redact(str(error)),)
            raise error from None
        except OSError as error:
            raise InputError(
                f"cache folder {cache.folder} cannot be written ({error.strerror or error}); "
                "make room or choose another folder."
            ) from error


def cached_file(cache: Cache, key: str, *, what: str) -> Fetched:
    """Return a file from the cache without the network; NotCachedError if it is not there."""
    entry = cache.entry(key)
    cached = entry.cached_file()
    if cached is None:
        state = "is damaged in" if entry.sidecar.exists() else "is not in"
        raise NotCachedError(
            f"{what} {state} the cache {cache.folder}; run once without --offline to fetch it."
        )
    return cached


def read_text(url: str, *, spec: HttpSpec = DEFAULT_HTTP) -> str:
    """Request a short text once, without the cache, and return up to 64 KiB of it."""
    check_url(url)
    try:
        with _Session(spec) as session, session.response(url) as response:
            session.check_status(response)
            return session.start_of_body(response).decode("utf-8", errors="replace")
    except TransientError as error:
        raise HttpError(f"{host_of(url)} {error}; try again later.", error.status) from error


# --- One file, several attempts -----------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Download:
    """A request that is repeated until its file is in the cache."""

    url: str
    params: Pairs
    data: Pairs
    entry: CacheEntry
    cached: Fetched | None
    spec: HttpSpec
    accept: tuple[str, ...]
    suffix: str
    check: Callable[[Path], object] | None
    progress: Progress | None

    @property
    def host(self) -> str:
        """The host of the request, for messages."""
        return host_of(self.url)

    def run(self, before: Callable[[], None] | None) -> Fetched:
        """Try until the file is complete, the attempts are used up or the time is over."""
        spec = self.spec
        with _Session(spec) as session:
            for attempt in itertools.count(1):
                if before is not None:
                    before()
                try:
                    return self.attempt(session)
                except TransientError as error:
                    failure = error
                if failure.wait is not None and failure.wait > spec.longest_wait_s:
                    remedy = f" and asks to wait {failure.wait:.0f} s; try again after that"
                    break
                pause = (
                    spec.backoff_s * 2 ** (attempt - 1) if failure.wait is None else failure.wait
                )
                if pause >= session.seconds_left:
                    resumed = self.entry.resumable()[0] > 0
                    action = "run it again to go on from there" if resumed else "ask for less"
                    remedy = (
                        f", and {spec.deadline_s:g} s are over; {action}, or allow more time with "
                        "--timeout"
                    )
                    break
                most = min(spec.attempts, spec.slow_attempts) if failure.slow else spec.attempts
                if attempt >= most:
                    remedy = f", {attempt} times; try again later"
                    break
                line = f"{self.host} {failure}; attempt {attempt + 1} of {most} in {pause:.0f} s"
                spec.report(line if spec.token is None else spec.token.redact(line))
                spec.sleep(pause)
        if self.cached is not None:
            remedy += f", or work offline with the copy of {self.cached.fetched_at} in the cache"
        raise HttpError(f"{self.host} {failure}{remedy}.", failure.status) from failure

    def attempt(self, session: _Session) -> Fetched:
        """Request the file once, or the rest of it; return it from the cache."""
        entry, spec = self.entry, self.spec
        offset, part_version, headers = self.range_and_headers()
        with session.response(self.url, headers, self.params, self.data) as response:
            if response.status_code == NOT_MODIFIED and self.cached is not None:
                entry.drop_part()
                return self.cached
            # Whether the response continues the part, in the same version.
            partial = response.headers.get("Content-Range", "").startswith(f"bytes {offset}-")
            partial = partial and response.status_code == PARTIAL
            tag = response.headers.get("ETag", part_version.etag)
            if not (offset and partial and tag == part_version.etag):
                offset = 0
                if response.status_code in {PARTIAL, RANGE_NOT_SATISFIABLE}:
                    entry.drop_part()
                    raise TransientError(
                        "sent another part of the file than the one asked for", wait=0.0
                    )
            session.check_status(response)
            version = part_version if offset else FileVersion.from_headers(response.headers)
            if self.accept and version.content_type and version.content_type not in self.accept:
                raise SourceError(
                    f"{self.host} sent {version.content_type} where "
                    f"{' or '.join(self.accept)} was expected; check the address {self.url}."
                )
            if version.encoding not in {"", "gzip", "x-gzip"}:
                raise SourceError(
                    f"{self.host} sent the unsupported Content-Encoding {version.encoding}; "
                    "report it to the service."
                )
            if not offset:
                entry.start_part(version)
            self.receive(session, response, offset)
            url = response.url if spec.token is None else spec.token.redact(response.url)
        body = entry.temporary_path(self.suffix)
        try:
            sha256 = self.unpack(body, version.encoding)
            if self.check is not None:
                self.check(body)
            what = {"url": self.url, "params": self.params, "data": self.data}
            return entry.store(body, sha256=sha256, url=url, request=what, version=version)
        finally:
            body.unlink(missing_ok=True)
            entry.drop_part()  # the part was complete, so resuming it cannot correct an error

    def range_and_headers(self) -> tuple[int, FileVersion, dict[str, str]]:
        """Return the size and version of the part to resume, and the headers to send."""
        is_get = not self.data
        offset, version = self.entry.resumable() if is_get else (0, FileVersion())
        headers = self.cached.condition if self.cached and is_get else {}
        if self.accept:
            headers |= {"Accept": ", ".join((*self.accept, ANYTHING))}
        if self.spec.token is not None:
            headers |= self.spec.token.headers
        if offset:
            headers |= {"Range": f"bytes={offset}-", "If-Range": version.if_range}
        return offset, version, headers

    def receive(self, session: _Session, response: requests.Response, offset: int) -> None:
        """Append the body of a response to the part, within the size limit."""
        length = response.headers.get("Content-Length", "")
        size = offset
        total = offset + int(length) if length.isdecimal() else 0
        self.check_size(total)
        with self.entry.part.open("ab") as stream:
            for block in session.blocks(response):
                size += len(block)
                self.check_size(size)
                stream.write(block)
                if self.progress is not None:
                    self.progress(size, total)

    def unpack(self, body: Path, encoding: str) -> str:
        """Decompress the part into a body; return its checksum."""
        digest, size, part = hashlib.sha256(), 0, self.entry.part
        packed_size = part.stat().st_size
        try:
            with (
                gzip.open(part) if encoding else part.open("rb") as packed,
                body.open("wb") as stream,
            ):
                while block := packed.read(BLOCK_BYTES):
                    size += len(block)
                    self.check_size(size)
                    if ratio_too_high(packed_size, size):
                        raise decompression_bomb_error(
                            f"what {self.host} sends", "report it to the publisher"
                        )
                    digest.update(block)
                    stream.write(block)
        except (EOFError, gzip.BadGzipFile, zlib.error) as error:
            raise TransientError("sent a damaged gzip body") from error
        return digest.hexdigest()

    def check_size(self, size: int) -> None:
        """Raise TooLargeError for more bytes than accepted."""
        if size > self.spec.max_bytes:
            raise TooLargeError(
                f"{self.host} sends more than the {self.spec.max_bytes:,} bytes that are "
                "accepted; ask for a smaller area or for fewer layers."
            )
