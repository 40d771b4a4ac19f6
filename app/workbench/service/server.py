"""The workbench's server: on 127.0.0.1, behind the same gate as the review page.

It serves a fixed list of names, pictures of photographs by number, and the answers to questions: no path of a request
reaches the file system but through the list of experiments.
"""

from __future__ import annotations

import asyncio
import json
import secrets
import socket
from collections.abc import AsyncIterator
from importlib.resources import files
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, RedirectResponse, Response, StreamingResponse
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from ...errors import InputError, RunError
from ...recording.viewing.gate import SAFE_HEADERS, Gate
from ..inspecting.found import run_stamp
from . import inspect_questions, mend_questions, run_questions, setup_questions  # noqa: F401  they add their questions
from .bench import Bench
from .project import Project
from .questions import BadRequest, answer
from .recordings import PATH, Viewer, answer_recording, answer_shared, answer_viewer

LARGEST_BODY = 256 * 1024  # bytes of a question
WIDEST = 20_000  # [px] of a picture
GLIMPSE = 480  # [px] of a picture on the first page
NEWS = 0.4  # [s] between looks for what is new
KINDS = {
    ".html": "text/html; charset=utf-8", ".css": "text/css; charset=utf-8", ".svg": "image/svg+xml",
    ".js": "text/javascript; charset=utf-8",
}  # fmt: skip
HEADERS = ("Host", "Origin", "Sec-Fetch-Site", "Content-Type", "Cookie")


class Guard:
    """Lets through what the gate has nothing against, and gives every answer the safe headers."""

    def __init__(self, application: ASGIApp, gate: Gate, key: str) -> None:
        self.application, self.gate = application, gate
        self.named = f"{PATH}{key}/"  # what begins so may be asked for without a cookie: the viewer keeps none

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.application(scope, receive, send)
            return
        request = Request(scope)

        async def send_safely(message: Message) -> None:
            if message["type"] == "http.response.start":
                told = {name.lower() for name, _ in message["headers"]}
                safe = {"Cache-Control": "no-store"} | SAFE_HEADERS
                more = [(k.encode(), v.encode()) for k, v in safe.items() if k.lower().encode() not in told]
                message = {**message, "headers": [*message["headers"], *more]}
            await send(message)

        refusal = self._refusal(request)
        await (refusal or self.application)(scope, receive, send_safely)

    def _refusal(self, request: Request) -> Response | None:
        for name in ("host", "origin"):
            if len(request.headers.getlist(name)) > 1:
                return PlainTextResponse(f"{name} stands twice", 400)
        entering = request.url.path == "/" and "token" in request.query_params
        headers = {name: value for name in HEADERS if (value := request.headers.get(name)) is not None}
        beginning = request.url.path[: len(self.named)].encode()
        named = secrets.compare_digest(beginning, self.named.encode())
        objection = self.gate.objection(headers, changes=request.method != "GET", entering=entering or named)
        if objection is not None:
            return PlainTextResponse(objection, 403)
        if not entering:
            return None
        if not self.gate.opens(request.query_params["token"]):
            return PlainTextResponse(f"this token is not the one that `rodsight {self.gate.command}` printed", 403)
        return RedirectResponse("/", 303, {"Set-Cookie": self.gate.set_cookie})


