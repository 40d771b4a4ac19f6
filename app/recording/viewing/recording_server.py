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
from importlib.resources import files
from pathlib import Path
from typing import IO

from .gate import Gate, QuietServer
from .gated_handler import GatedHandler
from .web_viewer import WebViewer, read_web_viewer

IDLE = 3600.0  # [s] without a question after which a server of its own ends
LOOK = 0.1  # [s] between two looks at a recording that grows
LAST = 5.0  # [s] that those who watch have to take the end of it
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
        self.gate = Handler.gate = Gate(self._http.server_address[1], "view")
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


class _Handler(GatedHandler):
    """One connection. Subclassed with the server it belongs to."""

    recordings: RecordingServer

    def is_open(self, path: str) -> bool:
        return path in self.recordings.named

    def entrance(self, query: dict[str, str]) -> str:
        return f"/?renderer={query['renderer']}" if query.get("renderer") in RENDERERS else "/"

    def give(self, path: str, query: dict[str, str]) -> None:
        self.recordings.asked = time.monotonic()
        self._give(path, self.recordings.named.get(path))

    def _give(self, path: str, recording: Path | None) -> None:
        server = self.recordings
        if path in server.assets:
            self.send(*server.assets[path])
        elif path == "/re_viewer.js":
            self.send(server.viewer().script, "text/javascript; charset=utf-8")
        elif path == "/re_viewer_bg.wasm":
            self.send(server.viewer().module, "application/wasm")
        elif recording is not None:
            self._stream(recording)
        else:
            self.say(HTTPStatus.NOT_FOUND, "there is nothing here")

    def _stream(self, recording: Path) -> None:
        if not recording.is_file():
            self.say(HTTPStatus.NOT_FOUND, "the recording is not there any more")
            return
        self.head("application/octet-stream", HTTPStatus.OK, {"Transfer-Encoding": "chunked"})
        try:
            for piece in self.recordings.pieces(recording):
                self.wfile.write(b"%x\r\n%s\r\n" % (len(piece), piece))
            self.wfile.write(b"0\r\n\r\n")
        except OSError:  # the page went away, or the file: the answer is cut
            self.close_connection = True
