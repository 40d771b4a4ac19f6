"""The recorder: one run, frame by frame, into a stream."""

from __future__ import annotations

from collections.abc import Callable

import rerun as rr

from solver.sequence.frame_forces import FrameForces
from solver.statistics.frame_statistics import FrameStatistics

from ...experiment.shown import ShownPhotograph
from ..curve_layers.convergence import (
    log_residual_styles,
    log_residuals,
    log_tolerance,
    log_tolerance_style,
)
from ..curve_layers.force_density import ForceDensity
from ..curve_layers.radius_curve import log_radius_curve
from ..curve_layers.residual_plot import ResidualPlot
from ..curve_layers.settling import log_settling, log_settling_styles
from ..curve_layers.starts import log_start_styles, log_starts
from ..curve_layers.statistic_curves import log_statistics, log_statistics_styles
from ..curve_layers.stress_and_fabric import log_polar_axes, log_rose, log_stress
from ..look.clock import Clock, StrainWay
from ..look.detail import drawn_contacts, kept_sweeps
from ..look.scene import Scene
from ..look.texts import printable
from ..packing_layers.backdrop import log_photograph
from ..packing_layers.changes import log_changes
from ..packing_layers.film import FilmWriter
from ..packing_layers.forces.force_doubt import log_force_doubt
from ..packing_layers.forces.network import SweepChoice, chosen_sweeps, log_network
from ..packing_layers.forces.true_forces import TruthWriter
from ..packing_layers.grains_and_walls import log_grains_and_walls
from ..packing_layers.legends import log_legends
from ..packing_layers.reviewed import log_reviewed
from ..packing_layers.rods_in_3d import log_rods
from ..packing_layers.touching import log_touching, log_touching_styles
from ..packing_layers.unconverged import log_unconverged
from ..tabs.summary_tab import FrameFacts, log_summary
from .properties import send_experiment, send_outcome

PhotographSource = Callable[[int], ShownPhotograph | None]

# Messages are cut by size, never by the clock: the same run makes the same file.
BATCHES = rr.ChunkBatcherConfig(flush_tick=3600.0, flush_num_bytes=1_000_000)

# Frames between two moments at which all that was logged reaches the file: what a cut file may lack at its end.
# Fewer make more and smaller messages.
FLUSHED_FRAMES = 8
SWEEPS_KEPT = 40  # per frame, with SweepChoice.LOG


