"""The one module that talks to the network: polite, resumable, bounded, and cached.

Nothing is fetched from a host that the caller did not name.
"""

from __future__ import annotations

import contextlib
import dataclasses
import email.utils
import hashlib
import itertools
import json
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
from semsig_gis.sources.compression import bomb, swells
from semsig_gis.sources.http.cache import Edition, Fetched
from semsig_gis.sources.http.deadline import (
    Deadline,
    OverdueError,
    PunctualAdapter,
    SlowError,
)
from semsig_gis.sources.http.errors import error_text

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from semsig_gis.sources.http.cache import Cache, Entry
    from semsig_gis.sources.http.secret import Secret

USER_AGENT = f"semsig_gis/{__version__} (reads open data once, into a cache)"
MOST_REDIRECTS = 5
TOO_SLOWLY = "sent too slowly"
RETRIED = frozenset({408, 429, 500, 502, 503, 504})
MOVED = frozenset({301, 302, 303, 307, 308})
BLOCK = 2**16
ANYTHING = "*/*;q=0.1"


@dataclass(frozen=True, slots=True, kw_only=True)
class HttpSpec:
    """How requests are made: times in seconds, sizes in bytes.

    A file has to be there `deadline_s` after it was asked for, with all redirects, attempts and
    pauses. `timeout` is for the connection and for the next bytes; less than `slowest` bytes a
    second over the latter counts as stalled, and is tried `slow_attempts` times. The pause after a
    failure, `backoff_s`, doubles each time; a server that asks for more than `longest_wait_s` is
    not waited for. `max_bytes` holds as sent and as unpacked. `fresh_s` is how long a copy is used
    that the server cannot confirm. `tell` takes a line about what is waited for.
    `hosts` are those to which a server may redirect, beside itself. `secret` authorizes every
    request; it is not told, and not in the cache.
    """

    deadline_s: float = 600.0
    timeout: tuple[float, float] = (10.0, 60.0)
    slowest: float = 100.0
    attempts: int = 5
    slow_attempts: int = 2
    backoff_s: float = 2.0
    longest_wait_s: float = 180.0
    max_bytes: int = 2**31
    fresh_s: float = 86_400.0
    offline: bool = False
    sleep: Callable[[float], None] = time.sleep
    tell: Callable[[str], None] = lambda _: None
    hosts: frozenset[str] = frozenset()
    secret: Secret | None = None

    def __post_init__(self) -> None:
        """Refuse numbers of attempts below 1, and a deadline that is now."""
        if self.attempts < 1:
            raise InputError(f"attempts is {self.attempts}; it takes at least 1.")
        if not 0 < self.deadline_s < math.inf:
            raise InputError(f"deadline_s is {self.deadline_s}; give seconds above 0.")

    def deadline(self) -> Deadline:
        """Return the deadline of a request that begins now."""
        return Deadline(self.deadline_s, patience=self.timeout[1], slowest=self.slowest)


DEFAULT_HTTP: HttpSpec = HttpSpec()


class HttpError(SourceError):
    """A server did not give what it was asked for; `status` is its answer, 0 if it gave none."""

    def __init__(self, message: str, status: int = 0) -> None:
        super().__init__(message)
        self.status = status


