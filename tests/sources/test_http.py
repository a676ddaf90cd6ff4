"""HTTP requests to a local server that simulates failures."""

from __future__ import annotations

import dataclasses
import email.utils
import gzip
import json
import multiprocessing
import socket
from contextlib import nullcontext
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any
from unittest.mock import Mock

import pytest
from machine import PATIENCE_S
from requests.exceptions import SSLError
from sentences import assert_sentence, refused
from servers import Answer, published, zipped

from semsig_gis import __version__
from semsig_gis.core import InputError, SourceError
from semsig_gis.sources import (
    AccessToken,
    Cache,
    HttpError,
    HttpSpec,
    NotCachedError,
    TooLargeError,
    fetch,
    read_text,
)
from semsig_gis.sources.http import cache as _http_cache
from semsig_gis.sources.http.fetch import _check_redirect, _connection_error

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from servers import Request, Script, Server

    from semsig_gis.sources import Fetched

    Get = Callable[..., Fetched]

CONTENT = json.dumps({"trees": list(range(5_000))}).encode()
JSON = ("application/json",)
FULL = Answer(CONTENT)
DATE = "Thu, 01 Jan 2026 00:00:00 GMT"


@pytest.fixture
def get(server: Server, cache: Cache, quick: HttpSpec) -> Get:
    """Fetch a path of the server; keywords are fields of the specification or of `fetch`."""
    fields = {field.name for field in dataclasses.fields(HttpSpec)}

    def call(path: str = "/trees", **what: Any) -> Fetched:  # noqa: ANN401 - see above
        own = {name: what.pop(name) for name in fields & what.keys()}
        return fetch(server.url + path, cache=cache, spec=dataclasses.replace(quick, **own), **what)

    return call


def failure_of(call: Callable[..., object], *words: str, **what: Any) -> SourceError:  # noqa: ANN401
    """Return the error of a call and check that its message is one sentence."""
    with pytest.raises(SourceError) as caught:
        call(**what)
    assert_sentence(caught.value, *words)
    return caught.value


def answers(body: bytes = CONTENT, status: int = 200, **headers: str) -> Answer:
    """Return an answer with headers, which are written with underscores here."""
    fields = {name.replace("_", "-"): value for name, value in headers.items()}
    return Answer(body, status=status, headers=fields)


def leftovers(cache: Cache) -> set[str]:
    """Return the suffixes of the files in the cache, without locks."""
    names = (path.name for path in cache.folder.iterdir())
    return {name.partition(".")[2] for name in names} - {"lock"}


def test_file_is_fetched_with_its_description(server: Server, get: Get) -> None:
    server.on("/trees", Answer(CONTENT, type="application/json; charset=utf-8"))
    steps: list[tuple[int, int]] = []
    fetched = get(
        params={"limit": -1, "where": "a=1"}, accept=JSON, progress=lambda *step: steps.append(step)
    )
    assert fetched.path.read_bytes() == CONTENT
    assert (fetched.path.suffix, fetched.content_type) == (".json", "application/json")
    assert (fetched.bytes, fetched.from_cache) == (len(CONTENT), False)
    assert fetched.sha256 == _http_cache.checksum(fetched.path)
    assert fetched.url == f"{server.url}/trees?limit=-1&where=a%3D1"
    assert datetime.fromisoformat(fetched.fetched_at).tzinfo is not None
    assert steps[-1] == (len(CONTENT), len(CONTENT))
    assert steps == sorted(steps)
    (request,) = server.requests
    assert request.query == {"limit": "-1", "where": "a=1"}
    assert request.headers["user-agent"].startswith(f"semsig_gis/{__version__} (")
    assert get(suffix=".txt").path.suffix == ".txt"