def make_application(bench: Bench, gate: Gate) -> ASGIApp:
    """The server's whole behaviour, without a network."""
    page = files(__name__.rsplit(".", 2)[0]) / "page"
    assets = {file.name: file.read_bytes() for file in page.iterdir() if _kind(file.name) is not None}

    viewer = Viewer()

    async def asset(request: Request) -> Response:
        name = request.path_params.get("name", "index.html")
        if name not in assets:
            return PlainTextResponse("there is nothing here", 404)
        return Response(assets[name], headers={"Content-Type": _kind(name) or ""})

    def picture(request: Request) -> Response:
        query = request.query_params
        return _answered(lambda: Response(
            bench.project(query.get("at", "")).picture(_whole(query, "frame"), _whole(query, "size") or WIDEST),
            media_type="image/jpeg",
        ))  # fmt: skip

    def glimpse(request: Request) -> Response:
        query = request.query_params
        return _answered(lambda: Response(
            bench.glimpse(_whole(query, "roll") if "roll" in query else None, GLIMPSE), media_type="image/jpeg",
        ))  # fmt: skip

    def crop(request: Request) -> Response:
        query = request.query_params
        return _answered(lambda: Response(
            bench.project(query.get("at", "")).crop(
                _whole(query, "frame"), 0.01 * _whole(query, "x"), 0.01 * _whole(query, "y"), _whole(query, "width")
            ),
            media_type="image/jpeg",
        ))  # fmt: skip

    async def ask(request: Request) -> Response:
        if int(request.headers.get("Content-Length") or LARGEST_BODY + 1) > LARGEST_BODY:
            return PlainTextResponse("a question must be short", 413)
        body = await request.body()
        return await run_in_threadpool(_answered, lambda: _ask(bench, request.path_params["name"], body))

    async def events(request: Request) -> Response:
        try:
            opened = bench.project(request.query_params.get("at", ""))
        except InputError as error:
            return PlainTextResponse(str(error), 422)
        return StreamingResponse(_news(bench, opened, request), media_type="text/event-stream")

    routes = [
        Route("/", asset, methods=["GET"]),
        Route("/page/{name}", asset, methods=["GET"]),
        Route("/photograph", picture, methods=["GET"]),
        Route("/glimpse", glimpse, methods=["GET"]),
        Route("/crop", crop, methods=["GET"]),
        Route("/events", events, methods=["GET"]),
        Route("/viewer/{name}", lambda request: answer_viewer(viewer, request), methods=["GET"]),
        Route("/shared", lambda request: _answered(lambda: answer_shared(bench, request)), methods=["GET"]),
        *(
            Route(f"{PATH}{bench.key}/{place}{{name}}", lambda request: answer_recording(bench, request))
            for place in ("{at:path}/", "")  # the root itself may be the experiment
        ),
        Route("/ask/{name}", ask, methods=["POST"]),
    ]
    return Guard(Starlette(routes=routes), gate, bench.key)


class WorkbenchServer:
    """Serves one bench; port 0 takes a free one."""

    def __init__(self, bench: Bench, port: int = 0) -> None:
        import uvicorn

        self.bench = bench
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self._socket.bind(("127.0.0.1", port))
        self._socket.listen(128)  # a browser that is quicker than the server waits for it
        self.gate = Gate(self._socket.getsockname()[1], "open")
        config = uvicorn.Config(
            make_application(bench, self.gate), log_config=None, access_log=False, server_header=False,
            lifespan="off", timeout_graceful_shutdown=1,
        )  # fmt: skip
        self._server = uvicorn.Server(config)

    @property
    def address(self) -> str:
        """The address to open first, with its token."""
        return self.gate.address

    def serve(self) -> None:
        """Serve until shutdown is called, or until the person interrupts."""
        self._server.run(sockets=[self._socket])

    def shutdown(self) -> None:
        self.bench.closed = True
        self._server.should_exit = True

    def close(self) -> None:
        """Let go of the port, and pause what runs."""
        self.bench.close()
        self._socket.close()


async def _news(bench: Bench, opened: Project, request: Request) -> AsyncIterator[str]:
    """How the run stands, whenever that changes."""
    known: Any = None
    while not await request.is_disconnected() and not bench.closed:
        stamp = await run_in_threadpool(
            lambda: (opened.job.version, run_stamp(opened.results), opened.photograph_count())
        )
        if stamp != known:
            known = stamp
            told = await run_in_threadpool(lambda: answer(bench, "run_told", {"at": opened.key}))
            yield f"data: {json.dumps(told)}\n\n"
        await asyncio.sleep(NEWS)


def _ask(bench: Bench, name: str, body: bytes) -> Response:
    try:
        values = json.loads(body)
    except (ValueError, RecursionError):  # not JSON, or deeper than anybody means
        raise BadRequest("this is not JSON") from None
    if not isinstance(values, dict):
        raise BadRequest("a question has named values")
    return JSONResponse(answer(bench, name, values))


def _answered(work: Any) -> Response:
    """The answer, or the sentence that says why there is none."""
    try:
        return work()
    except BadRequest as error:
        return PlainTextResponse(str(error), 400)
    except (InputError, RunError) as error:
        return PlainTextResponse(str(error), 422)
    except OSError as error:
        return PlainTextResponse(f"{error.filename or ''} {error.strerror or error}".strip(), 500)


def _whole(query: Any, name: str) -> int:
    text = query.get(name, "0")
    if not text.isdecimal() or len(text) > 9:
        raise BadRequest(f"{name} is not a whole number")
    return int(text)


def _kind(name: str) -> str | None:
    return next((kind for suffix, kind in KINDS.items() if name.endswith(suffix)), None)