class PassingError(Exception):
    """Something failed that may work the next time, after `wait` seconds if the server said so.

    `slow` says that the failure took its time, as the next one will.
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
    """What is asked for: an address with its query, by GET, or by POST where there is a form."""

    url: str
    params: tuple[tuple[str, str], ...] = ()
    data: tuple[tuple[str, str], ...] = ()

    @property
    def method(self) -> str:
        """Return the HTTP method."""
        return "POST" if self.data else "GET"


@contextlib.contextmanager
def polite_session(deadline: Deadline) -> Iterator[requests.Session]:
    """Give a session that introduces itself, asks for nothing but gzip, and ends by a deadline."""
    with requests.Session() as session:
        for scheme in ("http://", "https://"):
            session.mount(scheme, PunctualAdapter(deadline))
        session.headers.update({"User-Agent": USER_AGENT, "Accept-Encoding": "gzip"})
        session.auth = lambda prepared: prepared  # no password from the user's .netrc
        yield session


@contextlib.contextmanager
def answer_to(
    session: requests.Session, request: Request, headers: Mapping[str, str], spec: HttpSpec
) -> Iterator[requests.Response]:
    """Send a request, follow redirects within the host, and give the response, its body unread."""
    url = request.url
    params: tuple[tuple[str, str], ...] | None = request.params
    for _ in range(MOST_REDIRECTS + 1):
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
            raise _failure(error, request.url) from error
        with response:
            if response.status_code not in MOVED:
                yield response
                return
            target = urljoin(response.url, response.headers.get("Location", ""))
            _require_named_host(response.url, target, spec)
            url, params = target, None
    raise HttpError(
        f"{host_of(request.url)} redirects too often from {request.url}; check the address."
    )


def _require_named_host(source: str, target: str, spec: HttpSpec) -> None:
    """Refuse a redirect to another host, but for those of the specification without a secret."""
    old, new = urlsplit(source), urlsplit(target)
    try:
        same = (old.scheme, old.hostname, old.port) == (new.scheme, new.hostname, new.port)
        # http to https of the same host, both on their usual ports
        safer = (old.scheme, new.scheme) == ("http", "https") and old.hostname == new.hostname
        safer = safer and old.port in {None, 80} and new.port in {None, 443}
    except ValueError:  # a port that is no number
        same = safer = False
    named = new.hostname in spec.hosts and new.scheme in {old.scheme, "https"}
    safer = safer or (named and spec.secret is None)
    if not (same or safer):
        raise SourceError(
            f"{old.netloc} redirects to {new.netloc or target}, which neither you nor the "
            f"catalogue named; if you trust it, put its address in the catalogue."
        )


def _failure(error: Exception, url: str) -> Exception:
    """Return what to raise for a connection that failed."""
    if isinstance(error, requests.exceptions.SSLError):
        msg = f"{host_of(url)} has no certificate that this machine trusts; check the address."
        return HttpError(msg)
    if isinstance(error, SlowError):
        return PassingError(TOO_SLOWLY, slow=True)
    if isinstance(error, requests.exceptions.ConnectTimeout | requests.exceptions.ReadTimeout):
        return PassingError("did not answer in time", slow=True)
    if isinstance(error, requests.exceptions.ConnectionError):
        return PassingError("could not be reached or hung up")
    msg = f"{url} cannot be requested ({' '.join(str(error).split()).rstrip('.')}); correct it."
    return HttpError(msg)


def require_success(response: requests.Response) -> None:
    """Refuse an answer that is no part of the file; PassingError if a later one may be."""
    status = response.status_code
    if status in {requests.codes.ok, requests.codes.partial}:
        return
    what = f"answered {status} {response.reason or ''}".rstrip()
    if status in RETRIED:
        raise PassingError(what, status, _retry_after(response))
    detail = _detail(response)
    raise HttpError(
        f"{host_of(response.url)} {what} to {response.url.partition('?')[0]}{detail}; correct it.",
        status,
    )


def _detail(response: requests.Response) -> str:
    """Return what a service says about an error, as part of a sentence."""
    body = b""
    with contextlib.suppress(PassingError):
        for block in blocks_of(response):
            body += block
            if len(body) > BLOCK:
                break
    with contextlib.suppress(zlib.error):
        if response.headers.get("Content-Encoding", "") == "gzip":
            body = zlib.decompressobj(wbits=31).decompress(body, BLOCK)
        text = error_text(body)
        if text:
            return f" ({text})"
    return ""


def blocks_of(response: requests.Response) -> Iterator[bytes]:
    """Yield the body as it is sent; PassingError if the server hangs up, stops or is too slow."""
    try:
        while block := response.raw.read1(BLOCK, decode_content=False):
            yield block
    except SlowError as error:
        raise PassingError(TOO_SLOWLY, slow=True) from error
    except urllib3.exceptions.ReadTimeoutError as error:
        what = "stopped sending"
        raise PassingError(what, slow=True) from error
    except (urllib3.exceptions.HTTPError, OSError) as error:
        what = "cut the connection"
        raise PassingError(what) from error


def _retry_after(response: requests.Response) -> float | None:
    """Return the seconds that a server asks to wait, which it may say as a date."""
    text = response.headers.get("Retry-After", "").strip()
    if text.isdecimal():
        return float(text)
    try:
        date = email.utils.parsedate_to_datetime(text)
    except ValueError:
        return None
    return max(0.0, (date.astimezone(UTC) - datetime.now(UTC)).total_seconds())


def require_address(url: str) -> None:
    """Refuse an address that is not http, or holds a password, which would end up in the cache."""
    try:
        parts = urlsplit(url)
        usable = parts.scheme in {"http", "https"} and parts.hostname and parts.password is None
    except ValueError:  # half a bracket
        usable = False
    if not usable:
        raise InputError(
            f"{url!r} is not an address; write one that begins with https://, without a password."
        )


def host_of(url: str) -> str:
    """Return the host of an address, with its port if it names one."""
    return urlsplit(url).netloc


Progress = Callable[[int, int], None]

NOT_MODIFIED, PARTIAL, BEYOND_THE_END = 304, 206, 416


class TooLargeError(SourceError):
    """A server sends more than is accepted."""


class NotCachedError(SourceError):
    """Offline, and the cache does not have it."""


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

    `accept` are the content types that may come, all by default. The cache knows the request by
    `identity` instead of the address where services mirror one another. `check` raises SourceError
    for a file that is not to be kept; `progress` takes the bytes that have arrived and those there
    are, 0 where nobody knows. A cached copy is confirmed by a conditional request where the server
    gave an ETag or a date; else it is taken as it is for ``spec.fresh_s``. A connection that is cut
    goes on where it was cut (RFC 9110, If-Range), also in a later run, if the server can do that.

    HttpError, TooLargeError, NotCachedError or another SourceError says why there is no file.
    """
    require_address(url)
    request = Request(url, _pairs(params), _pairs(data))
    what = json.dumps([request.method, identity or url, request.params, request.data])
    key = hashlib.sha256(what.encode()).hexdigest()[:32]
    if spec.offline:
        entry = cache.entry(key)
        held = entry.copy()
        if held is None:
            state = "is damaged in" if entry.sidecar.exists() else "is not in"
            raise NotCachedError(
                f"{url} {state} the cache {cache.folder}; run once without --offline to fetch it."
            )
        return held
    with cache.locked(key) as entry:
        held = entry.copy()
        if held is not None and not held.condition:
            age = datetime.now(UTC) - datetime.fromisoformat(held.fetched_at)
            if age.total_seconds() < spec.fresh_s:
                return held
        job = _Job(request, entry, held, spec, accept, suffix, check, progress)
        try:
            return _persist(job, before)
        except HttpError as error:
            if spec.secret is None:
                raise
            raise HttpError(spec.secret.hide(str(error)), error.status) from None
        except TooLargeError:
            entry.drop_part()
            raise
        except OSError as error:
            raise InputError(
                f"cache folder {cache.folder} cannot be written ({error.strerror or error}); "
                "make room or choose another folder."
            ) from error


