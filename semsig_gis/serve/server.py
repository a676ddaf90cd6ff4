"""The server of the workbench: one page and what it asks, on this machine alone.

A page of another site may send requests to this machine, and may give its own name the address of
this machine (DNS rebinding). So a request must name this server as its host, come from its own page
if it says from where, and carry the token that the address of that page holds.
"""

from __future__ import annotations

import functools
import hmac
import secrets
import socket
from collections import Counter
from typing import TYPE_CHECKING, Any

import anyio.to_thread
import uvicorn
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.responses import HTMLResponse, JSONResponse, Response
from starlette.routing import Route

from semsig_gis.core import InputError, SemsigError, WorkCancelledError, cancellable
from semsig_gis.serve.page import policy, workbench_page
from semsig_gis.serve.streets import city_ground
from semsig_gis.serve.workbench import FORMATS, MOST_UPLOAD
from semsig_gis.storage import parse_json

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from starlette.requests import Request
    from starlette.types import ASGIApp, Receive, Scope, Send

    from semsig_gis.serve.workbench import Workbench

HOST = "127.0.0.1"
TOKEN_HEADER = "x-semsig-token"  # noqa: S105 - the name of a header
HEADERS = {
    "Cache-Control": "no-store",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}
PATIENCE_S = 2  # for answers that are under way when the server ends


class _Guard:
    """Lets through what comes from the page of this server."""

    def __init__(self, app: ASGIApp, *, port: int, token: str) -> None:
        self.app, self.token = app, token.encode()
        self.hosts = {f"{name}:{port}".encode() for name in (HOST, "localhost")}
        self.origins = {b"http://" + host for host in self.hosts}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        fault = self.fault(scope)
        if fault is not None:
            code, text = fault
            await JSONResponse({"error": text}, code, headers=HEADERS)(scope, receive, send)
            return
        await self.app(scope, receive, send)

    def fault(self, scope: Scope) -> tuple[int, str] | None:
        """Return the code and the sentence with which a request is refused."""
        headers: dict[bytes, bytes] = dict(scope["headers"])
        if headers.get(b"host") not in self.hosts:
            return 421, "this server answers only at its own address; open the one it printed."
        origin, site = headers.get(b"origin"), headers.get(b"sec-fetch-site", b"none")
        own = origin is None or origin in self.origins
        if not own or site not in {b"none", b"same-origin"}:
            return 403, "the request comes from the page of another site, which may not ask."
        given = headers.get(TOKEN_HEADER.encode(), b"")
        if scope["path"] == "/":
            given = _query_token(scope["query_string"])
        if not hmac.compare_digest(given, self.token):
            return 403, "the token is missing or wrong; open the address that semsig serve printed."
        return None


def _query_token(query: bytes) -> bytes:
    pairs = (pair.partition(b"=") for pair in query.split(b"&"))
    return next((value for name, _, value in pairs if name == b"token"), b"")


class _Api:
    """What the page asks, one thing after the other in a thread of its own."""

    def __init__(self, bench: Workbench) -> None:
        self.bench = bench
        self.alone = anyio.CapacityLimiter(1)
        self.asked = Counter[str]()  # by page

    async def page(self, request: Request) -> Response:  # noqa: ARG002 - as routes are called
        nonce = secrets.token_urlsafe(16)
        headers = HEADERS | {"Content-Security-Policy": policy(nonce)}
        return HTMLResponse(workbench_page(nonce), headers=headers)

    async def city(self, request: Request) -> Response:  # noqa: ARG002
        return await self._told(self.bench.about)

    async def ground(self, request: Request) -> Response:  # noqa: ARG002
        bench = self.bench
        return await self._told(functools.partial(city_ground, bench.database, bench.store))

    async def photo(self, request: Request) -> Response:
        name = request.query_params.get("name", "the picture")[:200]
        content = await _body(request)
        return await self._told(functools.partial(self.bench.photo, content, name))

    async def boxes(self, request: Request) -> Response:
        return await self._told(functools.partial(self.bench.boxes, await _json(request)))

    async def answer(self, request: Request) -> Response:
        told = await _json(request)
        page = str(told.get("page"))
        number = self.asked[page] = self.asked[page] + 1

        def answer() -> dict[str, Any]:
            with cancellable(lambda: number == self.asked[page]):
                return self.bench.answer(told)

        return await self._told(answer)

    async def suggest(self, request: Request) -> Response:
        return await self._told(functools.partial(self.bench.suggest, await _json(request)))

    async def cell(self, request: Request) -> Response:
        return await self._told(functools.partial(self.bench.cell, await _json(request)))

    async def simulate(self, request: Request) -> Response:
        return await self._told(functools.partial(self.bench.simulate, await _json(request)))

    async def export(self, request: Request) -> Response:
        suffix = request.query_params.get("format", "")
        told = await _json(request)
        make = functools.partial(self.bench.export, told, suffix)
        content = await anyio.to_thread.run_sync(make, limiter=self.alone)
        headers = HEADERS | {"Content-Disposition": f'attachment; filename="answer.{suffix}"'}
        return Response(content, media_type=FORMATS[suffix], headers=headers)

    async def _told(self, work: Callable[[], Any]) -> Response:
        """Return what a function tells, as JSON."""
        value = await anyio.to_thread.run_sync(work, limiter=self.alone)
        return JSONResponse(value, headers=HEADERS)


