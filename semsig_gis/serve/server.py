"""The server of the workbench: its page and the requests of this page, only on this machine.

A page of another site may send requests to this machine, and its host name may point to this
machine (DNS rebinding). So a request must name this server as its host, have no other origin than
its own page, and contain the token from the address of that page.
"""

from __future__ import annotations

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
from semsig_gis.serve.page import security_policy, workbench_page
from semsig_gis.serve.streets import city_streets
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
SHUTDOWN_S = 2  # time for running answers when the server stops


class _Guard:
    """Middleware that refuses requests from anywhere but the page of this server."""

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
        """Return status code and message of a refusal, or None if the request is allowed."""
        headers: dict[bytes, bytes] = dict(scope["headers"])
        if headers.get(b"host") not in self.hosts:
            return 421, "this server answers only at its own address; open the one it printed."
        origin, site = headers.get(b"origin"), headers.get(b"sec-fetch-site", b"none")
        own = origin is None or origin in self.origins
        if not own or site not in {b"none", b"same-origin"}:
            return 403, "the request comes from the page of another site, which may not ask."
        token = headers.get(TOKEN_HEADER.encode(), b"")
        if scope["path"] == "/":
            # A browser opens the page without headers of ours, so the token is in the address.
            pairs = (pair.partition(b"=") for pair in scope["query_string"].split(b"&"))
            token = next((value for name, _, value in pairs if name == b"token"), b"")
        if not hmac.compare_digest(token, self.token):
            return 403, "the token is missing or wrong; open the address that semsig serve printed."
        return None


class _Api:
    """Requests of the page, answered one at a time in a worker thread."""

    def __init__(self, bench: Workbench) -> None:
        self.bench = bench
        self.limiter = anyio.CapacityLimiter(1)
        self.requests = Counter[str]()  # number of answers requested, by page

    async def page(self, request: Request) -> Response:  # noqa: ARG002 - as routes are called
        nonce = secrets.token_urlsafe(16)
        headers = HEADERS | {"Content-Security-Policy": security_policy(nonce)}
        return HTMLResponse(workbench_page(nonce), headers=headers)

    async def city(self, request: Request) -> Response:  # noqa: ARG002
        return await self._json_response(lambda: self.bench.about)

    async def ground(self, request: Request) -> Response:  # noqa: ARG002
        return await self._json_response(city_streets, self.bench.database, self.bench.store)

    async def photo(self, request: Request) -> Response:
        name = request.query_params.get("name", "the picture")[:200]
        content = await _body(request)
        return await self._json_response(self.bench.photo, content, name)

    async def boxes(self, request: Request) -> Response:
        return await self._json_response(self.bench.boxes, await _json(request))

    async def answer(self, request: Request) -> Response:
        body = await _json(request)
        page = str(body.get("page"))
        number = self.requests[page] = self.requests[page] + 1

        def answer() -> dict[str, Any]:
            # Stops as soon as the same page requests a newer answer.
            with cancellable(lambda: number == self.requests[page]):
                return self.bench.answer(body)

        return await self._json_response(answer)

    async def suggest(self, request: Request) -> Response:
        return await self._json_response(self.bench.suggest, await _json(request))

    async def cell(self, request: Request) -> Response:
        return await self._json_response(self.bench.cell, await _json(request))

    async def simulate(self, request: Request) -> Response:
        return await self._json_response(self.bench.simulate, await _json(request))

    async def export(self, request: Request) -> Response:
        suffix = request.query_params.get("format", "")
        body = await _json(request)
        content = await anyio.to_thread.run_sync(
            self.bench.export, body, suffix, limiter=self.limiter
        )
        headers = HEADERS | {"Content-Disposition": f'attachment; filename="answer.{suffix}"'}
        return Response(content, media_type=FORMATS[suffix], headers=headers)

    async def _json_response(self, work: Callable[..., Any], *arguments: object) -> Response:
        """Return the result of a function as JSON."""
        value = await anyio.to_thread.run_sync(work, *arguments, limiter=self.limiter)
        return JSONResponse(value, headers=HEADERS)


async def _body(request: Request) -> bytes:
    """Return the body of a request; HTTPException as soon as it is too long."""
    length = request.headers.get("content-length", "0")
    parts, size = [], int(length) if length.isdecimal() else 0
    if size <= MOST_UPLOAD:
        # The header may be missing or wrong, so the parts are counted too.
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
        body = parse_json(await _body(request), finite=True)
    except ValueError as error:
        raise InputError(
            f"the request is not JSON ({error}); send a mapping of names to values."
        ) from error
    if not isinstance(body, dict):
        raise InputError("the request is not a mapping of names to values; send one as JSON.")
    return body


async def _error_response(request: Request, error: Exception) -> Response:
    """Return the status code and the message of an error as JSON."""
    code, text = 500, "the answer failed because of a fault in semsig, not in your input."
    if isinstance(error, SemsigError):
        code, text = 422, str(error)
    elif isinstance(error, WorkCancelledError):
        code, text = 409, "a newer question was asked meanwhile."
    elif isinstance(error, HTTPException):
        code, text = error.status_code, error.detail
        if code in {404, 405}:
            text = f"there is nothing at {request.method} {request.url.path}."
    return JSONResponse({"error": text}, code, headers=HEADERS)


def workbench_app(bench: Workbench, *, port: int, token: str) -> ASGIApp:
    """Return the application that serves the page of a workbench."""
    api = _Api(bench)
    posts = (api.photo, api.boxes, api.answer, api.suggest, api.cell, api.simulate, api.export)
    routes = [
        Route("/", api.page),
        Route("/api/city", api.city),
        Route("/api/ground", api.ground),
        *(Route(f"/api/{post.__name__}", post, methods=["POST"]) for post in posts),
    ]
    app = Starlette(
        routes=routes,
        exception_handlers=dict.fromkeys(
            (SemsigError, WorkCancelledError, HTTPException, Exception), _error_response
        ),
    )
    return _Guard(app, port=port, token=token)


def open_listener(port: int) -> socket.socket:
    """Return a socket that listens on a port of this machine, or on any free port for 0.

    InputError if another program uses the port, or the number is not a port.
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


def make_server(bench: Workbench, listener: socket.socket, *, token: str) -> uvicorn.Server:
    """Return the server of a workbench; its `run` serves until it is interrupted."""
    port = listener.getsockname()[1]
    settings = uvicorn.Config(
        workbench_app(bench, port=port, token=token),
        log_level="warning",
        access_log=False,
        server_header=False,
        lifespan="off",
        timeout_graceful_shutdown=SHUTDOWN_S,
    )
    return uvicorn.Server(settings)


def server_address(listener: socket.socket, token: str) -> str:
    """Return the address of the page."""
    return f"http://{HOST}:{listener.getsockname()[1]}/?token={token}"
