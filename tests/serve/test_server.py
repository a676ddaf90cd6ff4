from __future__ import annotations

import json
import re
import socket
import threading
from typing import TYPE_CHECKING, Any, cast

import pytest
from machine import PATIENCE_S
from sentences import refused
from workbench import serving

from semsig_gis.core import InputError, share_rows
from semsig_gis.serve import open_listener
from semsig_gis.serve import server as server_module

if TYPE_CHECKING:
    from starlette.requests import Request
    from workbench import Page

    from semsig_gis.serve import Workbench


@pytest.mark.parametrize("path", ["/", "/api/city", "/api/answer", "/static/x", "/?token=wrong"])
@pytest.mark.parametrize("token", ["", "wrong", "the-token-of-the-testt"])
def test_request_without_token_is_refused(page: Page, path: str, token: str) -> None:
    page.refused(path, None, "token", code=403, X_Semsig_Token=token)


@pytest.mark.parametrize(
    ("headers", "code"),
    [
        ({"Host": "evil.example"}, 421),
        ({"Host": "127.0.0.1"}, 421),
        ({"Host": "127.0.0.1:1"}, 421),
        ({"Origin": "http://evil.example"}, 403),
        ({"Origin": "null"}, 403),
        ({"Origin": "https://127.0.0.1:{port}"}, 403),
        ({"Sec_Fetch_Site": "cross-site"}, 403),
        ({"Sec_Fetch_Site": "same-site"}, 403),
    ],
)
@pytest.mark.parametrize("path", ["/?token=the-token-of-the-tests", "/api/city"])
def test_request_of_another_site_is_refused(
    page: Page, path: str, headers: dict[str, str], code: int
) -> None:
    own_headers = {name: value.format(port=page.port) for name, value in headers.items()}
    page.refused(path, code=code, **own_headers)


def test_request_of_the_own_page_is_answered(page: Page) -> None:
    for host in ("127.0.0.1", "localhost"):
        here = f"{host}:{page.port}"
        own = {"Host": here, "Origin": f"http://{here}", "Sec_Fetch_Site": "same-origin"}
        assert page.ask("/api/city", **own)["name"] == "town"


def test_page_allows_only_its_own_scripts(page: Page, map_files: None) -> None:  # noqa: ARG001
    nonces = set()
    for _ in range(2):
        code, headers, content = page.send(f"/?token={page.token}", X_Semsig_Token="")
        html, rules = content.decode(), headers["content-security-policy"]
        assert code == 200
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"
        nonce = re.search(r"script-src 'nonce-([\w-]{22})'", rules)
        assert nonce
        nonces.add(nonce[1])
        assert "default-src 'none'" in rules
        assert "unsafe" not in rules
        elements = re.findall("<(?:script|style)[^>]*>", html)
        assert elements
        assert all(f'nonce="{nonce[1]}"' in element for element in elements)
        assert not re.search(r"<(link|script)\b[^>]*\b(href|src)=\"(?!data:)", html)
        assert page.token not in html
        assert "town" not in html
    assert len(nonces) == 2


@pytest.mark.parametrize(
    ("path", "body", "code", "word"),
    [
        ("/api/answer", b"{", 422, "JSON"),
        ("/api/answer", b"[]", 422, "mapping"),
        ("/api/answer", b'{"views": NaN}', 422, "JSON"),
        ("/api/answer", b"[" * 100_000, 422, "JSON"),
        ("/api/nothing", b"{}", 404, "nothing at POST /api/nothing"),
        ("/api/city", b"{}", 405, "nothing at POST /api/city"),
        ("/api/export?format=exe", b'{"views": []}', 422, "exe"),
    ],
)
def test_invalid_request_is_refused(
    page: Page, path: str, body: bytes, code: int, word: str
) -> None:
    page.refused(path, body, word, code=code)


@pytest.mark.parametrize("with_length", [True, False])
def test_too_long_body_is_refused(page: Page, with_length: bool) -> None:  # noqa: FBT001
    with socket.create_connection(("127.0.0.1", page.port)) as line:
        size = "Content-Length: 104857600" if with_length else "Transfer-Encoding: chunked"
        line.sendall(
            f"POST /api/photo?name=big.jpg HTTP/1.1\r\nHost: 127.0.0.1:{page.port}\r\n"
            f"X-Semsig-Token: {page.token}\r\n{size}\r\n\r\n".encode()
        )
        piece = b"x" * 2**20
        for _ in range(0 if with_length else 26):
            line.sendall(b"100000\r\n" + piece + b"\r\n")
        answer = line.recv(65536)
        while b"}" not in answer:
            answer += line.recv(65536)
    assert answer.startswith(b"HTTP/1.1 413")
    error = json.loads(answer.partition(b"\r\n\r\n")[2])["error"]
    assert error == "the file is too large; give one of at most 25 MB."


def test_used_port_is_refused() -> None:
    with open_listener(0) as listener, refused(InputError, "--port"):
        open_listener(listener.getsockname()[1])


OTHER = 2


def test_newer_question_cancels_older_ones_of_the_page(monkeypatch: pytest.MonkeyPatch) -> None:
    begun, go_on, answered = threading.Event(), threading.Event(), list[int]()
    arrived, read = threading.Semaphore(0), server_module._json

    class Slow:
        def answer(self, body: dict[str, int]) -> dict[str, int]:
            answered.append(body["number"])
            begun.set()
            assert go_on.wait(PATIENCE_S)
            share_rows(len, 1)  # like all slow steps
            return body

    async def reading(request: Request) -> Any:  # noqa: ANN401 - any JSON
        body = await read(request)
        arrived.release()
        return body

    monkeypatch.setattr(server_module, "_json", reading)
    codes: dict[int, int] = {}

    def ask(number: int) -> None:
        body = {"number": number, "page": "other" if number == OTHER else "own"}
        codes[number] = page.send("/api/answer", json.dumps(body).encode())[0]

    with serving(cast("Workbench", Slow())) as page:
        threads = [threading.Thread(target=ask, args=[number]) for number in range(5)]
        for number, thread in enumerate(threads):
            thread.start()
            assert arrived.acquire(timeout=PATIENCE_S)
            assert number or begun.wait(PATIENCE_S)
        go_on.set()
        for thread in threads:
            thread.join()
    assert codes == {0: 409, 1: 409, OTHER: 200, 3: 409, 4: 200}
    assert answered == [0, OTHER, 4]