async def _body(request: Request) -> bytes:
    """Return the body of a request, refused as soon as it is too long."""
    told = request.headers.get("content-length", "0")
    parts, size = [], int(told) if told.isdecimal() else 0
    if size <= MOST_UPLOAD:
        size = 0
        async for part in request.stream():
            size += len(part)
            if size > MOST_UPLOAD:
                break
            parts.append(part)
    if size > MOST_UPLOAD:
        most = MOST_UPLOAD // 2**20
        raise HTTPException(413, f"the file is too large; give one of at most {most} MB.")
    return b"".join(parts)


async def _json(request: Request) -> Mapping[str, Any]:
    """Return the JSON of a request."""
    try:
        told = parse_json(await _body(request), finite=True)
    except ValueError as error:
        raise InputError(
            f"the request is not JSON ({error}); send a mapping of names to values."
        ) from error
    if not isinstance(told, dict):
        raise InputError("the request is not a mapping of names to values; send one as JSON.")
    return told


async def _refused(request: Request, error: Exception) -> Response:  # noqa: ARG001
    return JSONResponse({"error": str(error)}, 422, headers=HEADERS)


async def _outrun(request: Request, error: Exception) -> Response:  # noqa: ARG001
    return JSONResponse({"error": "a newer question was asked meanwhile."}, 409, headers=HEADERS)


async def _failed(request: Request, error: Exception) -> Response:
    code, text = 500, "the answer failed because of a fault in semsig, not in your input."
    if isinstance(error, HTTPException):
        code, text = error.status_code, error.detail
        if code in {404, 405}:
            text = f"there is nothing at {request.method} {request.url.path}."
    return JSONResponse({"error": text}, code, headers=HEADERS)


def workbench_app(bench: Workbench, *, port: int, token: str) -> ASGIApp:
    """Return the application that serves the page of a workbench."""
    api = _Api(bench)
    asked = (api.photo, api.boxes, api.answer, api.suggest, api.cell, api.simulate, api.export)
    routes = [
        Route("/", api.page),
        Route("/api/city", api.city),
        Route("/api/ground", api.ground),
        *(Route(f"/api/{one.__name__}", one, methods=["POST"]) for one in asked),
    ]
    app = Starlette(
        routes=routes,
        exception_handlers={
            SemsigError: _refused,
            WorkCancelledError: _outrun,
            HTTPException: _failed,
            Exception: _failed,
        },
    )
    return _Guard(app, port=port, token=token)


def listening(port: int) -> socket.socket:
    """Return a socket that listens on a port of this machine, any free one for 0.

    InputError if another program has it, or the number is none of a port.
    """
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((HOST, port))
        listener.listen()
    except OSError as error:
        listener.close()
        raise InputError(
            f"port {port} of this machine is not available ({error.strerror}); give another "
            "--port, or leave it out to use any that is free."
        ) from error
    return listener


def served(bench: Workbench, listener: socket.socket, *, token: str) -> uvicorn.Server:
    """Return the server of a workbench; its `run` serves until it is interrupted."""
    port = listener.getsockname()[1]
    settings = uvicorn.Config(
        workbench_app(bench, port=port, token=token),
        log_level="warning",
        access_log=False,
        server_header=False,
        lifespan="off",
        timeout_graceful_shutdown=PATIENCE_S,
    )
    return uvicorn.Server(settings)


def address(listener: socket.socket, token: str) -> str:
    """Return the address of the page."""
    return f"http://{HOST}:{listener.getsockname()[1]}/?token={token}"
