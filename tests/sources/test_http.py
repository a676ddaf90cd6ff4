"""The network, played by a server on the loopback that fails in every way we know of."""

from __future__ import annotations

import dataclasses
import email.utils
import gzip
import json
import multiprocessing
import socket
import time
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any

import pytest
from sentences import assert_sentence, refused
from servers import Answer, published, zipped

from semsig_gis import __version__
from semsig_gis.core.errors import InputError, SourceError
from semsig_gis.sources.http import cache as _http_cache
from semsig_gis.sources.http.cache import Cache
from semsig_gis.sources.http.fetch import (
    HttpError,
    HttpSpec,
    NotCachedError,
    TooLargeError,
    fetch,
    read_text,
)

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from servers import Seen, Server

    from semsig_gis.sources.http.cache import Fetched

    Get = Callable[..., Fetched]

CONTENT = json.dumps({"trees": list(range(5_000))}).encode()
JSON = ("application/json",)


@pytest.fixture
def slept() -> list[float]:
    return []


@pytest.fixture
def spec(slept: list[float]) -> HttpSpec:
    return HttpSpec(timeout=(2.0, 2.0), attempts=3, backoff_s=1.0, sleep=slept.append)


@pytest.fixture
def get(server: Server, cache: Cache, spec: HttpSpec) -> Get:
    """Fetch a path of the server; keywords change the specification or are those of `fetch`."""
    fields = {field.name for field in dataclasses.fields(HttpSpec)}

    def call(path: str = "/trees", **what: Any) -> Fetched:  # noqa: ANN401 - see above
        own = {name: what.pop(name) for name in fields & what.keys()}
        return fetch(server.url + path, cache=cache, spec=dataclasses.replace(spec, **own), **what)

    return call


def failure_of(call: Callable[..., object], *words: str, **what: Any) -> SourceError:  # noqa: ANN401
    """Check that a call ends in one plain sentence."""
    with pytest.raises(SourceError) as caught:
        call(**what)
    assert_sentence(caught.value, *words)
    return caught.value


def leftovers(cache: Cache) -> set[str]:
    """Return the suffixes of what the cache holds beside locks."""
    names = (path.name for path in cache.folder.iterdir())
    return {name.partition(".")[2] for name in names} - {"lock"}


# --- What works ---------------------------------------------------------------------------------


def test_a_file_arrives_whole_and_described(server: Server, get: Get) -> None:
    server.on("/trees", Answer(CONTENT, type="application/json; charset=utf-8"))
    seen: list[tuple[int, int]] = []
    fetched = get(
        params={"limit": -1, "where": "a=1"},
        accept=JSON,
        progress=lambda *step: seen.append(step),
    )
    assert fetched.path.read_bytes() == CONTENT
    assert fetched.path.suffix == ".json"
    assert fetched.bytes == len(CONTENT)
    assert fetched.sha256 == _http_cache.checksum(fetched.path)
    assert fetched.url == f"{server.url}/trees?limit=-1&where=a%3D1"
    assert fetched.content_type == "application/json"
    assert not fetched.from_cache
    assert datetime.fromisoformat(fetched.fetched_at).tzinfo is not None
    assert seen[-1] == (len(CONTENT), len(CONTENT))
    assert seen == sorted(seen)
    (asked,) = server.seen
    assert asked.query == {"limit": "-1", "where": "a=1"}
    assert asked.headers["user-agent"].startswith(f"semsig_gis/{__version__} (")
    assert get(suffix=".txt").path.suffix == ".txt"


