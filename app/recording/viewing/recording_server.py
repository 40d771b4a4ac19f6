"""Serves recordings to a browser on this machine: page, viewer and files from one server behind the gate.

The viewer's own server sends a recording to any client, also to a page of another site whose name was made to resolve
to this machine. This server has a fixed list of paths and requires the printed token. A recording that is still being
written is sent as it grows.
"""

from __future__ import annotations

import os
import secrets
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from http import HTTPStatus
from importlib.resources import files
from pathlib import Path
from typing import IO

from ...process.machine.browser import open_page
from .gate import Gate, QuietServer
from .gated_handler import GatedHandler
from .web_viewer import WebViewer, read_web_viewer

IDLE_LIMIT = 3600.0  # [s] without a request after which a server process ends
POLL_INTERVAL = 0.1  # [s] between two reads of a growing recording
CLOSE_TIMEOUT = 5.0  # [s] in which clients can receive the end of a recording
PIECE_SIZE = 1 << 20  # [bytes]
RENDERERS = ("webgl", "webgpu")
BROWSER = "browser"  # argument of the server process: open the page
COMMAND = f"from {__name__} import run_server_process; run_server_process()"

_PAGE = {
    "/": ("recording_page.html", "text/html; charset=utf-8"),
    "/page.css": ("recording_page.css", "text/css; charset=utf-8"),
    "/page.js": ("recording_page.js", "text/javascript; charset=utf-8"),
}


class RecordingServer:
    """Serves recordings on 127.0.0.1.

    Parameters
    ----------
    recordings : sequence of Path
        The files, in the order of their paths on the server.
    port : int
        The port; 0: a free one.
    growing : bool
        The file is still being written.
    """

    def __init__(self, recordings: Sequence[Path], port: int = 0, *, growing: bool = False) -> None:
        self.recordings = tuple(recordings)
        self.last_request = time.monotonic()
        self._complete = threading.Event()
        self._client_count = 0
        self._client_left = threading.Condition()
        if not growing:
            self._complete.set()
        server = self

        class Handler(_Handler):
            recordings = server

        self._http = QuietServer(("127.0.0.1", port), Handler)
        self.gate = Handler.gate = Gate(self._http.server_address[1], "view")
        folder = files(__name__.rpartition(".")[0]).joinpath("pages")
        self.assets = {path: (folder.joinpath(name).read_bytes(), kind) for path, (name, kind) in _PAGE.items()}
        page, kind = self.assets["/"]
        # The viewer requests the recording without a cookie; only the page contains its address.
        key = secrets.token_urlsafe(32)
        page = page.replace(b"@FILES@", str(len(self.recordings)).encode()).replace(b"@KEY@", key.encode())
        self.assets["/"] = (page, kind)
        self.recording_paths = {f"/{key}/{number}.rrd": file for number, file in enumerate(self.recordings)}
        self._viewer: WebViewer | None = None
        self._lock = threading.Lock()
        threading.Thread(target=self._http.serve_forever, args=(0.2,), daemon=True).start()

    @property
    def address(self) -> str:
        """The address to open first, with its token."""
        return self.gate.address

    @property
    def port(self) -> int:
        """The port of the server."""
        return self.gate.port

    def viewer(self) -> WebViewer:
        """Return the files of the web viewer, read once."""
        with self._lock:
            if self._viewer is None:
                self._viewer = read_web_viewer()
            return self._viewer

    def read_pieces(self, recording: Path) -> Iterator[bytes]:
        """Yield the content of a recording, piece by piece, until it is complete."""
        with self._client_left:
            self._client_count += 1
        try:
            with recording.open("rb") as stream:
                yield from read_growing_file(stream, self._complete)
        finally:
            with self._client_left:
                self._client_count -= 1
                self._client_left.notify_all()

    def close(self) -> None:
        """Send the rest of the complete recording to all clients and end the server."""
        self._complete.set()
        with self._client_left:
            self._client_left.wait_for(lambda: self._client_count == 0, CLOSE_TIMEOUT)
        self._http.shutdown()
        self._http.server_close()


def read_growing_file(stream: IO[bytes], complete: threading.Event) -> Iterator[bytes]:
    """Yield the content of a file while it is written, until the event `complete` is set."""
    while True:
        last = complete.is_set()  # read before the file, or its end could be missed
        while piece := stream.read(PIECE_SIZE):
            yield piece
        if last:
            return
        complete.wait(POLL_INTERVAL)


def start_server_process(recordings: Sequence[Path], *, browser: bool = False) -> str:
    """Serve recordings from a process that outlives this one, and opens the page where a browser is wanted.

    Returns
    -------
    str
        The address to open.

    Raises
    ------
    OSError
        If the server does not start.
    """
    process = subprocess.Popen(
        [sys.executable, "-c", COMMAND, BROWSER if browser else "", *map(str, recordings)],
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, map(os.path.abspath, sys.path)))},
        start_new_session=True,
    )  # fmt: skip
    assert process.stdout is not None
    with process.stdout as output:
        address = output.readline().strip()
    if not address:
        raise OSError("the server of the page did not start: run the command again, or without --web")
    return address


def run_server_process() -> None:
    """Print the address and serve the recordings of the command line until IDLE_LIMIT passes without a request."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())  # removes files that are registered for it
    wanted, *files = sys.argv[1:]
    server = RecordingServer([Path(each) for each in files])
    print(server.address, flush=True)
    sys.stdout.close()
    if wanted == BROWSER:
        open_page(server.address)  # here: the file that leads to the page is removed when its token ends
    while (rest := IDLE_LIMIT - (time.monotonic() - server.last_request)) > 0:
        time.sleep(rest)
    server.close()


class _Handler(GatedHandler):
    """One connection; a subclass names its server."""

    recordings: RecordingServer

    def is_open(self, path: str) -> bool:
        return path in self.recordings.recording_paths

    def first_page(self, query: dict[str, str]) -> str:
        return f"/?renderer={query['renderer']}" if query.get("renderer") in RENDERERS else "/"

    def answer_get(self, path: str, query: dict[str, str]) -> None:
        self.recordings.last_request = time.monotonic()
        self._answer(path, self.recordings.recording_paths.get(path))

    def _answer(self, path: str, recording: Path | None) -> None:
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
            self.send_text(HTTPStatus.NOT_FOUND, "there is nothing here")

    def _stream(self, recording: Path) -> None:
        if not recording.is_file():
            self.send_text(HTTPStatus.NOT_FOUND, "the recording is not there any more: it was moved or deleted")
            return
        self.head("application/octet-stream", HTTPStatus.OK, {"Transfer-Encoding": "chunked"})
        try:
            for piece in self.recordings.read_pieces(recording):
                self.wfile.write(b"%x\r\n%s\r\n" % (len(piece), piece))
            self.wfile.write(b"0\r\n\r\n")
        except OSError:  # the client disconnected or the file was removed: the answer is incomplete
            self.close_connection = True
