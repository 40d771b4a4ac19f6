"""A recording that can be watched while it is made: a server for viewers on this machine beside a file.

The server answers on 127.0.0.1 only and keeps at most MEMORY_LIMIT of what was logged; a viewer that opens late sees
what it still has. The file has everything, and every finished frame reaches it before the next one begins, so that a
run that is interrupted, or killed, leaves a recording that opens. So as to keep up with the solve it keeps fewer
sweeps than the full recording, which takes its place at the end. It runs in a
process of its own (live_process), which the solve does not wait for.

To watch a run on another machine, forward both ports, under the same numbers, and open the printed address here:

    ssh -L 9090:localhost:9090 -L 9876:localhost:9876 HOST
"""

from __future__ import annotations

import shlex
import socket
import subprocess
from collections.abc import Callable
from pathlib import Path
from urllib.parse import quote

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from solver.sequence.frame_forces import FrameForces
from solver.statistics.frame_statistics import FrameStatistics

from ...experiment.units import Scale
from ...results.results import Results
from ..look import entities
from ..look.canvas import Canvas
from ..look.force_style import ForceRange, ForceStyle
from ..look.scene import Scene
from ..packing_layers.network import SweepChoice
from ..tabs.blueprint import Layout, make_blueprint
from ..tabs.layout_property import send_layout
from ..viewing.headless import free_port
from ..viewing.viewer import ViewerKind, has_display, viewer_binary
from .recorder import BATCHES, Recorder

MEMORY_LIMIT = "512MiB"  # of what the server keeps for viewers that open late; the oldest goes first
DATA_PORT, PAGE_PORT = 9876, 9090  # where they are free
FLUSH_SECONDS = 5.0  # for one frame to reach the file
SWEEPS_KEPT = 20  # per frame: the pictures must keep up with the solve
HEADROOM = 1.3  # of the drawn range over the greatest forces of the first frame: those of the run are not known yet

Photograph = Callable[[int], NDArray[np.uint8] | None]


class LiveRecording:
    """Records a run while it is solved. Call start, frame for every frame in order, then finish; close in any case."""

    def __init__(
        self,
        path: Path | str,
        viewer: ViewerKind | str = ViewerKind.NONE,
        *,
        photograph: Photograph | None = None,
        scale: Scale | None = None,
        sweeps: SweepChoice | str = SweepChoice.LOG,
    ) -> None:
        self.path = Path(path)
        self.address = ""  # of the page, or of the data for a native viewer
        self.hint = ""  # one line that says how to watch
        self.notes: list[str] = []  # what went wrong with watching, if anything
        self._kind = ViewerKind(viewer)
        self._photograph, self._scale = photograph, scale
        self._sweeps = SweepChoice(sweeps)
        self._stream: rr.RecordingStream | None = None
        self._viewer: subprocess.Popen[bytes] | None = None
        self._recorder: Recorder | None = None
        self._run: Results | None = None

    def start(self, run: Results) -> None:
        """Open the server, the file and the viewer; `run` has bodies and motion, its frames are still to come."""
        self._run = run
        self.path.parent.mkdir(parents=True, exist_ok=True)
        port = _port(DATA_PORT)
        data = f"rerun+http://127.0.0.1:{port}/proxy"
        stream = rr.RecordingStream(entities.APPLICATION_ID, batcher_config=BATCHES)
        first = self._photograph(0) if self._photograph else None
        canvas = Canvas.around(run.tracks, self._scale, None if first is None else (first.shape[0], first.shape[1]))
        self._canvas = canvas
        stream.set_sinks(
            rr.GrpcServerSink("127.0.0.1", port, server_memory_limit=MEMORY_LIMIT),
            rr.FileSink(self.path),
            default_blueprint=make_blueprint(self._layout(run, canvas), following=True),
        )
        self._stream = stream
        self._open_viewer(data)

    def frame(self, forces: FrameForces, statistics: FrameStatistics) -> None:
        """Record one finished frame."""
        stream, recorder = self._running(), self._recorder
        if recorder is None:
            recorder = self._recorder = self._begin(forces)
        photograph = self._photograph(forces.frame) if self._photograph else None
        recorder.frame(forces, statistics, photograph)
        try:
            stream.flush(timeout_sec=FLUSH_SECONDS)
        except (RuntimeError, TimeoutError, ValueError) as error:  # a slow disk or viewer must not end the run
            self.notes.append(f"Frame {forces.frame} did not reach the file within {FLUSH_SECONDS:g} s: {error}")

    def finish(self, notes: tuple[str, ...] = ()) -> None:
        """Write the summary."""
        if self._recorder is not None:
            self._recorder.finish((*notes, *self.notes))

    def close(self) -> None:
        """End server, file and page. What a viewer has got stays on its screen."""
        if self._stream is not None:
            self._stream.disconnect()
            self._stream = None
        if self._viewer is not None and self._kind is ViewerKind.WEB:
            self._viewer.terminate()
            self._viewer.wait(10)
        self._viewer = None

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

    def _open_viewer(self, data: str) -> None:
        """Start the viewer or the page; where there is no display, only say how to look."""
        options: list[str] = []
        self.address = data
        if self._kind is ViewerKind.WEB:
            port = _port(PAGE_PORT)
            self.address = f"http://127.0.0.1:{port}/?url={quote(data, safe='')}"
            how = "--web-viewer" if has_display() else "--serve-web"
            options = [how, "--bind", "127.0.0.1", "--web-viewer-port", str(port), data]
            page, server = port, int(data.rsplit(":", 1)[1].split("/")[0])
            self.hint = (
                f"Watch it at {self.address} (from another machine: ssh -L {page}:localhost:{page} "
                f"-L {server}:localhost:{server} HOST)"
            )
        elif self._kind is ViewerKind.NATIVE and has_display():
            options = ["--connect", data, "--hide-welcome-screen"]
            self.hint = "Watch it in the viewer's window."
        elif self._kind is ViewerKind.NATIVE:
            self.hint = f"No display here. To watch it: rerun --connect {shlex.quote(data)}, or --view web"
        if options:
            self._viewer = subprocess.Popen(
                [str(viewer_binary()), *options],
                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
            )  # fmt: skip

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
