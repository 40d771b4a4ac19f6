"""A recording of a run that is being solved: a file, and a page on this machine that shows it as it grows.

The page is behind the gate: it answers on 127.0.0.1 only, at the printed address. Every finished frame is written to
the file before the next begins, so that an interrupted or killed run leaves a recording that opens. It keeps fewer
sweeps than the full recording, which replaces it at the end. It is written by a process of its own (live_process), for
which the solve does not wait.

To watch a run on another machine, forward the port under the same number and open the printed address here:

    ssh -L 9090:localhost:9090 HOST
"""

from __future__ import annotations

import socket
import subprocess
import threading
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path

import rerun as rr

from ...drawing.force_range import ForceRange
from ...experiment.units import Scale
from ...process.machine.browser import open_page
from ...results.results import Results
from ...solver.frame_forces import FrameForces
from ...solver.statistics.frame_statistics import FrameStatistics
from ..look import entities
from ..look.canvas import Canvas
from ..look.force_style import ForceStyle
from ..look.scene import Scene, tracks_in_cell
from ..packing_layers.forces.network import SweepChoice
from ..tabs.blueprint import RecordingLayout, make_blueprint
from ..tabs.layout_property import send_layout
from ..viewing.recording_server import RecordingServer, read_growing_file
from ..viewing.viewer import ViewerKind, free_port, has_display, start_viewer
from .recorder import BATCHES, PhotographSource, Recorder
from .writing import WrittenFile, writing

PAGE_PORT = 9090  # the port of the page, if it is free
SWEEPS_KEPT = 20  # per frame: few, to keep up with the solve
HEADROOM = 1.3  # drawn range over the greatest forces of the first frame, as those of the run are not known yet


class LiveRecording:
    """Records a run while it is solved: `start`, `frame` for every frame in order, `finish`; `close` in any case.

    Parameters
    ----------
    path : Path or str
        The recording.
    viewer : ViewerKind or str
        How it is shown: window, browser or not at all.
    photograph : callable, optional
        Returns the photograph of a frame as it is shown, or None.
    scale : Scale, optional
        Place and size of the grains in the photographs.
    sweeps : SweepChoice or str
        The sweeps that are recorded.
    """

    def __init__(
        self,
        path: Path | str,
        viewer: ViewerKind | str = ViewerKind.NONE,
        *,
        photograph: PhotographSource | None = None,
        scale: Scale | None = None,
        sweeps: SweepChoice | str = SweepChoice.LOG,
    ) -> None:
        self.path = Path(path)
        self.address = ""  # of the page; empty: none
        self.hint = ""  # one line on how to watch the run
        self.notes: list[str] = []  # errors of the live view
        self._kind = ViewerKind(viewer)
        self._photograph, self._scale = photograph, scale
        self._sweeps = SweepChoice(sweeps)
        self._stream: rr.RecordingStream | None = None
        self._server: RecordingServer | None = None
        self._viewer: subprocess.Popen[bytes] | None = None
        self._complete = threading.Event()
        self._written: WrittenFile | None = None
        self._open = ExitStack()
        self._recorder: Recorder | None = None
        self._run: Results | None = None

    def start(self, run: Results) -> None:
        """Open server, file and viewer; `run` has bodies and motion, but no solved frames yet."""
        run = replace(run, tracks=tracks_in_cell(run.tracks, run.walls))
        self._run = run
        self.path.parent.mkdir(parents=True, exist_ok=True)
        stream = rr.RecordingStream(entities.APPLICATION_ID, batcher_config=BATCHES)
        first = self._photograph(0) if self._photograph else None
        shape = None if first is None else first.shape
        canvas = Canvas.around(run.tracks, self._scale, shape, run.walls)
        self._canvas = canvas
        blueprint = make_blueprint(self._layout(run, canvas), following=True)
        self._written = self._open.enter_context(writing(stream, self.path, blueprint))
        self._stream = stream
        self._open_viewer()

    def frame(self, forces: FrameForces, statistics: FrameStatistics) -> None:
        """Record one finished frame."""
        stream, recorder = self._running(), self._recorder
        if recorder is None:
            recorder = self._recorder = self._begin(forces)
        photograph = self._photograph(forces.frame) if self._photograph else None
        recorder.frame(forces, statistics, photograph)
        assert self._written is not None
        self._written.flush(stream)

    def finish(self, notes: tuple[str, ...] = ()) -> None:
        """Write the summary."""
        if self._recorder is not None:
            self._recorder.finish((*notes, *self.notes))

    def close(self) -> None:
        """Close file, server and page; a viewer keeps the data that it has received."""
        try:
            self._open.close()
        finally:
            self._stream = None
            self._complete.set()
            if self._server is not None:
                self._server.close()
                self._server = None

    def _begin(self, forces: FrameForces) -> Recorder:
        run = self._run
        assert run is not None
        first = ForceRange.of([forces])
        style = ForceStyle.on(self._canvas, ForceRange(first.mean, HEADROOM * first.top))
        scene = Scene(run.name, run.tracks, run.walls, run.grains, run.friction, run.configuration, self._canvas, style)
        recorder = Recorder(self._running(), sweeps=self._sweeps, kept=SWEEPS_KEPT, send_every=1)
        recorder.start(scene)
        send_layout(self._running(), self._layout(run, self._canvas))
        return recorder

    def _layout(self, run: Results, canvas: Canvas) -> RecordingLayout:
        style = ForceStyle.on(canvas, ForceRange(1.0, 4.0))
        scene = Scene(run.name, run.tracks, run.walls, run.grains, run.friction, run.configuration, canvas, style)
        photographs = self._photograph is not None
        return RecordingLayout(canvas, scene.rod_length, run.tracks.frame_count, photographs, False, run.walls.count)

    def _open_viewer(self) -> None:
        """Serve the page or start the viewer; without a display only set the hint."""
        if self._kind is ViewerKind.WEB:
            self._server = RecordingServer([self.path], _port(PAGE_PORT), growing=True)
            self.address, port = self._server.address, self._server.port
            self.hint = f"Watch it at {self.address} (from another machine: ssh -L {port}:localhost:{port} HOST)"
            if has_display():
                open_page(self.address)
        elif self._kind is ViewerKind.NATIVE and has_display():
            self._viewer = start_viewer("--hide-welcome-screen", "-", stdin=subprocess.PIPE, stays=True)
            threading.Thread(target=self._feed, args=(self._viewer,), daemon=True).start()
            self.hint = "Watch it in the viewer's window."
        elif self._kind is ViewerKind.NATIVE:
            self.hint = "No display here. To watch it in a browser: --view web"

    def _feed(self, viewer: subprocess.Popen[bytes]) -> None:
        """Write the file to the viewer's standard input as it grows: no port is opened that others could read."""
        assert viewer.stdin is not None
        with suppress(OSError), self.path.open("rb") as file, viewer.stdin as pipe:  # its window was closed
            for piece in read_growing_file(file, self._complete):
                pipe.write(piece)
                pipe.flush()

    def _running(self) -> rr.RecordingStream:
        if self._stream is None:
            raise RuntimeError("call LiveRecording.start first")
        return self._stream


def _port(preferred: int) -> int:
    """Return the preferred port if it is free, otherwise another."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", preferred))
        except OSError:
            return free_port()
    return preferred
