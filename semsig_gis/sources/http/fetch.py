"""The one module that talks to the network: polite, resumable, bounded, and cached.

Nothing is fetched from a host that the caller did not name.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from semsig_gis.core.errors import InputError, SourceError
from semsig_gis.sources.http.cache import Edition, Fetched
from semsig_gis.sources.http.wire import (
    BLOCK,
    DEFAULT_HTTP,
    HttpError,
    PassingError,
    Request,
    answer_to,
    blocks_of,
    host_of,
    require_address,
    require_success,
    session_for,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    import requests

    from semsig_gis.sources.http.cache import Cache, Entry
    from semsig_gis.sources.http.wire import HttpSpec

Progress = Callable[[int, int], None]

NOT_MODIFIED, PARTIAL, BEYOND_THE_END = 304, 206, 416
TEXT_BYTES = 2**16  # the most that `read_text` takes


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

    `accept` are the content types that may come, all by default; `suffix` is that of the file in
    the cache. The cache knows the request by `identity` instead of the
    address where services mirror one another. `check` takes the path of what was sent and raises
    SourceError if it is not to be kept; `before` is called before each request; `progress` takes
    the bytes that have arrived and those there are, 0 where nobody knows.

    A cached copy is confirmed by a conditional request where the server gave an ETag or a date;
    else it is taken as it is for ``spec.fresh_s``. A connection that is cut goes on where it was
    cut (RFC 9110, If-Range), also in a later run, if the server can do that.

    HttpError if the server refuses or fails until the attempts are used up; TooLargeError above
    ``spec.max_bytes``; NotCachedError if offline without a sound copy; SourceError if something
    else is sent, or a redirect leads to another host.
    """
    require_address(url)
    request = Request(url, _pairs(params), _pairs(data))
    what = json.dumps([request.method, identity or url, request.params, request.data])
    key = hashlib.sha256(what.encode()).hexdigest()[:32]
    if spec.offline:
        return _from_cache(cache.entry(key), cache, url)
    with cache.locked(key) as entry:
        held = entry.copy()
        if held is not None and not held.condition:
            age = datetime.now(UTC) - datetime.fromisoformat(held.fetched_at)
            if age.total_seconds() < spec.fresh_s:
                return held
        job = _Job(request, entry, held, spec, accept, suffix, check, progress)
        try:
            return _persist(job, before)
        except TooLargeError:
            entry.drop_part()
            raise
        except OSError as error:
            msg = (
                f"cache folder {cache.folder} cannot be written ({error.strerror or error}); "
                "make room or choose another folder."
            )
            raise InputError(msg) from error


def read_text(url: str, *, spec: HttpSpec = DEFAULT_HTTP) -> str:
    """Ask once for a short text that is not worth keeping, and return up to 64 KiB of it."""
    require_address(url)
    request = Request(url)
    try:
        with session_for(spec) as session, answer_to(session, request, {}, spec) as response:
            require_success(response, spec)
            body = b""
            for block in blocks_of(response, spec):
                body += block
                if len(body) > TEXT_BYTES:
                    break
    except PassingError as error:
        msg = f"{host_of(url)} {error}; try again later."
        raise HttpError(msg, error.status) from error
    return body[:TEXT_BYTES].decode("utf-8", errors="replace")


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
    """Try until it works, or has failed too often."""
    spec = job.spec
    with session_for(spec) as session:
        for attempt in range(1, spec.attempts + 1):
            if before is not None:
                before()
            try:
                return _attempt(session, job)
            except PassingError as error:
                failure = error
            if failure.wait is not None and failure.wait > spec.longest_wait_s:
                remedy = f" and asks to wait {failure.wait:.0f} s; try again after that"
                break
            if attempt < spec.attempts:
                pause = spec.backoff_s * 2 ** (attempt - 1)
                spec.sleep(pause if failure.wait is None else failure.wait)
        else:
            remedy = f", {spec.attempts} times; try again later"
    if job.held is not None:
        remedy += f", or work offline with the copy of {job.held.fetched_at} in the cache"
    msg = f"{host_of(job.request.url)} {failure}{remedy}."
    raise HttpError(msg, failure.status) from failure


def _attempt(session: requests.Session, job: _Job) -> Fetched:
    request, entry, spec = job.request, job.entry, job.spec
    have, begun = entry.resumable() if request.method == "GET" else (0, Edition())
    headers = job.held.condition if job.held and request.method == "GET" else {}
    if have:
        headers |= {"Range": f"bytes={have}-", "If-Range": begun.if_range}
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
        require_success(response, spec)
        edition = begun if have else Edition.of(response.headers)
        if job.accept and edition.content_type and edition.content_type not in job.accept:
            msg = (
                f"{host_of(request.url)} sent {edition.content_type} where "
                f"{' or '.join(job.accept)} was expected; check the address {request.url}."
            )
            raise SourceError(msg)
        if not have:
            entry.start_part(edition)
        _receive(response, job, have)
        url = response.url
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
    with job.entry.part.open("ab") as stream:
        for block in blocks_of(response, job.spec):
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
        msg = f"{host} sent the unsupported Content-Encoding {encoding}; report it to the service."
        raise SourceError(msg)
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
        msg = (
            f"{host_of(job.request.url)} sends more than the {job.spec.max_bytes:,} bytes that are "
            "accepted; ask for a smaller area or for fewer layers."
        )
        raise TooLargeError(msg)


def _pairs(items: Mapping[str, str | float] | None) -> tuple[tuple[str, str], ...]:
    return tuple(sorted((name, str(value)) for name, value in (items or {}).items()))


def _from_cache(entry: Entry, cache: Cache, url: str) -> Fetched:
    held = entry.copy()
    if held is None:
        state = "is damaged in" if entry.sidecar.exists() else "is not in"
        msg = f"{url} {state} the cache {cache.folder}; run once without --offline to fetch it."
        raise NotCachedError(msg)
    return held