def test_netrc_is_ignored(
    server: Server, get: Get, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    netrc = tmp_path / "netrc"
    netrc.write_text("machine 127.0.0.1 login me password secret\n")
    netrc.chmod(0o600)
    monkeypatch.setenv("NETRC", str(netrc))
    server.on("/trees", Answer(CONTENT))
    get()
    assert "authorization" not in server.requests[0].headers


def test_form_is_posted(server: Server, get: Get) -> None:
    server.on("/trees", lambda request: Answer(json.dumps(request.form).encode()))
    for form in ({"data": "node;out é;"}, {"data": "way;out;"}):
        assert json.loads(get(data=form).path.read_bytes()) == form
    assert server.requests[0].method == "POST"


def test_redirect_within_the_host_is_followed(server: Server, get: Get) -> None:
    server.on("/trees", Answer(status=302, headers={"Location": "/moved/trees?x=1"}))
    server.on("/moved/trees", Answer(CONTENT))
    fetched = get(params={"y": 2})
    assert fetched.path.read_bytes() == CONTENT
    assert fetched.url == f"{server.url}/moved/trees?x=1"


def test_short_text_is_read(server: Server, quick: HttpSpec) -> None:
    server.on("/status", Answer(b"2 slots available now.\n", type="text/plain"))
    server.on("/long", Answer(b"x" * 200_000))
    server.on("/packed", zipped(b"2 slots"))
    assert read_text(f"{server.url}/status", spec=quick) == "2 slots available now.\n"
    assert len(read_text(f"{server.url}/long", spec=quick)) == 2**16
    assert read_text(f"{server.url}/packed", spec=quick) == "2 slots"


@pytest.mark.parametrize("status", [429, 500, 502, 503, 504])
def test_temporary_failure_is_retried_after_pauses(
    server: Server, get: Get, slept: list[float], status: int
) -> None:
    server.on("/trees", Answer(status=status), Answer(status=status), Answer(CONTENT))
    assert get().path.read_bytes() == CONTENT
    assert slept == [1.0, 2.0]


def test_retry_after_header_sets_the_pause(server: Server, get: Get, slept: list[float]) -> None:
    date = email.utils.format_datetime(datetime.now(UTC) + timedelta(seconds=40), usegmt=True)
    past = "Thu, 01 Jan 2015 00:00:00 GMT"
    for texts in (("17", "soon"), (date, past)):
        busy = [Answer(status=503, headers={"Retry-After": text}) for text in texts]
        server.on("/trees", *busy, Answer(CONTENT))
        get(params={"say": texts[0]})
    assert slept[:2] == [17.0, 2.0]  # an invalid header is ignored
    assert 35 < slept[2] <= 40
    assert slept[3] == 0


PACKED = gzip.compress(CONTENT)


def packed_and_cut() -> Callable[[Request], Answer]:
    plain = published(PACKED, etag='"7"', cuts=[500])

    def script(request: Request) -> Answer:
        answer = plain(request)
        if answer.status == 206:  # which may omit the headers of the first answer
            return answer
        return dataclasses.replace(answer, headers={**answer.headers, "Content-Encoding": "gzip"})

    return script


def recoveries() -> dict[str, tuple[list[str | None], list[Script]]]:
    """Return the ranges of the requests after the first, and answers that give the whole file."""

    def cut(**what: Any) -> Callable[[Request], Answer]:  # noqa: ANN401 - as of `published`
        return published(CONTENT, cuts=[1_000], **what)

    def gzipped(body: bytes) -> Answer:
        return answers(body, Content_Encoding="gzip")

    twice: list[str | None] = ["bytes=1000-", "bytes=3000-"]
    tag: dict[str, Any] = {"etag": '"7"'}
    elsewhere = answers(CONTENT[5:], 206, Content_Range="bytes 5-9/10")
    other = answers(CONTENT[9:], 206, Content_Range="bytes 1000-", ETag='"8"')
    whole = published(CONTENT, **tag)
    members = gzip.compress(CONTENT[:9]) + gzip.compress(CONTENT[9:])
    return {
        "packed": ([], [zipped(CONTENT)]),
        "packed chunked": ([], [dataclasses.replace(zipped(CONTENT), chunked=True)]),
        "packed members": ([], [gzipped(members)]),
        "packed short": ([None], [gzipped(PACKED[:-20]), FULL]),
        "packed bad": ([None], [gzipped(b"\0" + PACKED[1:]), FULL]),
        "packed cut": (["bytes=500-"], [packed_and_cut()]),
        "cut": ([None], [Answer(CONTENT, cut=9_999), FULL]),
        "cut twice": (twice, [published(CONTENT, cuts=[1_000, 2_000], **tag)]),
        "cut twice, dated": (twice, [published(CONTENT, cuts=[1_000, 2_000], modified=DATE)]),
        "cut chunked": ([None], [Answer(CONTENT, cut=9_999, chunked=True), FULL]),
        "cut without ranges": (["bytes=1000-"], [cut(**tag, ranges=False)]),
        "cut without tag": ([None], [cut()]),
        "cut with weak tag": ([None], [cut(etag='W/"7"')]),
        "part unasked": ([None], [Answer(CONTENT[:50], status=206), FULL]),
        "part elsewhere": (["bytes=1000-", None], [cut(**tag), elsewhere, FULL]),
        "part of other edition": (["bytes=1000-", None], [cut(**tag), other, FULL]),
        "changed file": (["bytes=9-"], [published(b'{"trees": []}', etag='"8"', cuts=[9]), whole]),
        "part beyond": (["bytes=1000-", None], [cut(**tag), Answer(status=416), FULL]),
    }


@pytest.mark.parametrize("case", recoveries())
def test_compressed_or_interrupted_answer_becomes_the_complete_file(
    server: Server, get: Get, case: str
) -> None:
    ranges, script = recoveries()[case]
    server.on("/trees", *script)
    assert get().path.read_bytes() == CONTENT
    assert [request.headers.get("range") for request in server.requests] == [None, *ranges]
    assert all(
        ("range" in request.headers) == ("if-range" in request.headers)
        for request in server.requests
    )
    assert server.requests[0].headers["accept-encoding"] == "gzip"


def test_interrupted_download_resumes_in_a_later_run(server: Server, get: Get) -> None:
    server.on("/trees", published(CONTENT, etag='"7"', cuts=[1_000]))
    failure_of(get, "cut the connection", attempts=1)
    sizes: list[int] = []
    assert get(progress=lambda size, _: sizes.append(size)).path.read_bytes() == CONTENT
    assert server.requests[1].headers["range"] == "bytes=1000-"
    assert sizes[0] > 1_000


BOMB = zipped(b"\0" * 50_000_000)
UNKNOWN = json.dumps({"message": "Unknown field: a. Write\nanother one."}).encode()
EXPLAINED = dataclasses.replace(zipped(UNKNOWN), status=400)
REASON = " (Unknown field: a, Write another one)"
HTML = Answer(b"<html>", status=403, type="text/html")
SORRY = "sent text/html where application/json was expected"
SMALL, MEGABYTE = {"max_bytes": 9_999}, {"max_bytes": 1_000_000}
# The answer, the options of the request, words of the error, and the number of requests.
REFUSALS: dict[str, tuple[Answer, dict[str, Any], str, int]] = {
    "busy": (Answer(status=504), {}, "HOST answered 504 Gateway Timeout, 3 times", 3),
    "long wait": (answers(b"", 429, Retry_After="3600"), {}, "asks to wait 3600 s", 1),
    "not there": (answers(UNKNOWN, 404), {}, "404 Not Found to http://HOST/trees" + REASON, 1),
    "explained": (EXPLAINED, {}, "400 Bad Request to http://HOST/trees" + REASON, 1),
    "unexplained": (HTML, {}, "403 Forbidden to http://HOST/trees;", 1),
    "kind": (dataclasses.replace(HTML, status=200), {"accept": JSON}, SORRY, 1),
    "packing": (answers(Content_Encoding="br"), {}, "unsupported Content-Encoding br", 1),
    "large": (FULL, SMALL, "more than the 9,999 bytes", 1),
    "large chunked": (dataclasses.replace(FULL, chunked=True), SMALL, "more than the 9,999", 1),
    "bomb": (BOMB, MEGABYTE, "more than the 1,000,000 bytes", 1),
    "bomb chunked": (dataclasses.replace(BOMB, chunked=True), MEGABYTE, "the 1,000,000 bytes", 1),
    "high ratio": (zipped(b" " * 2**28), {}, "unpacks to more than 250 times its size", 1),
    "circle": (answers(b"", 302, Location="/trees"), {}, "redirects too often", 6),
}


@pytest.mark.parametrize("case", REFUSALS)
def test_unusable_answer_is_an_error(
    server: Server, cache: Cache, get: Get, slept: list[float], case: str
) -> None:
    answer, what, words, times = REFUSALS[case]
    server.on("/trees", answer)
    error = failure_of(get, words.replace("HOST", f"127.0.0.1:{server.port}"), **what)
    assert len(server.requests) == times
    assert slept == [1.0, 2.0] * (case == "busy")
    assert isinstance(error, TooLargeError) == ("max_bytes" in what)
    if answer.status >= 400:
        assert isinstance(error, HttpError)
        assert error.status == answer.status
    assert leftovers(cache) == set()


@pytest.mark.parametrize("target", ["http://localhost:{port}/trees", "//localhost:{port}/trees"])
def test_redirect_to_another_host_or_nowhere_is_refused(
    server: Server, get: Get, target: str
) -> None:
    server.on("/trees", answers(b"", 301, Location=target.format(port=server.port)))
    failure_of(get, f"127.0.0.1:{server.port} redirects to localhost:{server.port}, which neither")
    assert len(server.requests) == 1
    server.on("/trees", answers(b"", 308, Location=""))
    failure_of(get, "127.0.0.1")


@pytest.mark.parametrize(
    ("source", "target", "token", "allowed"),
    [
        ("http://a.example/x", "https://a.example/y", None, True),
        ("http://a.example:80/x", "https://a.example:443/y", None, True),
        ("https://a.example/x", "http://a.example/y", None, False),
        ("http://a.example:8080/x", "https://a.example/y", None, False),
        ("https://a.example/x", "https://b.a.example/y", None, False),
        ("https://a.example/x", "https://a.example:444/y", None, False),
        ("https://a.example/x", "https://a.example:port/y", None, False),
        ("https://a.example/x", "file:///etc/hostname", None, False),
        # Of other hosts, only a listed one is allowed, and never with a token.
        ("https://a.example/x", "https://listed.example/y", None, True),
        ("https://a.example/x", "http://listed.example/y", None, False),
        ("https://a.example/x", "https://listed.example/y", AccessToken("word"), False),
        ("https://a.example/x", "https://c.example/y", None, False),
    ],
)
def test_redirect_needs_the_same_or_a_listed_host_and_never_a_weaker_scheme(
    source: str, target: str, token: AccessToken | None, *, allowed: bool
) -> None:
    spec = HttpSpec(hosts=frozenset({"listed.example"}), token=token)
    with nullcontext() if allowed else refused(SourceError, "a.example", " redirects to "):
        _check_redirect(source, target, spec)


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (Answer(CONTENT, drip=(1, 0.02)), "too slowly"),
        (Answer(CONTENT, drip=(1, 30.0)), "stopped"),
        (Answer(CONTENT, drip=(1, 0.02), slow_head=True), "too slowly"),
        (Answer(CONTENT, drip=(1, 30.0), slow_head=True), "did not answer in time"),
    ],
)
def test_slow_answer_is_retried_once_and_reported(
    server: Server, get: Get, answer: Answer, words: str
) -> None:
    server.on("/trees", answer)
    lines: list[str] = []
    failure_of(get, words, "2 times", timeout=(PATIENCE_S, 0.5), attempts=5, report=lines.append)
    assert len(server.requests) == 2
    (line,) = lines
    assert words in line
    assert line.endswith("attempt 2 of 2 in 1 s")


