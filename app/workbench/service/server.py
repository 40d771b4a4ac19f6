"""The workbench's server, on 127.0.0.1 behind one gate.

It serves a fixed list of files, pictures of photographs by number, and endpoints: no path of a request reaches the file
system except through the list of experiments.
"""

from __future__ import annotations

import asyncio
import ctypes
import gc
import json
import socket
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from functools import partial
from importlib.resources import files
from importlib.resources.abc import Traversable
from typing import Any, cast

from pydantic_core import PydanticSerializationError, to_json
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response, StreamingResponse
from starlette.routing import Route
from starlette.types import ASGIApp

from ...process.errors import InputError, RunError
from ...recording.viewing.connections import BACKLOG, Connections
from ...recording.viewing.gate import Gate
from ...reviewing.session import UnknownPair
from ..inspecting.run_data import run_stamp
from . import (  # noqa: F401  importing them registers their endpoints
    correction_endpoints,
    inspect_endpoints,
    review_endpoints,
    run_endpoints,
    setup_endpoints,
)
from .endpoints import (
    BadRequest,
    CropQuery,
    ExperimentQuery,
    PhotographQuery,
    ThumbnailQuery,
    call_endpoint,
)
from .guard import Guard
from .project import Project
from .recordings import PATH, Viewer, answer_recording, answer_shared, answer_viewer
from .setup_endpoints import LARGEST_WRITTEN, WITH_TABLE
from .workbench import Workbench

LARGEST_BODY = 256 * 1024  # bytes of a request without a table
LARGEST_TABLE = 4 * LARGEST_WRITTEN  # bytes of a request with one: a character has up to four, an escaped line end two
THUMBNAIL = 480  # [px] of a picture on the first page
# mallopt(3): two areas of memory for all threads, since one each holds back as much as a photograph; large arrays in
# pages of their own, which return to the system at once.
MEMORY_SETTINGS = {"M_ARENA_MAX": (-8, 2), "M_MMAP_THRESHOLD": (-3, 1 << 20)}
KEPT = 60  # [s] that a connection stays between two requests: the page's own ones are few
POLLING = 0.4  # [s] between checks for changes of a run
KINDS = {
    ".html": "text/html; charset=utf-8", ".css": "text/css; charset=utf-8", ".svg": "image/svg+xml",
    ".js": "text/javascript; charset=utf-8",
}  # fmt: skip


def make_application(workbench: Workbench, gate: Gate, entry: str = "/", known: Connections | None = None) -> ASGIApp:
    """Make the server's application, without a network.

    Parameters
    ----------
    workbench : Workbench
        The experiments.
    gate : Gate
        The access rules.
    entry : str
        Address to which the first visit is redirected.
    known : Connections, optional
        The connections of the server; those whose requests are admitted are taken from its list.
    """
    assets = dict(_page_files(files(__name__.rsplit(".", 2)[0]) / "page"))
    viewer = Viewer()

    async def asset(request: Request) -> Response:
        name = request.path_params.get("name", "index.html")
        if name not in assets:
            return PlainTextResponse("there is nothing here", 404)
        return Response(assets[name], headers={"Content-Type": _kind(name) or ""})

    def photograph(request: Request) -> Response:
        query = PhotographQuery.of(request)
        return _jpeg(workbench.project(query.at).picture(query.frame, query.size, query.part))

    def thumbnail(request: Request) -> Response:
        query = ThumbnailQuery.of(request)
        return _jpeg(workbench.thumbnail(query.folder, query.suffix, THUMBNAIL))

    def crop(request: Request) -> Response:
        query = CropQuery.of(request)
        place, shape = (query.x, query.y), (query.rows, query.columns)
        return _jpeg(workbench.project(query.at).crop(query.frame, place, query.width, shape))

    async def call(request: Request) -> Response:
        length = request.headers.get("Content-Length") or ""
        largest = LARGEST_TABLE if request.path_params["name"] in WITH_TABLE else LARGEST_BODY
        if not length.isdecimal() or len(length) > 9 or int(length) > largest:
            return PlainTextResponse(f"a request has at most {largest} bytes", 413)
        body = await request.body()
        return await run_in_threadpool(_guarded, lambda: _call(workbench, request.path_params["name"], body))

    def events(request: Request) -> Response:
        opened = workbench.project(ExperimentQuery.of(request).at)
        return StreamingResponse(_run_events(workbench, opened, request), media_type="text/event-stream")

    def guarded(work: Callable[[Request], Response]) -> Callable[[Request], Response]:
        return lambda request: _guarded(lambda: work(request))

    routes = [
        Route("/", asset, methods=["GET"]),
        Route("/page/{name:path}", asset, methods=["GET"]),
        Route("/photograph", guarded(photograph), methods=["GET"]),
        Route("/thumbnail", guarded(thumbnail), methods=["GET"]),
        Route("/crop", guarded(crop), methods=["GET"]),
        Route("/events", guarded(events), methods=["GET"]),
        Route("/viewer/{name}", lambda request: answer_viewer(viewer, request), methods=["GET"]),
        Route("/shared", guarded(lambda request: answer_shared(workbench, request)), methods=["GET"]),
        *(
            Route(f"{PATH}{workbench.key}/{place}{{name}}", lambda request: answer_recording(workbench, request))
            for place in ("{at:path}/", "")  # the root itself may be the experiment
        ),
        Route("/api/{name}", call, methods=["POST"]),
    ]
    return Guard(Starlette(routes=routes), gate, f"{PATH}{workbench.key}/", entry, known or Connections())