def read_text(url: str, *, spec: HttpSpec = DEFAULT_HTTP) -> str:
    """Ask once for a short text that is not worth keeping, and return up to 64 KiB of it."""
    require_address(url)
    request = Request(url)
    try:
        with (
            polite_session(spec.deadline()) as session,
            answer_to(session, request, {}, spec) as response,
        ):
            require_success(response)
            body = b""
            for block in blocks_of(response):
                body += block
                if len(body) > BLOCK:
                    break
    except OverdueError as error:
        raise _overdue(url, spec) from error
    except PassingError as error:
        raise HttpError(f"{host_of(url)} {error}; try again later.", error.status) from error
    return body[:BLOCK].decode("utf-8", errors="replace")


# --- One file, several attempts -----------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Job:
    request: Request
    entry: Entry
    held: Fetched | None
    spec: HttpSpec
    accept: tuple[str, ...]
    suffix: str
    check: Callable[[Path], object] | None
    progress: Progress | None


def _persist(job: _Job, before: Callable[[], None] | None) -> Fetched:
    """Try until it works, has failed too often, or the time is over."""
    spec, host = job.spec, host_of(job.request.url)
    deadline = spec.deadline()
    with polite_session(deadline) as session:
        for attempt in itertools.count(1):
            if before is not None:
                before()
            try:
                return _attempt(session, job)
            except PassingError as error:
                failure = error
            except OverdueError as error:
                raise _overdue(job.request.url, spec, job.entry) from error
            if failure.wait is not None and failure.wait > spec.longest_wait_s:
                remedy = f" and asks to wait {failure.wait:.0f} s; try again after that"
                break
            most = min(spec.attempts, spec.slow_attempts) if failure.slow else spec.attempts
            if attempt >= most:
                remedy = f", {attempt} times; try again later"
                break
            pause = spec.backoff_s * 2 ** (attempt - 1) if failure.wait is None else failure.wait
            if pause >= deadline.seconds_left:
                remedy = f", and {spec.deadline_s:g} s are over; try again later"
                break
            spec.tell(f"{host} {failure}; attempt {attempt + 1} of {most} in {pause:.0f} s")
            spec.sleep(pause)
    if job.held is not None:
        remedy += f", or work offline with the copy of {job.held.fetched_at} in the cache"
    raise HttpError(f"{host} {failure}{remedy}.", failure.status) from failure