@pytest.mark.parametrize("slow_head", [False, True])
def test_request_ends_at_its_deadline(server: Server, get: Get, *, slow_head: bool) -> None:
    drip, remedy = ((1, 0.02), "ask for less") if slow_head else ((50, 0.02), "run it again to go")
    server.on("/trees", Answer(status=302, headers={"Location": "/slow"}))
    server.on("/slow", Answer(CONTENT, drip=drip, slow_head=slow_head, headers={"ETag": '"1"'}))
    words = ("in time, and 1 s are over", remedy, "--timeout")
    failure_of(get, *words, deadline_s=1.0, min_bytes_per_s=1.0)
    assert server.paths() == ["/trees", "/slow"]


def test_no_pause_goes_beyond_the_deadline(server: Server, get: Get) -> None:
    server.on("/trees", Answer(status=503, headers={"Retry-After": "60"}))
    failure_of(get, "answered 503", "30 s are over; ask for less", deadline_s=30.0)
    assert len(server.requests) == 1


def test_silent_or_absent_server_is_an_error() -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"http://127.0.0.1:{silent.getsockname()[1]}/"
        with refused(HttpError, "did not answer in time"):
            read_text(address, spec=HttpSpec(timeout=(PATIENCE_S, 0.1)))
    with refused(HttpError, "could not be reached"):
        read_text(address)