class WorkbenchServer:
    """Serves one workbench; port 0 takes a free port."""

    def __init__(self, workbench: Workbench, port: int = 0, *, command: str = "open", entry: str = "/") -> None:
        """Bind the port; command: that prints the address; entry: address to which the first visit is redirected."""
        import uvicorn

        _save_memory()
        from .http_connection import HttpConnection

        self.workbench = workbench
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._socket.bind(("127.0.0.1", port))
            self._socket.listen(BACKLOG)  # a browser that is faster than the server waits
        except BaseException:
            self._socket.close()
            raise
        self.gate = Gate(self._socket.getsockname()[1], command)
        known = Connections()
        config = uvicorn.Config(
            make_application(workbench, self.gate, entry, known), log_config=None, access_log=False,
            server_header=False, lifespan="off", timeout_graceful_shutdown=1, backlog=BACKLOG,
            http=cast(Any, partial(HttpConnection, known)), timeout_keep_alive=KEPT,
        )  # fmt: skip
        self._server = uvicorn.Server(config)

    @property
    def address(self) -> str:
        """The address to open first, with its token."""
        return self.gate.address

    def serve(self) -> None:
        """Serve until shutdown is called, or until the user interrupts."""
        gc.freeze()  # imported objects stay: each search for cycles among them would delay an answer by .1 s
        self._server.run(sockets=[self._socket])

    def shutdown(self) -> None:
        self.workbench.closed = True
        self._server.should_exit = True

    def close(self) -> None:
        """Release the port, and pause every run."""
        self.workbench.close()
        self._socket.close()


def _save_memory() -> None:
    with suppress(AttributeError, OSError):  # a C library without these settings
        library = ctypes.CDLL(None)
        for parameter, value in MEMORY_SETTINGS.values():
            library.mallopt(parameter, value)


async def _run_events(workbench: Workbench, opened: Project, request: Request) -> AsyncIterator[str]:
    """The state of the run, sent whenever it changes."""
    known: Any = None
    while not await request.is_disconnected() and not workbench.closed:
        stamp = await run_in_threadpool(
            lambda: (opened.job.version, run_stamp(opened.results), opened.photograph_count())
        )
        if stamp != known:
            known = stamp
            state = await run_in_threadpool(lambda: call_endpoint(workbench, "run_state", {"at": opened.key}))
            yield f"data: {json.dumps(state)}\n\n"
        await asyncio.sleep(POLLING)


def _call(workbench: Workbench, name: str, body: bytes) -> Response:
    try:
        values = json.loads(body)
    except (ValueError, RecursionError):  # not JSON, or nested too deeply
        raise BadRequest("this is not JSON") from None
    if not isinstance(values, dict):
        raise BadRequest("a request has named values")
    return _Json(call_endpoint(workbench, name, values))


def _guarded(work: Callable[[], Response]) -> Response:
    """The answer, or the sentence that states why there is none."""
    try:
        return work()
    except (BadRequest, UnknownPair) as error:
        return PlainTextResponse(_plain(str(error)), 400)
    except (InputError, RunError) as error:
        return PlainTextResponse(_plain(str(error)), 422)
    except RecursionError:
        return PlainTextResponse("the experiment file is nested too deeply", 422)
    except OSError as error:
        return PlainTextResponse(_plain(f"{error.filename or ''} {error.strerror or error}".strip()), 422)


class _Json(JSONResponse):
    """An answer in which characters that are no UTF-8, as of a file's name, are replaced."""

    def render(self, content: Any) -> bytes:
        try:
            return to_json(content, inf_nan_mode="null")  # five times as fast as Python's own
        except (PydanticSerializationError, UnicodeEncodeError):
            return json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode(
                errors="replace"
            )


def _plain(text: str) -> str:
    return text.encode(errors="replace").decode()


def _jpeg(content: bytes) -> Response:
    return Response(content, media_type="image/jpeg")


def _page_files(folder: Traversable, prefix: str = "") -> list[tuple[str, bytes]]:
    """Names and contents of the page's files; those of inner folders are named folder/name."""
    found = []
    for each in folder.iterdir():
        if each.is_dir():
            found += _page_files(each, f"{prefix}{each.name}/")
        elif _kind(each.name) is not None:
            found.append((f"{prefix}{each.name}", each.read_bytes()))
    return found


def _kind(name: str) -> str | None:
    return next((kind for suffix, kind in KINDS.items() if name.endswith(suffix)), None)