def _overdue(url: str, spec: HttpSpec, entry: Entry | None = None) -> HttpError:
    """Return the plain sentence for a request whose time is over."""
    resumed = entry is not None and entry.resumable()[0] > 0
    remedy = "run it again to go on from there" if resumed else "ask for less"
    return HttpError(
        f"{host_of(url)} was not done after {spec.deadline_s:g} s; {remedy}, or allow more time "
        "with --timeout."
    )


def _attempt(session: requests.Session, job: _Job) -> Fetched:
    request, entry, spec = job.request, job.entry, job.spec
    have, begun, headers = _conditions(job)
    with answer_to(session, request, headers, spec) as response:
        if response.status_code == NOT_MODIFIED and job.held is not None:
            entry.drop_part()
            return job.held
        if not (have and _continues(response, have, begun)):
            have = 0
            if response.status_code in {PARTIAL, BEYOND_THE_END}:
                entry.drop_part()
                what = "sent another part of the file than the one asked for"
                raise PassingError(what, wait=0.0)
        require_success(response)
        edition = begun if have else Edition.of(response.headers)
        if job.accept and edition.content_type and edition.content_type not in job.accept:
            raise SourceError(
                f"{host_of(request.url)} sent {edition.content_type} where "
                f"{' or '.join(job.accept)} was expected; check the address {request.url}."
            )
        if not have:
            entry.start_part(edition)
        _receive(response, job, have)
        url = response.url if spec.secret is None else spec.secret.hide(response.url)
    body = entry.scratch(job.suffix)
    try:
        sha256, size = _unpack(entry.part, body, edition.encoding, job)
        if job.check is not None:
            job.check(body)
        fetched = Fetched(
            path=body,
            sha256=sha256,
            fetched_at=datetime.now(UTC).isoformat(timespec="seconds"),
            url=url,
            from_cache=False,
            bytes=size,
            content_type=edition.content_type,
            etag=edition.etag,
            last_modified=edition.last_modified,
        )
        return entry.store(fetched, dataclasses.asdict(request))
    finally:
        body.unlink(missing_ok=True)
        entry.drop_part()  # it was whole: what is wrong with it now stays wrong