def test_file_that_fails_its_check_is_not_cached(server: Server, cache: Cache, get: Get) -> None:
    checks = Mock(side_effect=[SourceError("this is not JSON."), None])
    server.on("/trees", Answer(CONTENT[:-9]), Answer(CONTENT))
    failure_of(get, "this is not JSON.", check=checks)
    assert leftovers(cache) == set()
    assert get(check=checks).path.read_bytes() == CONTENT
    assert checks.call_count == 2


NO_ADDRESSES = {"http://127.0.0.1:port/x": "/x cannot be requested"} | dict.fromkeys(
    ("ftp://a.example/x", "file:///a", "a.example", "https://a:b@c.example/", "http://[::1", ""),
    "is not an address",
)


@pytest.mark.parametrize(("url", "words"), NO_ADDRESSES.items())
def test_address_that_is_not_http_is_refused(cache: Cache, url: str, words: str) -> None:
    with refused((InputError, SourceError), words):
        fetch(url, cache=cache)


def test_untrusted_certificate_is_not_retried() -> None:
    error = _connection_error(SSLError("certificate verify failed"), "https://a.example/x")
    assert isinstance(error, HttpError)
    assert_sentence(error, "a.example has no certificate that this machine trusts")


def test_unwritable_cache_is_an_error(
    server: Server, get: Get, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    with refused(InputError, "cache folder", "choose a folder"):
        fetch(server.url, cache=Cache(tmp_path / "file"))
    server.on("/trees", Answer(CONTENT))
    full = Mock(side_effect=OSError(28, "No space left on device"))
    monkeypatch.setattr(_http_cache.CacheEntry, "store", full)
    with refused(InputError, "No space left", "make room"):
        get()
    with refused(InputError, "attempts is 0", "at least 1"):
        get(attempts=0)


@pytest.mark.parametrize(
    ("validators", "header"),
    [({"etag": '"7"'}, "if-none-match"), ({"modified": DATE}, "if-modified-since")],
)
def test_second_run_requests_only_a_changed_file(
    server: Server, get: Get, validators: dict[str, Any], header: str
) -> None:
    server.on("/trees", published(CONTENT, **validators))
    first = get()
    second = get()
    assert second == dataclasses.replace(first, from_cache=True)
    assert server.requests[1].headers[header] in validators.values()
    newer = b'{"trees": [1]}'
    server.on("/trees", published(newer, etag='"8"'))
    third = get()
    assert third.path.read_bytes() == newer
    assert not third.from_cache
    assert first.path.read_bytes() == CONTENT  # for a reader of the first file


def test_file_without_validators_is_used_while_fresh(server: Server, get: Get) -> None:
    server.on("/trees", Answer(CONTENT))
    get()
    assert get().from_cache
    assert len(server.requests) == 1
    assert not get(fresh_s=0.0).from_cache
    assert len(server.requests) == 2


def test_superseded_file_is_deleted_later(
    server: Server, cache: Cache, get: Get, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_http_cache, "SUPERSEDED_S", -60.0)
    server.on("/trees", Answer(CONTENT), Answer(b"{}"))
    first, second = get(), get(fresh_s=0.0)
    assert not first.path.exists()
    assert second.path.exists()
    assert leftovers(cache) == {"json", "meta.json"}


def test_offline_uses_the_cache_only(server: Server, get: Get) -> None:
    server.on("/trees", published(CONTENT, etag='"7"'))
    first = get(params={"a": 1})
    again = get(params={"a": 1}, offline=True)
    assert again == dataclasses.replace(first, from_cache=True)
    error = failure_of(
        get, "is not in the cache", "without --offline", params={"a": 2}, offline=True
    )
    assert isinstance(error, NotCachedError)
    assert len(server.requests) == 1


def test_mirrors_share_cached_files(server: Server, cache: Cache, quick: HttpSpec) -> None:
    server.on("/trees", Answer(CONTENT))
    for host in (server.url, server.other_host):
        fetched = fetch(f"{host}/trees", cache=cache, spec=quick, identity="trees")
        assert fetched.url == f"{server.url}/trees"
    assert len(server.requests) == 1


def test_failing_server_leaves_the_cached_file(server: Server, get: Get) -> None:
    server.on("/trees", published(CONTENT, etag='"7"'), Answer(status=503))
    first = get()
    failure_of(get, "503", f"work offline with the copy of {first.fetched_at}")
    assert get(offline=True).path.read_bytes() == CONTENT


@pytest.mark.parametrize("how", ["body", "gone", "sidecar"])
def test_damaged_cached_file_is_fetched_again(
    server: Server, cache: Cache, get: Get, how: str
) -> None:
    server.on("/trees", published(CONTENT, etag='"7"'))
    path = get().path
    if how == "body":
        path.write_bytes(CONTENT.replace(b"17", b"71"))
    elif how == "gone":
        path.unlink()
    else:
        (sidecar,) = cache.folder.glob("*.meta.json")
        sidecar.write_text('{"file": "')
    failure_of(get, "is damaged in the cache", offline=True)
    assert get().path.read_bytes() == CONTENT
    assert "if-none-match" not in server.requests[1].headers
    assert get(offline=True).path.read_bytes() == CONTENT


def test_unchanged_file_drops_the_part(server: Server, get: Get) -> None:
    # A newer edition was cut, then the former one came back.
    plain = published(CONTENT, etag='"7"')
    server.on("/trees", plain, published(CONTENT * 2, etag='"8"', cuts=[10]), plain)
    get()
    failure_of(get, "cut", attempts=1)
    assert get().from_cache
    get()
    assert "range" not in server.requests[3].headers


def fetch_and_check(url: str, folder: Path, times: int) -> None:
    """Fetch a file that changes all the time; every copy must be a complete version."""
    for _ in range(times):
        fetched = fetch(url, cache=Cache(folder), spec=HttpSpec(fresh_s=0.0))
        body = fetched.path.read_bytes()
        assert body == body[:1] * 300_000, "a half-written file"


def test_two_processes_share_a_cache(server: Server, tmp_path: Path) -> None:
    def edition(_: Request) -> Answer:
        letter = b"%d" % (len(server.requests) % 10)
        return Answer(letter * 300_000, type="text/plain", drip=(100_000, 0.001))

    server.on("/trees", edition)
    context = multiprocessing.get_context("spawn")
    arguments = (f"{server.url}/trees", tmp_path / "cache", 10)
    workers = [context.Process(target=fetch_and_check, args=arguments) for _ in range(2)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join(60)
    assert [worker.exitcode for worker in workers] == [0, 0]
    assert len(server.requests) == 20
    assert not list((tmp_path / "cache").glob("*.part"))
    assert not list((tmp_path / "cache").glob("*.tmp*"))