class Recorder:
    """Writes a run into a stream, one frame at a time. The stream is the caller's: file, socket or memory.

    Call start once, frame for the frames in their order, finish once.
    """

    def __init__(
        self,
        stream: rr.RecordingStream,
        *,
        sweeps: SweepChoice = SweepChoice.LOG,
        kept: int = SWEEPS_KEPT,
        flush_every: int = FLUSHED_FRAMES,
        flush: Callable[[rr.RecordingStream], None] = rr.RecordingStream.flush,
    ) -> None:
        """flush: has what was logged on its way, every flush_every frames."""
        rr.set_strict_mode(True)  # else the SDK warns and leaves out what it could not write
        self._stream = stream
        self._sweeps, self._kept, self._flush_every, self._flush = sweeps, kept, flush_every, flush
        self._scene: Scene | None = None
        self._truth: TruthWriter | None = None
        self._film: FilmWriter | None = None
        self._plot: ResidualPlot | None = None
        self._former: FrameForces | None = None
        self._density = ForceDensity()
        self._facts: list[FrameFacts] = []
        self._next_sweep = 0
        self._way = StrainWay()
        self._swept = False
        self._clipped = self._drawn = 0
        self.network_rows = 0

    @property
    def clipped(self) -> int:
        """Forces so far that are above the drawn range."""
        return self._clipped

    def start(self, scene: Scene) -> None:
        """Write what does not change: styles, axes, legends, the properties of the recording."""
        self._scene = scene
        self._film = FilmWriter(scene)
        self._plot = ResidualPlot(scene.tolerance)
        if scene.truth is not None:
            self._truth = TruthWriter(scene, scene.truth)
        self._begin(self._stream)

    def go_on(self, stream: rr.RecordingStream, flush: Callable[[rr.RecordingStream], None]) -> None:
        """Write the frames to come into another stream, which has all that does not change as well."""
        self._stream, self._flush, self._swept = stream, flush, False
        self._begin(stream)
        if self._plot is not None:
            self._plot.go_on(stream)

    def _begin(self, stream: rr.RecordingStream) -> None:
        scene = self._running()
        stream.set_log_time_enabled(False)
        stream.send_recording_name(printable(scene.name))
        send_experiment(stream, scene)
        log_settling_styles(stream)
        log_start_styles(stream)
        log_statistics_styles(stream, scene)
        log_touching_styles(stream)
        log_polar_axes(stream)
        log_legends(stream, scene)
        self._density.log_axes(stream)
        if scene.tolerance is not None:
            log_tolerance_style(stream)
        if scene.radius_tuning is not None:
            log_radius_curve(stream, scene.radius_tuning)
        if self._truth is not None:
            self._truth.log_axes(stream)

    def frame(
        self, forces: FrameForces, statistics: FrameStatistics, photograph: ShownPhotograph | None = None
    ) -> None:
        """Write one frame."""
        scene = self._running()
        span = forces.history.count + 1  # the reported field has a place of its own
        time, strain = float(scene.tracks.time[forces.frame]), self._way.go(forces.strain)
        clock = Clock(self._stream, forces.frame, self._next_sweep, self._next_sweep + span - 1, time, strain)
        self._next_sweep += span
        drawn, kept = drawn_contacts(forces), kept_sweeps(self._kept, scene.grains.count)
        if photograph is not None:
            log_photograph(clock, scene.canvas, photograph)
        log_grains_and_walls(clock, scene, forces)
        self.network_rows += log_network(clock, scene, drawn, self._former, self._sweeps, kept)
        log_force_doubt(clock, scene, drawn)
        log_starts(clock, forces)
        self._log_solve(clock, scene, forces)
        log_unconverged(clock, scene, forces, drawn, self._sweeps, kept)
        log_touching(clock, forces)
        log_reviewed(clock, scene, forces)
        log_changes(clock, scene, forces, self._former, drawn.contacts)
        log_settling(clock, scene, forces)
        log_statistics(clock, scene, statistics)
        log_stress(clock, statistics)
        log_rose(clock, forces)
        self._density.log(clock, forces.fn, statistics.tail_exponent)
        log_rods(clock, scene, drawn)
        if self._film is not None:
            self._film.log(clock, drawn)
        agreement = self._truth.log(clock, forces) if self._truth else None
        self._former = forces
        self._clipped += scene.style.clipped(forces.fn)
        self._drawn += len(forces.fn)
        lost = int(scene.tracks.lost[forces.frame].sum())
        self._facts.append(FrameFacts.of(forces, statistics, lost=lost, agreement=agreement))
        if len(self._facts) % self._flush_every == 0:
            self._flush(self._stream)

    def finish(self, notes: tuple[str, ...] = ()) -> None:
        """Write the summary."""
        self._stream.reset_time()
        send_outcome(self._stream, self._facts)
        log_summary(self._stream, self._running(), self._facts, self._clipped, self._drawn, list(notes))

    def _log_solve(self, clock: Clock, scene: Scene, forces: FrameForces) -> None:
        if scene.tolerance is not None:
            log_tolerance(clock, scene.tolerance)
        if forces.history.count == 0:
            return
        if not self._swept:
            log_residual_styles(self._stream)
            self._swept = True
        history = forces.history
        log_residuals(clock, history)
        if self._plot is not None:
            few = chosen_sweeps(history, SweepChoice.LOG, self._kept)
            self._plot.log(clock, history, forces.cold_residual, history.recorded[few])

    def _running(self) -> Scene:
        if self._scene is None:
            raise RuntimeError("Recorder.start must come first")
        return self._scene