def _conditions(job: _Job) -> tuple[int, Edition, dict[str, str]]:
    """Return how many bytes are there already, of which edition, and the headers to send."""
    secret = job.spec.secret
    may_go_on = job.request.method == "GET" and secret is None  # what has a secret in it is changed
    have, begun = job.entry.resumable() if may_go_on else (0, Edition())
    headers = job.held.condition if job.held and job.request.method == "GET" else {}
    if job.accept:
        headers |= {"Accept": ", ".join((*job.accept, ANYTHING))}
    if secret is not None:
        headers |= secret.headers
    if have:
        headers |= {"Range": f"bytes={have}-", "If-Range": begun.if_range}
    return have, begun, headers


def _continues(response: requests.Response, have: int, begun: Edition) -> bool:
    """Tell whether a response goes on where the part ends, in the same edition."""
    starts = response.headers.get("Content-Range", "").startswith(f"bytes {have}-")
    tag = response.headers.get("ETag", begun.etag)
    return response.status_code == PARTIAL and starts and tag == begun.etag


def _receive(response: requests.Response, job: _Job, have: int) -> None:
    """Append the body to the part, within the limit."""
    length = response.headers.get("Content-Length", "")
    total = have + int(length) if length.isdecimal() else 0
    _require_room(total, job)
    blocks = blocks_of(response)
    if job.spec.secret is not None:
        if Edition.of(response.headers).encoding:
            raise HttpError(
                f"{host_of(job.request.url)} sent a compressed answer although none was requested."
            )
        blocks = job.spec.secret.strained(blocks)
    with job.entry.part.open("ab") as stream:
        for block in blocks:
            have += len(block)
            _require_room(have, job)
            stream.write(block)
            if job.progress is not None:
                job.progress(have, total)


def _unpack(part: Path, body: Path, encoding: str, job: _Job) -> tuple[str, int]:
    """Write what was meant from what was sent; return its checksum and size."""
    digest = hashlib.sha256()
    size = 0
    with part.open("rb") as packed, body.open("wb") as stream:
        for block in _unpacked(packed.read, encoding, host_of(job.request.url)):
            size += len(block)
            _require_room(size, job)
            if swells(packed.tell(), size):
                what = f"what {host_of(job.request.url)} sends"
                raise bomb(what, "tell its publisher")
            digest.update(block)
            stream.write(block)
    return digest.hexdigest(), size


def _unpacked(read: Callable[[int], bytes], encoding: str, host: str) -> Iterator[bytes]:
    """Yield a body in blocks of bounded size, however well it is packed."""
    if not encoding:
        while block := read(BLOCK):
            yield block
        return
    if encoding not in {"gzip", "x-gzip"}:
        raise SourceError(
            f"{host} sent the unsupported Content-Encoding {encoding}; report it to the service."
        )
    unzip = zlib.decompressobj(wbits=31)
    try:
        while packed := unzip.unconsumed_tail or unzip.unused_data or read(BLOCK):
            if unzip.eof:  # a gzip body may have several members
                unzip = zlib.decompressobj(wbits=31)
            yield unzip.decompress(packed, BLOCK)
    except zlib.error as error:
        what = "sent a damaged gzip body"
        raise PassingError(what) from error
    if not unzip.eof:
        what = "sent a gzip body without its end"
        raise PassingError(what)


def _require_room(size: int, job: _Job) -> None:
    if size > job.spec.max_bytes:
        raise TooLargeError(
            f"{host_of(job.request.url)} sends more than the {job.spec.max_bytes:,} bytes that are "
            "accepted; ask for a smaller area or for fewer layers."
        )


def _pairs(items: Mapping[str, str | float] | None) -> tuple[tuple[str, str], ...]:
    return tuple(sorted((name, str(value)) for name, value in (items or {}).items()))
