"""Recordings shown in a browser on this machine: page, viewer and files from one server, behind the gate.

The viewer's own server gives a recording to whoever asks, be it a page of another site under a name that was made to
point here. This one knows a fixed list of names, and asks for the token that was printed. A recording that still grows
is sent as it grows.
"""

from __future__ import annotations

import os
import secrets
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from importlib.resources import files
from pathlib import Path
from typing import IO, Any
from urllib.parse import parse_qs, urlsplit

from .gate import SAFE_HEADERS, Gate, QuietServer
from .web_viewer import WebViewer, read_web_viewer

IDLE = 3600.0  # [s] without a question after which a server of its own ends
LOOK = 0.1  # [s] between two looks at a recording that grows
LAST = 5.0  # [s] that those who watch have to take the end of it
PATIENCE = 60.0  # [s] for a client that says nothing
PIECE = 1 << 20  # [bytes]
RENDERERS = ("webgl", "webgpu")
COMMAND = f"from {__name__} import serve_alone; serve_alone()"

_PAGE = {
    "/": ("recording_page.html", "text/html; charset=utf-8"),
    "/page.css": ("recording_page.css", "text/css; charset=utf-8"),
    "/page.js": ("recording_page.js", "text/javascript; charset=utf-8"),
}


class RecordingServer:
    """Serves recordings on 127.0.0.1; port 0 takes a free one. grows: the file is still written to."""

    def __init__(self, recordings: Sequence[Path], port: int = 0, *, grows: bool = False) -> None:
        self.recordings = tuple(recordings)
        self.asked = time.monotonic()  # last
        self._whole = threading.Event()
        self._watchers = 0
        self._left = threading.Condition()
        if not grows:
            self._whole.set()
        server = self

        class Handler(_Handler):
            recordings = server

        self._http = QuietServer(("127.0.0.1", port), Handler)
        self.gate = Gate(self._http.server_address[1], "view")
        room = files(__name__.rpartition(".")[0])
        self.assets = {path: (room.joinpath(name).read_bytes(), kind) for path, (name, kind) in _PAGE.items()}
        page, kind = self.assets["/"]
        # The viewer asks for the recording without a cookie: its address is known to the page alone.
        key = secrets.token_urlsafe(32)
        page = page.replace(b"@FILES@", str(len(self.recordings)).encode()).replace(b"@KEY@", key.encode())
        self.assets["/"] = (page, kind)
        self.named = {f"/{key}/{number}.rrd": file for number, file in enumerate(self.recordings)}
        self._viewer: WebViewer | None = None
        self._lock = threading.Lock()
        threading.Thread(target=self._http.serve_forever, args=(0.2,), daemon=True).start()

    @property
    def address(self) -> str:
        """The address to open first, with its token."""
        return self.gate.address

    @property
    def port(self) -> int:
        return self.gate.port

    def viewer(self) -> WebViewer:
        with self._lock:
            if self._viewer is None:
                self._viewer = read_web_viewer()
            return self._viewer

    def pieces(self, recording: Path) -> Iterator[bytes]:
        """What is in a recording, and what comes, until it is whole."""
        with self._left:
            self._watchers += 1
        try:
            with recording.open("rb") as stream:
                yield from grown(stream, self._whole)
        finally:
            with self._left:
                self._watchers -= 1
                self._left.notify_all()

    def close(self) -> None:
        """The recording is whole: let those who watch have the rest, and end."""
        self._whole.set()
        with self._left:
            self._left.wait_for(lambda: self._watchers == 0, LAST)
        self._http.shutdown()
        self._http.server_close()


def grown(stream: IO[bytes], whole: threading.Event) -> Iterator[bytes]:
    """What is in a file, and what comes, until it is whole."""
    while True:
        last = whole.is_set()  # before the look, or its end could be missed
        while piece := stream.read(PIECE):
            yield piece
        if last:
            return
        whole.wait(LOOK)


