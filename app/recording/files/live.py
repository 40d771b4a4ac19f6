"""A recording that can be watched while it is made: a file, and a page on this machine that shows it as it grows.

The page is behind the gate: it answers on 127.0.0.1 only, to the address that was printed. Every finished frame reaches
the file before the next one begins, so that a run that is interrupted, or killed, leaves a recording that opens. So as
to keep up with the solve it keeps fewer sweeps than the full recording, which takes its place at the end. It runs in a
process of its own (live_process), which the solve does not wait for.

To watch a run on another machine, forward the port, under the same number, and open the printed address here:

    ssh -L 9090:localhost:9090 HOST
"""

from __future__ import annotations

import socket
import subprocess
import threading
import webbrowser
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path

import rerun as rr

from solver.sequence.frame_forces import FrameForces
from solver.statistics.frame_statistics import FrameStatistics

from ...experiment.units import Scale
from ...results.results import Results
from ..look import entities
from ..look.canvas import Canvas
from ..look.force_style import ForceRange, ForceStyle
from ..look.scene import Scene, tracks_in_cell
from ..packing_layers.forces.network import SweepChoice
from ..tabs.blueprint import Layout, make_blueprint
from ..tabs.layout_property import send_layout
from ..viewing.headless import free_port
from ..viewing.recording_server import RecordingServer, grown
from ..viewing.viewer import ViewerKind, has_display, viewer_binary, viewer_environment
from .recorder import BATCHES, PhotographSource, Recorder
from .writing import WrittenFile, writing

PAGE_PORT = 9090  # where it is free
SWEEPS_KEPT = 20  # per frame: the pictures must keep up with the solve
HEADROOM = 1.3  # of the drawn range over the greatest forces of the first frame: those of the run are not known yet


class LiveRecording:
    """Records a run while it is solved. Call start, frame for every frame in order, then finish; close in any case."""

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
        self.address = ""  # of the page, where there is one
        self.hint = ""  # one line that says how to watch
        self.notes: list[str] = []  # what went wrong with watching, if anything
        self._kind = ViewerKind(viewer)
        self._photograph, self._scale = photograph, scale
        self._sweeps = SweepChoice(sweeps)
        self._stream: rr.RecordingStream | None = None
        self._server: RecordingServer | None = None
        self._viewer: subprocess.Popen[bytes] | None = None
        self._whole = threading.Event()
        self._written: WrittenFile | None = None
        self._open = ExitStack()
        self._recorder: Recorder | None = None
        self._run: Results | None = None

    def start(self, run: Results) -> None:
        """Open the server, the file and the viewer; `run` has bodies and motion, its frames are still to come."""
        run = replace(run, tracks=tracks_in_cell(run.tracks, run.walls))
        self._run = run
        self.path.parent.mkdir(parents=True, exist_ok=True)
        stream = rr.RecordingStream(entities.APPLICATION_ID, batcher_config=BATCHES)
        first = self._photograph(0) if self._photograph else None
        canvas = Canvas.around(run.tracks, self._scale, None if first is None else first.shape)
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
        """End file, server and page. What a viewer has got stays on its screen."""
        try:
            self._open.close()
        finally:
            self._stream = None
            self._whole.set()
            if self._server is not None:
                self._server.close()
                self._server = None

    def _begin(self, forces: FrameForces) -> Recorder:
        run = self._run
        assert run is not None
        seen = ForceRange.of([forces])
        style = ForceStyle.on(self._canvas, ForceRange(seen.mean, HEADROOM * seen.top))
        scene = Scene(run.name, run.tracks, run.walls, run.grains, run.friction, run.configuration, self._canvas, style)
        recorder = Recorder(self._running(), sweeps=self._sweeps, kept=SWEEPS_KEPT, flush_every=1)
        recorder.start(scene)
        send_layout(self._running(), self._layout(run, self._canvas))
        return recorder

    def _layout(self, run: Results, canvas: Canvas) -> Layout:
        style = ForceStyle.on(canvas, ForceRange(1.0, 4.0))
        scene = Scene(run.name, run.tracks, run.walls, run.grains, run.friction, run.configuration, canvas, style)
        photographs = self._photograph is not None
        return Layout(canvas, scene.rod_length, run.tracks.frame_count, photographs, False, run.walls.count)

    def _open_viewer(self) -> None:
        """Serve the page, or start the viewer; where there is no display, only say how to look."""
        if self._kind is ViewerKind.WEB:
            self._server = RecordingServer([self.path], _port(PAGE_PORT), grows=True)
            self.address, port = self._server.address, self._server.port
            self.hint = f"Watch it at {self.address} (from another machine: ssh -L {port}:localhost:{port} HOST)"
            if has_display():
                webbrowser.open(self.address)
        elif self._kind is ViewerKind.NATIVE and has_display():
            self._viewer = subprocess.Popen(
                [str(viewer_binary()), "--hide-welcome-screen", "-"],
                env=viewer_environment(), stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                start_new_session=True,
            )  # fmt: skip
            threading.Thread(target=self._feed, args=(self._viewer,), daemon=True).start()
            self.hint = "Watch it in the viewer's window."
        elif self._kind is ViewerKind.NATIVE:
            self.hint = "No display here. To watch it in a browser: --view web"

    def _feed(self, viewer: subprocess.Popen[bytes]) -> None:
        """Hand a viewer the file as it grows: what it reads from no port, no stranger can."""
        assert viewer.stdin is not None
        with suppress(OSError), self.path.open("rb") as file, viewer.stdin as pipe:  # its window was closed
            for piece in grown(file, self._whole):
                pipe.write(piece)
                pipe.flush()

    def _running(self) -> rr.RecordingStream:
        if self._stream is None:
            raise RuntimeError("LiveRecording.start must come first")
        return self._stream


def _port(wanted: int) -> int:
    """The wanted port if nobody has it, else any other."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", wanted))
        except OSError:
            return free_port()
    return wanted