def test_no_password_is_taken_from_the_users_files(
    server: Server,
    get: Get,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    netrc = tmp_path / "netrc"
    netrc.write_text("machine 127.0.0.1 login me password secret\n")
    netrc.chmod(0o600)
    monkeypatch.setenv("NETRC", str(netrc))
    server.on("/trees", Answer(CONTENT))
    get()
    assert "authorization" not in server.seen[0].headers


@pytest.mark.parametrize("chunked", [False, True])
def test_a_packed_body_is_unpacked(server: Server, get: Get, *, chunked: bool) -> None:
    server.on("/trees", dataclasses.replace(zipped(CONTENT), chunked=chunked))
    assert get().path.read_bytes() == CONTENT
    assert server.seen[0].headers["accept-encoding"] == "gzip"


def test_a_packed_body_may_have_several_members(server: Server, get: Get) -> None:
    body = gzip.compress(CONTENT[:9]) + gzip.compress(CONTENT[9:])
    server.on("/trees", Answer(body, headers={"Content-Encoding": "gzip"}))
    assert get().path.read_bytes() == CONTENT


def test_a_form_is_posted(server: Server, get: Get) -> None:
    server.on("/trees", lambda seen: Answer(json.dumps(seen.form).encode()))
    assert json.loads(get(data={"data": "node;out é;"}).path.read_bytes()) == {
        "data": "node;out é;"
    }
    assert server.seen[0].method == "POST"
    assert json.loads(get(data={"data": "way;out;"}).path.read_bytes()) == {"data": "way;out;"}


def test_a_redirect_within_the_host_is_followed(server: Server, get: Get) -> None:
    server.on("/trees", Answer(status=302, headers={"Location": "/moved/trees?x=1"}))
    server.on("/moved/trees", Answer(CONTENT))
    fetched = get(params={"y": 2})
    assert fetched.path.read_bytes() == CONTENT
    assert fetched.url == f"{server.url}/moved/trees?x=1"


def test_a_short_text_is_read(server: Server, spec: HttpSpec) -> None:
    server.on("/status", Answer(b"2 slots available now.\n", type="text/plain"))
    server.on("/long", Answer(b"x" * 200_000))
    assert read_text(f"{server.url}/status", spec=spec) == "2 slots available now.\n"
    assert len(read_text(f"{server.url}/long", spec=spec)) == 2**16


# --- What fails and then works ------------------------------------------------------------------


@pytest.mark.parametrize("status", [429, 500, 502, 503, 504])
def test_a_passing_failure_is_waited_out(
    server: Server, get: Get, slept: list[float], status: int
) -> None:
    server.on("/trees", Answer(status=status), Answer(status=status), Answer(CONTENT))
    assert get().path.read_bytes() == CONTENT
    assert slept == [1.0, 2.0]


def test_a_server_says_how_long_to_wait(server: Server, get: Get, slept: list[float]) -> None:
    date = email.utils.format_datetime(datetime.now(UTC) + timedelta(seconds=40), usegmt=True)
    past = "Thu, 01 Jan 2015 00:00:00 GMT"
    for texts in (("17", "soon"), (date, past)):
        busy = [Answer(status=503, headers={"Retry-After": text}) for text in texts]
        server.on("/trees", *busy, Answer(CONTENT))
        get(params={"say": texts[0]})
    assert slept[:2] == [17.0, 2.0]  # what means nothing is ignored
    assert 35 < slept[2] <= 40
    assert slept[3] == 0


@pytest.mark.parametrize(
    "validators", [{"etag": '"7"'}, {"modified": "Thu, 01 Jan 2026 00:00:00 GMT"}]
)
def test_a_cut_download_goes_on_where_it_was_cut(
    server: Server, get: Get, validators: dict[str, Any]
) -> None:
    server.on("/trees", published(CONTENT, cuts=[1_000, 2_000], **validators))
    assert get().path.read_bytes() == CONTENT
    ranges = [seen.headers.get("range") for seen in server.seen]
    assert ranges == [None, "bytes=1000-", "bytes=3000-"]
    assert server.seen[1].headers["if-range"] in validators.values()


def test_a_cut_download_of_a_packed_body_goes_on(server: Server, get: Get) -> None:
    packed = gzip.compress(CONTENT)
    plain = published(packed, etag='"7"', cuts=[500])

    def script(seen: Seen) -> Answer:
        answer = plain(seen)
        if answer.status == 206:  # which need not say again what the first answer said
            return answer
        return dataclasses.replace(answer, headers={**answer.headers, "Content-Encoding": "gzip"})

    server.on("/trees", script)
    assert get().path.read_bytes() == CONTENT
    assert server.seen[1].headers["range"] == "bytes=500-"


def test_a_cut_download_goes_on_in_a_later_run(server: Server, get: Get) -> None:
    server.on("/trees", published(CONTENT, etag='"7"', cuts=[1_000]))
    failure_of(get, "cut the connection", attempts=1)
    seen: list[int] = []
    assert get(progress=lambda done, _: seen.append(done)).path.read_bytes() == CONTENT
    assert server.seen[1].headers["range"] == "bytes=1000-"
    assert seen[0] > 1_000


@pytest.mark.parametrize(
    "what", [{"etag": '"7"', "ranges": False}, {}, {"etag": 'W/"7"'}], ids=["ranges", "tag", "weak"]
)
def test_a_cut_download_starts_again_where_it_cannot_go_on(
    server: Server, get: Get, what: dict[str, Any]
) -> None:
    server.on("/trees", published(CONTENT, cuts=[1_000], **what))
    assert get().path.read_bytes() == CONTENT
    assert len(server.seen) == 2


@pytest.mark.parametrize("chunked", [False, True])
def test_a_cut_is_noticed_however_the_length_is_said(
    server: Server, get: Get, *, chunked: bool
) -> None:
    server.on("/trees", Answer(CONTENT, cut=70_000 // 3, chunked=chunked), Answer(CONTENT))
    assert get().path.read_bytes() == CONTENT
    assert len(server.seen) == 2


def test_a_file_that_changed_meanwhile_starts_again(server: Server, get: Get) -> None:
    newer = b'{"trees": []}'
    server.on("/trees", published(CONTENT, etag='"7"', cuts=[1_000]), published(newer, etag='"8"'))
    assert get().path.read_bytes() == newer
    assert server.seen[1].headers["if-range"] == '"7"'


@pytest.mark.parametrize(
    "wrong",
    [
        Answer(CONTENT[5:], status=206, headers={"Content-Range": "bytes 5-9/10"}),
        Answer(CONTENT[9:], status=206, headers={"Content-Range": "bytes 1000-", "ETag": '"8"'}),
        Answer(status=416),
    ],
    ids=["elsewhere", "other edition", "beyond"],
)
def test_a_wrong_part_is_not_glued_on(server: Server, get: Get, wrong: Answer) -> None:
    server.on("/trees", published(CONTENT, etag='"7"', cuts=[1_000]), wrong, Answer(CONTENT))
    assert get().path.read_bytes() == CONTENT
    assert "range" not in server.seen[2].headers


def test_a_part_that_nobody_asked_for_is_not_the_file(server: Server, get: Get) -> None:
    server.on("/trees", Answer(CONTENT[:50], status=206), Answer(CONTENT))
    assert get().path.read_bytes() == CONTENT


@pytest.mark.parametrize("damage", [lambda body: body[:-20], lambda body: b"\0" + body[1:]])
def test_a_damaged_gzip_body_is_fetched_again(
    server: Server, get: Get, damage: Callable[[bytes], bytes]
) -> None:
    bad = Answer(damage(gzip.compress(CONTENT)), headers={"Content-Encoding": "gzip"})
    server.on("/trees", bad, zipped(CONTENT))
    assert get().path.read_bytes() == CONTENT


# --- What ends in a sentence --------------------------------------------------------------------


def test_a_server_that_stays_busy_is_given_up(server: Server, get: Get, slept: list[float]) -> None:
    server.on("/trees", Answer(status=504))
    error = failure_of(get, f"127.0.0.1:{server.port} answered 504 Gateway Timeout, 3 times")
    assert isinstance(error, HttpError)
    assert error.status == 504
    assert slept == [1.0, 2.0]


def test_a_server_that_asks_to_wait_too_long_is_not_waited_for(
    server: Server, get: Get, slept: list[float]
) -> None:
    server.on("/trees", Answer(status=429, headers={"Retry-After": "3600"}))
    failure_of(get, "429 Too Many Requests", "asks to wait 3600 s")
    assert slept == []
    assert len(server.seen) == 1


def test_something_that_is_not_there_is_not_asked_for_twice(server: Server, get: Get) -> None:
    error = failure_of(get, "404 Not Found", "/trees (there is no such thing)")
    assert isinstance(error, HttpError)
    assert error.status == 404
    assert len(server.seen) == 1


def test_what_a_server_says_of_an_error_is_told_in_short(server: Server, get: Get) -> None:
    said = json.dumps({"message": "Unknown field: a. Write\nanother one."}).encode()
    server.on("/trees", dataclasses.replace(zipped(said), status=400))
    failure_of(get, "400 Bad Request", "(Unknown field: a, Write another one)")
    server.on("/trees", Answer(b"<html>", status=403, type="text/html"))
    failure_of(get, "403 Forbidden to", "/trees;")


def test_another_kind_of_content_is_refused(server: Server, cache: Cache, get: Get) -> None:
    server.on("/trees", Answer(b"<html>Sorry</html>", type="text/html"))
    failure_of(get, "sent text/html where application/json was expected", accept=JSON)
    assert leftovers(cache) == set()


@pytest.mark.parametrize(
    "target",
    ["http://localhost:{port}/trees", "http://127.0.0.1:1/trees", "//localhost:{port}/trees"],
)
def test_a_redirect_to_another_host_is_refused(server: Server, get: Get, target: str) -> None:
    location = target.format(port=server.port)
    server.on("/trees", Answer(status=301, headers={"Location": location}))
    failure_of(get, f"127.0.0.1:{server.port} redirects to {location.split('/')[2]}, which neither")
    assert len(server.seen) == 1


@pytest.mark.parametrize("target", ["file:///etc/hostname", "http://127.0.0.1:port/", ""])
def test_a_redirect_to_nowhere_is_refused(server: Server, get: Get, target: str) -> None:
    server.on("/trees", Answer(status=308, headers={"Location": target}))
    failure_of(get, f"127.0.0.1:{server.port}")


@pytest.mark.parametrize(
    ("source", "target", "allowed"),
    [
        ("http://a.example/x", "https://a.example/y", True),
        ("http://a.example:80/x", "https://a.example:443/y", True),
        ("https://a.example/x", "http://a.example/y", False),
        ("http://a.example:8080/x", "https://a.example/y", False),
        ("https://a.example/x", "https://b.a.example/y", False),
        ("https://a.example/x", "https://a.example:444/y", False),
    ],
)
def test_the_only_way_to_another_scheme_is_the_safer_one(
    source: str, target: str, *, allowed: bool
) -> None:
    from semsig_gis.sources.http.fetch import _require_same_host

    if allowed:
        _require_same_host(source, target)
    else:
        failure_of(lambda: _require_same_host(source, target), "redirects to")


def test_redirects_in_circles_end(server: Server, get: Get) -> None:
    server.on("/trees", Answer(status=302, headers={"Location": "/trees"}))
    failure_of(get, "redirects too often")
    assert len(server.seen) < 10


@pytest.mark.parametrize(("drip", "words"), [((1, 0.02), "too slowly"), ((1, 30.0), "stopped")])
def test_a_slow_drip_is_not_waited_for(
    server: Server, get: Get, drip: tuple[int, float], words: str
) -> None:
    server.on("/trees", Answer(CONTENT, drip=drip))
    start = time.monotonic()
    failure_of(get, words, timeout=(1.0, 0.2), attempts=2)
    assert time.monotonic() - start < 5
    assert len(server.seen) == 2


def test_a_server_that_says_nothing_is_not_waited_for() -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"http://127.0.0.1:{silent.getsockname()[1]}/"
        with pytest.raises(HttpError) as caught:
            read_text(address, spec=HttpSpec(timeout=(1.0, 0.1)))
    assert_sentence(caught.value, "did not answer in time")
    with refused(HttpError, "could not be reached"):
        read_text(address)


@pytest.mark.parametrize("chunked", [False, True])
def test_a_gzip_bomb_does_not_go_off(
    server: Server, cache: Cache, get: Get, *, chunked: bool
) -> None:
    bomb = zipped(b"\0" * 50_000_000)
    assert len(bomb.body) < 100_000
    server.on("/trees", dataclasses.replace(bomb, chunked=chunked))
    error = failure_of(get, "more than the 1,000,000 bytes", max_bytes=1_000_000)
    assert isinstance(error, TooLargeError)
    assert leftovers(cache) == set()


@pytest.mark.parametrize("chunked", [False, True])
def test_a_body_that_is_too_large_is_refused(
    server: Server, cache: Cache, get: Get, *, chunked: bool
) -> None:
    server.on("/trees", Answer(CONTENT, chunked=chunked))
    failure_of(get, "more than the 9,999 bytes", max_bytes=9_999)
    assert leftovers(cache) == set()


def test_a_packing_that_was_not_asked_for_is_refused(server: Server, get: Get) -> None:
    server.on("/trees", Answer(CONTENT, headers={"Content-Encoding": "br"}))
    failure_of(get, "unsupported Content-Encoding br")


def test_what_the_caller_does_not_want_is_not_kept(server: Server, cache: Cache, get: Get) -> None:
    def check(path: Path) -> None:
        try:
            json.loads(path.read_bytes())
        except ValueError as error:
            msg = "this is not JSON."
            raise SourceError(msg) from error

    server.on("/trees", Answer(CONTENT[:-9]), Answer(CONTENT))
    failure_of(get, "this is not JSON.", check=check)
    assert leftovers(cache) == set()
    assert get(check=check).path.read_bytes() == CONTENT


@pytest.mark.parametrize(
    "url",
    [
        "ftp://a.example/x",
        "file:///etc/hostname",
        "a.example",
        "https://me:word@a.example/",
        "http://[::1",
        "",
    ],
)
def test_only_http_addresses_are_taken(cache: Cache, url: str) -> None:
    with refused(InputError, "is not an address"):
        fetch(url, cache=cache)


def test_an_address_that_leads_nowhere_is_said(cache: Cache) -> None:
    failure_of(
        lambda: fetch("http://127.0.0.1:port/x", cache=cache), "127.0.0.1:port", "correct it"
    )


def test_a_certificate_that_is_not_trusted_is_not_tried_again() -> None:
    from requests.exceptions import SSLError

    from semsig_gis.sources.http.fetch import _failure

    error = _failure(SSLError("certificate verify failed"), "https://a.example/x")
    assert isinstance(error, HttpError)
    assert_sentence(error, "a.example has no certificate that this machine trusts")


def test_a_specification_takes_at_least_one_attempt() -> None:
    with pytest.raises(InputError, match="at least 1"):
        HttpSpec(attempts=0)


def test_a_cache_that_cannot_be_written_is_said(server: Server, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with refused(InputError, "cache folder", "choose a folder"):
        fetch(server.url, cache=Cache(tmp_path / "file"))


def test_a_full_disk_is_said(server: Server, get: Get, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    server.on("/trees", Answer(CONTENT))
    monkeypatch.setattr(_http_cache.Entry, "store", full)
    with refused(InputError, "No space left", "make room"):
        get()


# --- The second run -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("validators", "header"),
    [
        ({"etag": '"7"'}, "if-none-match"),
        ({"modified": "Thu, 01 Jan 2026 00:00:00 GMT"}, "if-modified-since"),
    ],
)
def test_a_second_run_asks_whether_the_file_changed(
    server: Server, get: Get, validators: dict[str, Any], header: str
) -> None:
    server.on("/trees", published(CONTENT, **validators))
    first = get()
    second = get()
    assert second == dataclasses.replace(first, from_cache=True)
    assert server.seen[1].headers[header] in validators.values()
    newer = b'{"trees": [1]}'
    server.on("/trees", published(newer, etag='"8"'))
    third = get()
    assert third.path.read_bytes() == newer
    assert not third.from_cache
    assert first.path.read_bytes() == CONTENT  # for who was given its path just now


def test_a_copy_that_nobody_can_confirm_is_used_for_a_while(server: Server, get: Get) -> None:
    server.on("/trees", Answer(CONTENT))
    get()
    assert get().from_cache
    assert len(server.seen) == 1
    assert not get(fresh_s=0.0).from_cache
    assert len(server.seen) == 2


def test_a_superseded_copy_goes_when_nobody_has_used_it_for_long(
    server: Server, cache: Cache, get: Get, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_http_cache, "KEPT_S", -60.0)
    server.on("/trees", Answer(CONTENT), Answer(b"{}"))
    first, second = get(), get(fresh_s=0.0)
    assert not first.path.exists()
    assert second.path.exists()
    assert leftovers(cache) == {"json", "meta.json"}


def test_offline_asks_nobody(server: Server, get: Get) -> None:
    server.on("/trees", published(CONTENT, etag='"7"'))
    first = get(params={"a": 1})
    again = get(params={"a": 1}, offline=True)
    assert again == dataclasses.replace(first, from_cache=True)
    error = failure_of(
        get, "is not in the cache", "without --offline", params={"a": 2}, offline=True
    )
    assert isinstance(error, NotCachedError)
    assert len(server.seen) == 1


def test_mirrors_share_what_they_sent(server: Server, cache: Cache, spec: HttpSpec) -> None:
    server.on("/trees", Answer(CONTENT))
    for host in (server.url, server.other_host):
        fetched = fetch(f"{host}/trees", cache=cache, spec=spec, identity="trees")
        assert fetched.url == f"{server.url}/trees"
    assert len(server.seen) == 1


def test_a_server_that_fails_leaves_the_copy_there_was(server: Server, get: Get) -> None:
    server.on("/trees", published(CONTENT, etag='"7"'), Answer(status=503))
    first = get()
    failure_of(get, "503", f"work offline with the copy of {first.fetched_at}")
    assert get(offline=True).path.read_bytes() == CONTENT


@pytest.mark.parametrize("how", ["body", "gone", "sidecar"])
def test_a_damaged_copy_is_noticed_and_fetched_again(
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
    assert "if-none-match" not in server.seen[1].headers
    assert get(offline=True).path.read_bytes() == CONTENT


def test_an_unchanged_file_needs_no_part(server: Server, get: Get) -> None:
    # A newer edition was cut, then the former one came back.
    plain = published(CONTENT, etag='"7"')
    server.on("/trees", plain, published(CONTENT * 2, etag='"8"', cuts=[10]), plain)
    get()
    failure_of(get, "cut", attempts=1)
    assert get().from_cache
    get()
    assert "range" not in server.seen[3].headers


# --- Several processes --------------------------------------------------------------------------


def fetch_and_check(url: str, folder: Path, times: int) -> None:
    """Fetch a file that changes all the time; every copy must be one of its editions, whole."""
    for _ in range(times):
        fetched = fetch(url, cache=Cache(folder), spec=HttpSpec(fresh_s=0.0))
        body = fetched.path.read_bytes()
        assert body == body[:1] * 300_000, "a half-written file"


def test_two_processes_share_a_cache(server: Server, tmp_path: Path) -> None:
    def edition(_: Seen) -> Answer:
        letter = b"%d" % (len(server.seen) % 10)
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
    assert len(server.seen) == 20
    assert not list((tmp_path / "cache").glob("*.part"))
    assert not list((tmp_path / "cache").glob("*.tmp*"))