def serve_apart(recordings: Sequence[Path]) -> str:
    """Serve recordings from a process that outlives this one; gives the address to open."""
    process = subprocess.Popen(
        [sys.executable, "-c", COMMAND, *map(str, recordings)],
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, map(os.path.abspath, sys.path)))},
        start_new_session=True,
    )  # fmt: skip
    assert process.stdout is not None
    with process.stdout as told:
        address = told.readline().strip()
    if not address:
        raise OSError("the server of the page did not start")
    return address


def serve_alone() -> None:
    """What that process does: tell the address, and serve until nobody has asked for long."""
    server = RecordingServer([Path(each) for each in sys.argv[1:]])
    print(server.address, flush=True)
    sys.stdout.close()
    while (rest := IDLE - (time.monotonic() - server.asked)) > 0:
        time.sleep(rest)
    server.close()


class _Handler(BaseHTTPRequestHandler):
    """One connection. Subclassed with the server it belongs to."""

    recordings: RecordingServer
    protocol_version = "HTTP/1.1"
    server_version = "rodsight"
    sys_version = ""
    timeout = PATIENCE
    disable_nagle_algorithm = True

    def do_GET(self) -> None:
        parts = urlsplit(self.path)
        query = {key: values[-1] for key, values in parse_qs(parts.query).items()}
        entering = parts.path == "/" and "token" in query
        named = self.recordings.named.get(parts.path)
        refusal = self.recordings.gate.refusal(self.headers, changes=False, entering=entering or named is not None)
        if refusal is not None:
            self.close_connection = True
            self._say(*refusal)
        elif entering and self.recordings.gate.opens(query["token"]):
            place = f"/?renderer={query['renderer']}" if query.get("renderer") in RENDERERS else "/"
            self._send(
                b"", "text/plain", HTTPStatus.SEE_OTHER, Location=place, Set_Cookie=self.recordings.gate.set_cookie
            )
        elif entering:
            self._say(HTTPStatus.FORBIDDEN, "this token is not the one that was printed")
        else:
            self.recordings.asked = time.monotonic()
            self._give(parts.path, named)

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing: the terminal belongs to the person."""

    def _give(self, path: str, recording: Path | None) -> None:
        server = self.recordings
        if path in server.assets:
            self._send(*server.assets[path])
        elif path == "/re_viewer.js":
            self._send(server.viewer().script, "text/javascript; charset=utf-8")
        elif path == "/re_viewer_bg.wasm":
            self._send(server.viewer().module, "application/wasm")
        elif recording is not None:
            self._stream(recording)
        else:
            self._say(HTTPStatus.NOT_FOUND, "there is nothing here")

    def _stream(self, recording: Path) -> None:
        if not recording.is_file():
            self._say(HTTPStatus.NOT_FOUND, "the recording is not there any more")
            return
        self._head("application/octet-stream", HTTPStatus.OK, {"Transfer-Encoding": "chunked"})
        try:
            for piece in self.recordings.pieces(recording):
                self.wfile.write(b"%x\r\n%s\r\n" % (len(piece), piece))
            self.wfile.write(b"0\r\n\r\n")
        except OSError:  # the page went away, or the file: the answer is cut
            self.close_connection = True

    def _say(self, status: HTTPStatus, sentence: str) -> None:
        self._send(sentence.encode(), "text/plain; charset=utf-8", status)

    def _send(self, content: bytes, kind: str, status: HTTPStatus = HTTPStatus.OK, **headers: str) -> None:
        named = {key.replace("_", "-"): value for key, value in headers.items()}
        self._head(kind, status, {"Content-Length": str(len(content)), **named})
        self.wfile.write(content)

    def _head(self, kind: str, status: HTTPStatus, headers: dict[str, str]) -> None:
        self.send_response(status)
        for name, value in {"Content-Type": kind, "Cache-Control": "no-store", **SAFE_HEADERS, **headers}.items():
            self.send_header(name, value)
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
