"""HTTP requests with retries, resumed downloads, size and time limits, and a cache.

The only module that uses the network, but for Overture Maps. Requests go only to hosts that the
caller names.
"""

from __future__ import annotations

import contextlib
import dataclasses
import email.utils
import hashlib
import itertools
import math
import time
import zlib
from collections.abc import Callable
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
from semsig_gis.sources.http.deadline import (
    Deadline,
    DeadlineAdapter,
    DeadlineError,
    SlowError,
)
from semsig_gis.sources.http.errors import error_text

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from semsig_gis.sources.http.access_token import AccessToken
    from semsig_gis.sources.http.cache import Cache, CacheEntry, Fetched

USER_AGENT = f"semsig_gis/{__version__} (reads open data once, into a cache)"
MAX_REDIRECTS = 5
TOO_SLOW = "sent too slowly"
RETRY_STATUSES = frozenset({408, 429, 500, 502, 503, 504})
REDIRECTS = frozenset({301, 302, 303, 307, 308})
BLOCK_BYTES = 2**16
ANYTHING = "*/*;q=0.1"


@dataclass(frozen=True, slots=True, kw_only=True)
class HttpSpec:
    """Settings of requests: times in seconds, sizes in bytes.

    A request ends after `deadline_s`, with all redirects, attempts and pauses. `timeout` is for the
    connection and for the next bytes; fewer than `min_bytes_per_s` over the latter count as stalled
    and are tried `slow_attempts` times. The pause after a failure, `backoff_s`, doubles each time;
    a server that asks for more than `longest_wait_s` is an error. `max_bytes` limits a file as sent
    and as unpacked. A cached file that the server cannot confirm is used for `fresh_s`. `report`
    takes a line about each pause. A server may redirect to `hosts` in addition to itself. `token`
    authorizes every request; it is never logged or cached.
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

    def deadline(self) -> Deadline:
        """Return the deadline of a request that starts now."""
        return Deadline(self.deadline_s, self.timeout[1], self.min_bytes_per_s)


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


@dataclass(frozen=True, slots=True)
class Request:
    """An address with its query, requested by GET, or by POST if there is a form in `data`."""

    url: str
    params: tuple[tuple[str, str], ...] = ()
    data: tuple[tuple[str, str], ...] = ()

    @property
    def method(self) -> str:
        """The HTTP method."""
        return "POST" if self.data else "GET"


@contextlib.contextmanager
def open_session(deadline: Deadline) -> Iterator[requests.Session]:
    """Open a session with our User-Agent that accepts only gzip and ends at a deadline."""
    with requests.Session() as session:
        for scheme in ("http://", "https://"):
            session.mount(scheme, DeadlineAdapter(deadline))
        session.headers.update({"User-Agent": USER_AGENT, "Accept-Encoding": "gzip"})
        session.auth = lambda prepared: prepared  # no password from the user's .netrc
        yield session


@contextlib.contextmanager
def open_response(
    session: requests.Session, request: Request, headers: Mapping[str, str], spec: HttpSpec
) -> Iterator[requests.Response]:
    """Send a request, follow redirects within the host, and provide the response, body unread."""
    url = request.url
    params: tuple[tuple[str, str], ...] | None = request.params
    for _ in range(MAX_REDIRECTS + 1):
        try:
            response = session.request(
                request.method,
                url,
                params=params,
                data=request.data or None,
                headers=headers,
                timeout=spec.timeout,
                stream=True,
                allow_redirects=False,
            )
        except (requests.RequestException, urllib3.exceptions.HTTPError, SlowError) as error:
            raise _connection_error(error, request.url) from error
        with response:
            if response.status_code not in REDIRECTS:
                yield response
                return
            target = urljoin(response.url, response.headers.get("Location", ""))
            _check_redirect(response.url, target, spec)
            url, params = target, None
    raise HttpError(
        f"{host_of(request.url)} redirects too often from {request.url}; check the address."
    )


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
    if isinstance(error, SlowError):
        return TransientError(TOO_SLOW, slow=True)
    if isinstance(error, requests.exceptions.ConnectTimeout | requests.exceptions.ReadTimeout):
        return TransientError("did not answer in time", slow=True)
    if isinstance(error, requests.exceptions.ConnectionError):
        return TransientError("could not be reached or hung up")
    msg = f"{url} cannot be requested ({' '.join(str(error).split()).rstrip('.')}); correct it."
    return HttpError(msg)


def check_status(response: requests.Response) -> None:
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
    body, text = bytearray(), ""
    with contextlib.suppress(TransientError):
        _read_start(response, body)
    with contextlib.suppress(zlib.error):
        packed = response.headers.get("Content-Encoding", "") == "gzip"
        text = error_text(
            zlib.decompressobj(wbits=31).decompress(body, BLOCK_BYTES) if packed else body
        )
    detail = f" ({text})" if text else ""
    raise HttpError(
        f"{host_of(response.url)} {what} to {response.url.partition('?')[0]}{detail}; correct it.",
        status,
    )


def _read_start(response: requests.Response, body: bytearray) -> None:
    """Append a little more than the first `BLOCK_BYTES` of a response to `body`."""
    for block in raw_blocks(response):
        body += block
        if len(body) > BLOCK_BYTES:
            break


def raw_blocks(response: requests.Response) -> Iterator[bytes]:
    """Yield the body as it is sent; TransientError if the server hangs up, stops or is slow."""
    try:
        while block := response.raw.read1(BLOCK_BYTES, decode_content=False):
            yield block
    except SlowError as error:
        raise TransientError(TOO_SLOW, slow=True) from error
    except urllib3.exceptions.ReadTimeoutError as error:
        raise TransientError("stopped sending", slow=True) from error
    except (urllib3.exceptions.HTTPError, OSError) as error:
        raise TransientError("cut the connection") from error


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


Progress = Callable[[int, int], None]

NOT_MODIFIED, PARTIAL, RANGE_NOT_SATISFIABLE = 304, 206, 416


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
    request = Request(url, _pairs(params), _pairs(data))
    key = cache_key([request.method, identity or url, request.params, request.data])
    if spec.offline:
        return cached_file(cache, key, what=url)
    with cache.locked(key) as entry:
        cached = entry.cached_file()
        if cached is not None and not cached.condition:
            age = datetime.now(UTC) - datetime.fromisoformat(cached.fetched_at)
            if age.total_seconds() < spec.fresh_s:
                return cached
        download = _Download(request, entry, cached, spec, accept, suffix, check, progress)
        try:
            return download.run(before)
        except HttpError as error:
            if spec.token is None:
                raise
            raise HttpError(spec.token.redact(str(error)), error.status) from None
        except TooLargeError:
            entry.drop_part()
            raise
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
    request, body = Request(url), bytearray()
    try:
        with (
            open_session(spec.deadline()) as session,
            open_response(session, request, {}, spec) as response,
        ):
            check_status(response)
            _read_start(response, body)
    except DeadlineError as error:
        raise _deadline_error(url, spec) from error
    except TransientError as error:
        raise HttpError(f"{host_of(url)} {error}; try again later.", error.status) from error
    return body[:BLOCK_BYTES].decode("utf-8", errors="replace")


# --- One file, several attempts -----------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Download:
    """A request that is repeated until its file is in the cache."""

    request: Request
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
        return host_of(self.request.url)

    def run(self, before: Callable[[], None] | None) -> Fetched:
        """Try until the file is complete, the attempts are used up or the time is over."""
        spec = self.spec
        deadline = spec.deadline()
        with open_session(deadline) as session:
            for attempt in itertools.count(1):
                if before is not None:
                    before()
                try:
                    return self.attempt(session)
                except TransientError as error:
                    failure = error
                except DeadlineError as error:
                    raise _deadline_error(self.request.url, spec, self.entry) from error
                if failure.wait is not None and failure.wait > spec.longest_wait_s:
                    remedy = f" and asks to wait {failure.wait:.0f} s; try again after that"
                    break
                most = min(spec.attempts, spec.slow_attempts) if failure.slow else spec.attempts
                if attempt >= most:
                    remedy = f", {attempt} times; try again later"
                    break
                pause = (
                    spec.backoff_s * 2 ** (attempt - 1) if failure.wait is None else failure.wait
                )
                if pause >= deadline.seconds_left:
                    remedy = f", and {spec.deadline_s:g} s are over; try again later"
                    break
                spec.report(
                    f"{self.host} {failure}; attempt {attempt + 1} of {most} in {pause:.0f} s"
                )
                spec.sleep(pause)
        if self.cached is not None:
            remedy += f", or work offline with the copy of {self.cached.fetched_at} in the cache"
        raise HttpError(f"{self.host} {failure}{remedy}.", failure.status) from failure

    def attempt(self, session: requests.Session) -> Fetched:
        """Request the file once, or the rest of it; return it from the cache."""
        request, entry, spec = self.request, self.entry, self.spec
        offset, part_version, headers = self.range_and_headers()
        with open_response(session, request, headers, spec) as response:
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
            check_status(response)
            version = part_version if offset else FileVersion.from_headers(response.headers)
            if self.accept and version.content_type and version.content_type not in self.accept:
                raise SourceError(
                    f"{self.host} sent {version.content_type} where "
                    f"{' or '.join(self.accept)} was expected; check the address {request.url}."
                )
            if not offset:
                entry.start_part(version)
            self.receive(response, offset)
            url = response.url if spec.token is None else spec.token.redact(response.url)
        body = entry.temporary_path(self.suffix)
        try:
            sha256 = self.unpack(body, version.encoding)
            if self.check is not None:
                self.check(body)
            what = dataclasses.asdict(request)
            return entry.store(body, sha256=sha256, url=url, request=what, version=version)
        finally:
            body.unlink(missing_ok=True)
            entry.drop_part()  # the part was complete, so resuming it cannot correct an error

    def range_and_headers(self) -> tuple[int, FileVersion, dict[str, str]]:
        """Return the size and version of the part to resume, and the headers to send."""
        token, is_get = self.spec.token, self.request.method == "GET"
        # The token is removed from a body, so a part has another length than on the server.
        resumable = is_get and token is None
        offset, version = self.entry.resumable() if resumable else (0, FileVersion())
        headers = self.cached.condition if self.cached and is_get else {}
        if self.accept:
            headers |= {"Accept": ", ".join((*self.accept, ANYTHING))}
        if token is not None:
            headers |= token.headers
        if offset:
            headers |= {"Range": f"bytes={offset}-", "If-Range": version.if_range}
        return offset, version, headers

    def receive(self, response: requests.Response, offset: int) -> None:
        """Append the body of a response to the part, within the size limit."""
        length = response.headers.get("Content-Length", "")
        size = offset
        total = offset + int(length) if length.isdecimal() else 0
        self.check_size(total)
        blocks = raw_blocks(response)
        if self.spec.token is not None:
            if FileVersion.from_headers(response.headers).encoding:
                raise HttpError(
                    f"{self.host} sent a compressed answer although none was requested."
                )
            blocks = self.spec.token.redact_blocks(blocks)
        with self.entry.part.open("ab") as stream:
            for block in blocks:
                size += len(block)
                self.check_size(size)
                stream.write(block)
                if self.progress is not None:
                    self.progress(size, total)

    def unpack(self, body: Path, encoding: str) -> str:
        """Decompress the part into a body; return its checksum."""
        digest = hashlib.sha256()
        size = 0
        with self.entry.part.open("rb") as packed, body.open("wb") as stream:
            for block in _unpacked(packed.read, encoding, self.host):
                size += len(block)
                self.check_size(size)
                if ratio_too_high(packed.tell(), size):
                    raise decompression_bomb_error(
                        f"what {self.host} sends", "report it to the publisher"
                    )
                digest.update(block)
                stream.write(block)
        return digest.hexdigest()

    def check_size(self, size: int) -> None:
        """Raise TooLargeError for more bytes than accepted."""
        if size > self.spec.max_bytes:
            raise TooLargeError(
                f"{self.host} sends more than the {self.spec.max_bytes:,} bytes that are "
                "accepted; ask for a smaller area or for fewer layers."
            )


def _deadline_error(url: str, spec: HttpSpec, entry: CacheEntry | None = None) -> HttpError:
    """Return the error for a request that is over its deadline."""
    resumed = entry is not None and entry.resumable()[0] > 0
    remedy = "run it again to go on from there" if resumed else "ask for less"
    return HttpError(
        f"{host_of(url)} was not done after {spec.deadline_s:g} s; {remedy}, or allow more time "
        "with --timeout."
    )


def _unpacked(read: Callable[[int], bytes], encoding: str, host: str) -> Iterator[bytes]:
    """Read a response body and yield it, decompressed if needed, in blocks of limited size."""
    if not encoding:
        while block := read(BLOCK_BYTES):
            yield block
        return
    if encoding not in {"gzip", "x-gzip"}:
        raise SourceError(
            f"{host} sent the unsupported Content-Encoding {encoding}; report it to the service."
        )
    unzip = zlib.decompressobj(wbits=31)
    try:
        while packed := unzip.unconsumed_tail or unzip.unused_data or read(BLOCK_BYTES):
            if unzip.eof:  # a gzip body may have several members
                unzip = zlib.decompressobj(wbits=31)
            yield unzip.decompress(packed, BLOCK_BYTES)
    except zlib.error as error:
        raise TransientError("sent a damaged gzip body") from error
    if not unzip.eof:
        raise TransientError("sent a gzip body without its end")


def _pairs(items: Mapping[str, str | float] | None) -> tuple[tuple[str, str], ...]:
    return tuple(sorted((name, str(value)) for name, value in (items or {}).items()))
