"""The recording of a run as the page gets it: the viewer of the installed wheel, the file under a secret name; and as
one HTML file to be sent to anybody.

Nothing of it is loaded before somebody asks for the recording.
"""

from __future__ import annotations

import gzip
import threading
from pathlib import Path
from typing import Annotated, Any
from urllib.parse import quote

from pydantic import Field
from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, Response

from ...errors import InputError
from ...recording.files.cards import make_card
from ...recording.files.share import share_recording
from ...recording.look.canvas import Canvas
from ...recording.parts import parts_of
from ...recording.viewing.single_page import write_single_page
from ...recording.viewing.web_viewer import WebViewer, read_web_viewer
from ...run_folder import LATER, RECORDING, SIDE
from .bench import Bench
from .project import Project
from .questions import Number, Text, Whole, question
from .run_questions import scale_of

FILES = (RECORDING, SIDE)
PATH = "/recording/"  # what the viewer asks for, without the page's cookie: <key>/<experiment>/<file>


@question
def recording(bench: Bench, at: Text) -> dict[str, Any]:
    """Where the viewer finds the recording; and how many pixels of the photograph are one of its own."""
    opened = bench.project(at)
    files = [name for name in FILES if (opened.results / name).is_file()]
    files += [each.name for each in parts_of(opened.results / RECORDING)[1:]]
    if RECORDING not in files:
        raise InputError(opened.results, "", "holds no recording: let the run come to its end")
    inner = f"{quote(opened.key)}/" if opened.key != "." else ""  # a browser would leave out "./"
    folder = f"{PATH}{bench.key}/{inner}"
    size = sum((opened.results / name).stat().st_size for name in files)
    return {"addresses": [folder + name for name in files], "bytes": size, "shrink": _shrink(opened)}


@question
def share(
    bench: Bench, at: Text, first: Whole = 0, stop: Whole | None = None,
    scale: Annotated[Number, Field(gt=0.0, le=1.0)] = 1.0,
) -> dict[str, Any]:  # fmt: skip
    """Write the HTML file that any browser opens, as `rodsight share --html` does; frames first … stop − 1."""
    opened = bench.project(at)
    source, target = opened.results / RECORDING, opened.results / f"{opened.results.name}-share.rrd"
    if not source.is_file():
        raise InputError(opened.results, "", "holds no recording: let the run come to its end")
    try:
        report = share_recording(source, target, first=first, stop=stop, scale=scale)
    except ValueError as error:
        raise InputError(source, "", str(error)) from None
    write_single_page([target], target.with_suffix(".html"), title=opened.name, cards=[make_card(target)])
    return shared(bench, at) | {"frames": report.frames}


@question
def shared(bench: Bench, at: Text) -> dict[str, Any]:
    """The file that is there to be sent; file None: none yet. old: the recording is newer."""
    opened = bench.project(at)
    page, recording = _page_of(opened), opened.results / RECORDING
    if not page.is_file():
        return {"file": None, "ready": recording.is_file()}
    told = page.stat()
    old = recording.is_file() and recording.stat().st_mtime > told.st_mtime
    return {"file": str(page), "name": page.name, "bytes": told.st_size, "old": old, "ready": recording.is_file()}


def answer_shared(bench: Bench, request: Request) -> Response:
    """The HTML file, to be kept by the browser and not opened: it is no page of ours."""
    page = _page_of(bench.project(request.query_params.get("at", "")))
    if not page.is_file():
        return PlainTextResponse("nothing has been written to be shared yet", 404)
    return FileResponse(page, media_type="application/octet-stream", filename=page.name)


def _page_of(opened: Project) -> Path:
    return opened.results / f"{opened.results.name}-share.html"


def _shrink(opened: Project) -> int:
    found = opened.found()
    if found is None:
        return 1
    return Canvas.around(found.tracks, scale_of(opened), opened.understood().shape).shrink


class Viewer:
    """The wheel's web viewer, read once, when it is first asked for."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._viewer: WebViewer | None = None
        self._packed = b""

    def script(self) -> bytes:
        """As a module, which needs no script element of the page's own."""
        return self._read().script + b"\nexport default wasm_bindgen;\n"

    def module(self, *, packed: bool) -> bytes:
        """WebAssembly; packed: by gzip, a third of its size."""
        module = self._read().module
        if not packed:
            return module
        with self._lock:
            self._packed = self._packed or gzip.compress(module, 1)
            return self._packed

    def _read(self) -> WebViewer:
        with self._lock:
            if self._viewer is None:
                self._viewer = read_web_viewer()
            return self._viewer


def answer_viewer(viewer: Viewer, request: Request) -> Response:
    """The script, or the module."""
    if request.url.path.endswith(".js"):
        return Response(viewer.script(), media_type="text/javascript")
    packed = "gzip" in request.headers.get("Accept-Encoding", "")
    encoding = "gzip" if packed else "identity"
    headers = {"Content-Encoding": encoding, "Vary": "Accept-Encoding"}
    return Response(viewer.module(packed=packed), media_type="application/wasm", headers=headers)


def answer_recording(bench: Bench, request: Request) -> Response:
    """The file; whether its name is the right one, the guard has seen."""
    name = request.path_params["name"]
    if name not in FILES and not LATER.fullmatch(name):
        return PlainTextResponse("there is nothing here", 404)
    try:
        file = bench.project(request.path_params.get("at", ".")).results / name
    except InputError as error:
        return PlainTextResponse(str(error), 422)
    if not file.is_file():
        return PlainTextResponse("the recording is not there any more", 404)
    return FileResponse(file, media_type="application/octet-stream")
