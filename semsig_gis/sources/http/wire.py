"""One HTTP request: who asks, how long, from which host; each failure told as what it means."""

from __future__ import annotations

import contextlib
import email.utils
import json
import time
import zlib
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING
from urllib.parse import urljoin, urlsplit

import requests
import urllib3.exceptions

from semsig_gis import __version__
from semsig_gis.core.errors import InputError, SourceError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

USER_AGENT = f"semsig_gis/{__version__} (reads open data once, into a cache)"
MOST_REDIRECTS = 5
RETRIED = frozenset({408, 429, 500, 502, 503, 504})
MOVED = frozenset({301, 302, 303, 307, 308})
BLOCK = 2**16


@dataclass(frozen=True, slots=True, kw_only=True)
class HttpSpec:
    """How requests are made: times in seconds, sizes in bytes.

    `timeout` is for the connection and for the next bytes; less than `slowest` bytes a second over
    the latter counts as stalled. The pause after a failure, `backoff_s`, doubles each time; a
    server that asks for more than `longest_wait_s` is not waited for. `max_bytes` holds as sent and
    as unpacked. `fresh_s` is how long a copy is used that the server cannot confirm.
    """

    timeout: tuple[float, float] = (10.0, 60.0)
    slowest: float = 100.0
    attempts: int = 5
    backoff_s: float = 2.0
    longest_wait_s: float = 180.0
    max_bytes: int = 2**31
    fresh_s: float = 86_400.0
    offline: bool = False
    user_agent: str = USER_AGENT
    sleep: Callable[[float], None] = time.sleep

    def __post_init__(self) -> None:
        """Refuse numbers of attempts below 1."""
        if self.attempts < 1:
            msg = f"attempts is {self.attempts}; it takes at least 1."
            raise InputError(msg)


DEFAULT_HTTP = HttpSpec()


class HttpError(SourceError):
    """A server did not give what it was asked for; `status` is its answer, 0 if it gave none."""

    def __init__(self, message: str, status: int = 0) -> None:
        super().__init__(message)
        self.status = status


class PassingError(Exception):
    """Something failed that may work the next time, after `wait` seconds if the server said so."""

    def __init__(self, what: str, status: int = 0, wait: float | None = None) -> None:
        super().__init__(what)
        self.status = status
        self.wait = wait


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
def session_for(spec: HttpSpec) -> Iterator[requests.Session]:
    """Give a session that introduces itself and asks for nothing but gzip."""
    with requests.Session() as session:
        session.headers.update({"User-Agent": spec.user_agent, "Accept-Encoding": "gzip"})
        session.auth = lambda prepared: prepared  # no password from the user's .netrc
        yield session


@contextlib.contextmanager
def answer_to(
    session: requests.Session, request: Request, headers: Mapping[str, str], spec: HttpSpec
) -> Iterator[requests.Response]:
    """Send a request and give the response, of which no body is read yet.

    Redirects within the host are followed. PassingError if the server cannot be reached now,
    HttpError if it never can, SourceError for a redirect to another host.
    """
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
        except (requests.RequestException, urllib3.exceptions.HTTPError) as error:
            raise _failure(error, request.url) from error
        with response:
            if response.status_code not in MOVED:
                yield response
                return
            target = urljoin(response.url, response.headers.get("Location", ""))
            _require_same_host(response.url, target)
            url, params = target, None
    msg = f"{host_of(request.url)} redirects too often from {request.url}; check the address."
    raise HttpError(msg)


def _require_same_host(source: str, target: str) -> None:
    old, new = urlsplit(source), urlsplit(target)
    try:
        same = (old.scheme, old.hostname, old.port) == (new.scheme, new.hostname, new.port)
        # http to https of the same host, both on their usual ports
        safer = (old.scheme, new.scheme) == ("http", "https") and old.hostname == new.hostname
        safer = safer and old.port in {None, 80} and new.port in {None, 443}
    except ValueError:  # a port that is no number
        same = safer = False
    if not (same or safer):
        msg = (
            f"{old.netloc} redirects to {new.netloc or target}, which neither you nor the "
            f"catalogue named; if you trust it, put its address in the catalogue."
        )
        raise SourceError(msg)


def _failure(error: Exception, url: str) -> Exception:
    """Return what to raise for a connection that failed."""
    if isinstance(error, requests.exceptions.SSLError):
        msg = f"{host_of(url)} has no certificate that this machine trusts; check the address."
        return HttpError(msg)
    if isinstance(error, requests.exceptions.ConnectTimeout | requests.exceptions.ReadTimeout):
        return PassingError("did not answer in time")
    if isinstance(error, requests.exceptions.ConnectionError):
        return PassingError("could not be reached or hung up")
    msg = f"{url} cannot be asked for ({' '.join(str(error).split()).rstrip('.')}); correct it."
    return HttpError(msg)


def require_success(response: requests.Response, spec: HttpSpec) -> None:
    """Refuse an answer that is not the file, or a part of it.

    PassingError if it may be another one later, HttpError if it is final.
    """
    status = response.status_code
    if status in {requests.codes.ok, requests.codes.partial}:
        return
    what = f"answered {status} {response.reason or ''}".rstrip()
    if status in RETRIED:
        raise PassingError(what, status, _retry_after(response))
    detail = _detail(response, spec)
    msg = f"{host_of(response.url)} {what} to {response.url.partition('?')[0]}{detail}; correct it."
    raise HttpError(msg, status)


def _detail(response: requests.Response, spec: HttpSpec) -> str:
    """Return what a service says in JSON about an error, as part of a sentence."""
    body = b""
    with contextlib.suppress(PassingError):
        for block in blocks_of(response, spec):
            body += block
            if len(body) > BLOCK:
                break
    with contextlib.suppress(ValueError, AttributeError, zlib.error):
        if response.headers.get("Content-Encoding", "") == "gzip":
            body = zlib.decompressobj(wbits=31).decompress(body, BLOCK)
        said = json.loads(body)
        text = " ".join(str(said.get("message") or said.get("error") or "").split())
        if text:
            return f" ({text[:200].rstrip('.')})".replace(". ", ", ")
    return ""


def blocks_of(response: requests.Response, spec: HttpSpec) -> Iterator[bytes]:
    """Yield the body as it is sent.

    PassingError if the server closes the connection too early, stops, or gets too slow.
    """
    since, got = time.monotonic(), 0
    try:
        while block := response.raw.read1(BLOCK, decode_content=False):
            yield block
            got += len(block)
            elapsed = time.monotonic() - since
            if elapsed >= spec.timeout[1]:
                if got < spec.slowest * elapsed:
                    what = "sent too slowly"
                    raise PassingError(what)
                since, got = time.monotonic(), 0
    except urllib3.exceptions.ReadTimeoutError as error:
        what = "stopped sending"
        raise PassingError(what) from error
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
        msg = f"{url!r} is not an address; write one that begins with https://, without a password."
        raise InputError(msg)


def host_of(url: str) -> str:
    """Return the host of an address, with its port if it names one."""
    return urlsplit(url).netloc
