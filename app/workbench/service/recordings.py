"""The recording of a run: served to the viewer of the installed wheel, and written as one HTML file to be sent.

The viewer is loaded at its first request.
"""

from __future__ import annotations

import gzip
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any
from urllib.parse import quote

from pydantic import Field
from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, Response

from ...process.errors import InputError
from ...recording.parts import parts_of
from ...run_folder import LATER, RECORDING, SIDE
from .endpoints import ExperimentQuery, Number, Text, Whole, endpoint
from .project import Project
from .workbench import Workbench

if TYPE_CHECKING:  # with it comes rerun, a fifth of all import time, which no page needs before it shows a recording
    from ...recording.viewing.web_viewer import WebViewer

FILES = (RECORDING, SIDE)
PATH = "/recording/"  # of the viewer's requests, which carry no cookie: <key>/<experiment>/<file>


@endpoint
def recording(workbench: Workbench, at: Text) -> dict[str, Any]:
    """Return the addresses of the recording, and the pixels of the photograph in one of its own."""
    opened = workbench.project(at)
    files = [name for name in FILES if (opened.results / name).is_file()]
    files += [each.name for each in parts_of(opened.results / RECORDING)[1:]]
    if RECORDING not in files:
        raise InputError(opened.results, "", "holds no recording: let the run end first")
    inner = f"{quote(opened.key)}/" if opened.key != "." else ""  # a browser would leave out "./"
    folder = f"{PATH}{workbench.key}/{inner}"
    size = sum((opened.results / name).stat().st_size for name in files)
    return {"addresses": [folder + name for name in files], "bytes": size, "shrink": _shrink(opened)}


@endpoint
def share(
    opened: Project, first: Whole = 0, stop: Whole | None = None,
    scale: Annotated[Number, Field(gt=0.0, le=1.0)] = 1.0, although_out_of_date: bool = False,
) -> dict[str, Any]:  # fmt: skip
    """Write the HTML file that any browser opens, as `rodsight share --html` does, of frames first … stop − 1."""
    from ...recording.archive.cards import make_card
    from ...recording.archive.share import share_recording
    from ...recording.viewing.single_page import write_single_page

    source, target = opened.results / RECORDING, opened.results / f"{opened.results.name}-share.rrd"
    if not source.is_file():
        raise InputError(opened.results, "", "holds no recording: let the run end first")
    reasons = [] if although_out_of_date else opened.out_of_date()
    if reasons:
        raise InputError(source, "", f"is out of date: {'; '.join(reasons)}; run the experiment again")
    try:
        report = share_recording(source, target, first=first, stop=stop, scale=scale)
    except ValueError as error:
        raise InputError(source, "", str(error)) from None
    write_single_page([target], target.with_suffix(".html"), title=opened.name, cards=[make_card(target)])
    return shared(opened) | {"frames": report.frames}


@endpoint
def shared(opened: Project) -> dict[str, Any]:
    """Describe the file that can be sent; file None: there is none. old: the recording is newer."""
    page, recording = _page_of(opened), opened.results / RECORDING
    if not page.is_file():
        return {"file": None, "ready": recording.is_file()}
    stat = page.stat()
    old = recording.is_file() and recording.stat().st_mtime > stat.st_mtime
    return {"file": str(page), "name": page.name, "bytes": stat.st_size, "old": old, "ready": recording.is_file()}


def answer_shared(workbench: Workbench, request: Request) -> Response:
    """Send the HTML file as a download: it must not run as a page of this server."""
    page = _page_of(workbench.project(ExperimentQuery.of(request).at))
    if not page.is_file():
        return PlainTextResponse("no file has been written to be shared yet", 404)
    return FileResponse(page, media_type="application/octet-stream", filename=page.name)


def _page_of(opened: Project) -> Path:
    return opened.results / f"{opened.results.name}-share.html"


def _shrink(opened: Project) -> int:
    data = opened.run_data()
    if data is None:
        return 1
    from ...recording.look.canvas import Canvas

    return Canvas.around(data.tracks, opened.scene().scale, opened.validation().shape).shrink


class Viewer:
    """The web viewer of the installed wheel, read at its first request."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._viewer: WebViewer | None = None
        self._packed = b""

    def script(self) -> bytes:
        """Return the script as a module, which needs no script element of the page."""
        return self._read().script + b"\nexport default wasm_bindgen;\n"

    def module(self, *, packed: bool) -> bytes:
        """Return the WebAssembly module; packed: compressed to a third of its size."""
        module = self._read().module
        if not packed:
            return module
        with self._lock:
            self._packed = self._packed or gzip.compress(module, 1)
            return self._packed

    def _read(self) -> WebViewer:
        with self._lock:
            if self._viewer is None:
                from ...recording.viewing.web_viewer import read_web_viewer

                self._viewer = read_web_viewer()
            return self._viewer


def answer_viewer(viewer: Viewer, request: Request) -> Response:
    """Send the script, or the module."""
    if request.url.path.endswith(".js"):
        return Response(viewer.script(), media_type="text/javascript")
    packed = "gzip" in request.headers.get("Accept-Encoding", "")
    encoding = "gzip" if packed else "identity"
    headers = {"Content-Encoding": encoding, "Vary": "Accept-Encoding"}
    return Response(viewer.module(packed=packed), media_type="application/wasm", headers=headers)


def answer_recording(workbench: Workbench, request: Request) -> Response:
    """Send the file; the guard has compared the secret part of its path."""
    name = request.path_params["name"]
    if name not in FILES and not LATER.fullmatch(name):
        return PlainTextResponse("there is nothing here", 404)
    try:
        file = workbench.project(request.path_params.get("at", ".")).results / name
    except InputError as error:
        return PlainTextResponse(str(error), 422)
    if not file.is_file():
        return PlainTextResponse("the recording is not there any more", 404)
    return FileResponse(file, media_type="application/octet-stream")
