"""The recorder: writes a run into a stream, frame by frame."""

from __future__ import annotations

from collections.abc import Callable

import rerun as rr

from ...drawing.accumulated_strain import AccumulatedStrain
from ...experiment.jpeg_photographs import JpegPhotograph
from ...process.machine.free_memory import release_free_memory
from ...solver.frame_forces import FrameForces
from ...solver.statistics.frame_statistics import FrameStatistics
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
from ..curve_layers.statistic_curves import log_statistics, log_statistics_styles
from ..curve_layers.stress_and_fabric import log_polar_axes, log_rose, log_stress
from ..look.clock import Clock
from ..look.level_of_detail import drawn_contacts, kept_sweeps
from ..look.printable_text import printable
from ..look.scene import Scene
from ..packing_layers.captions import log_caption, log_card
from ..packing_layers.contact_changes import log_changes
from ..packing_layers.film import FilmWriter
from ..packing_layers.forces.force_uncertainty import log_force_uncertainty
from ..packing_layers.forces.network import SweepChoice, chosen_sweeps, log_network
from ..packing_layers.forces.true_forces import TruthWriter
from ..packing_layers.grain_maps.fringe_maps import FringeMaps
from ..packing_layers.grain_maps.kinematic_maps import KinematicMaps
from ..packing_layers.grains_and_walls import log_grains_and_walls
from ..packing_layers.legends import log_legends
from ..packing_layers.photograph import log_photograph
from ..packing_layers.residual_maps import log_residual_maps
from ..packing_layers.rods_in_3d import log_rods
from ..packing_layers.verdict_lines import log_verdicts
from ..tabs.summary_tab import FrameSummary, log_summary
from .properties import send_experiment, send_outcome
from .row_batches import RowBatches

PhotographSource = Callable[[int], JpegPhotograph | None]

# Messages are divided by size, never by time: the same run gives the same file.
BATCHES = rr.ChunkBatcherConfig(flush_tick=3600.0, flush_num_bytes=1_000_000)

FRAMES_PER_FLUSH = 5  # where rows wait until they are many: bounds what the stream holds
SWEEPS_KEPT = 40  # per frame, with SweepChoice.LOG


class Recorder:
    """Writes a run into a stream, one frame at a time: `start` once, `frame` for every frame in order, `finish` once.

    Parameters
    ----------
    stream : RecordingStream
        The stream: file, socket or memory.
    sweeps : SweepChoice
        The sweeps that are recorded.
    kept : int
        Sweeps per frame, with SweepChoice.LOG.
    send_every : int, optional
        Frames after which all rows are sent, and an incomplete file holds them. Default: rows wait until they are many,
        because the index of a file takes memory for every message.
    flush : callable
        Sends all logged data of the stream.
    """

    def __init__(
        self,
        stream: rr.RecordingStream,
        *,
        sweeps: SweepChoice = SweepChoice.LOG,
        kept: int = SWEEPS_KEPT,
        send_every: int | None = None,
        flush: Callable[[rr.RecordingStream], None] = rr.RecordingStream.flush,
    ) -> None:
        rr.set_strict_mode(True)  # otherwise the SDK only warns about data that it cannot write
        self._stream = stream
        self._sweeps, self._kept, self._send_every, self._flush = sweeps, kept, send_every, flush
        self._rows = RowBatches(stream, flush)
        self._scene: Scene | None = None
        self._truth: TruthWriter | None = None
        self._film: FilmWriter | None = None
        self._grain_maps: list[KinematicMaps | FringeMaps] = []
        self._plot: ResidualPlot | None = None
        self._previous: FrameForces | None = None
        self._density = ForceDensity()
        self._summaries: list[FrameSummary] = []
        self._next_sweep = 0
        self._strain = AccumulatedStrain()
        self._has_residual_styles = False
        self._clipped = self._force_count = 0
        self.network_rows = 0

    @property
    def clipped(self) -> int:
        """Number of forces so far above the drawn range."""
        return self._clipped

    def start(self, scene: Scene) -> None:
        """Write the static data: styles, axes, legends and properties of the recording."""
        self._scene = scene
        self._film = FilmWriter(scene)
        self._plot = ResidualPlot(scene.tolerance)
        if scene.kinematics is not None:
            self._grain_maps.append(KinematicMaps(scene, scene.kinematics))
        if scene.fringes is not None and scene.tracks.fringes is not None:
            self._grain_maps.append(FringeMaps(scene, scene.fringes, scene.tracks.fringes))
        if scene.truth is not None:
            self._truth = TruthWriter(scene, scene.truth)
        self._begin(self._stream)

    def continue_in(self, stream: rr.RecordingStream, flush: Callable[[rr.RecordingStream], None]) -> None:
        """Write the next frames into another stream, which gets the static data as well."""
        self._stream, self._flush, self._has_residual_styles = stream, flush, False
        self._rows = RowBatches(stream, flush)
        self._begin(stream)
        if self._plot is not None:
            self._plot.continue_in(stream)

    def _begin(self, stream: rr.RecordingStream) -> None:
        scene = self._running()
        stream.set_log_time_enabled(False)
        stream.send_recording_name(printable(scene.name))
        send_experiment(stream, scene)
        log_settling_styles(stream)
        log_statistics_styles(stream, scene)
        log_polar_axes(stream)
        log_legends(stream, scene)
        self._density.log_axes(stream)
        if scene.tolerance is not None:
            log_tolerance_style(stream)
        if scene.radius_tuning is not None:
            log_radius_curve(stream, scene.radius_tuning)
        if self._film is not None:
            self._film.log_keys(stream)
        for each in self._grain_maps:
            each.log_styles(stream)
        if self._truth is not None:
            self._truth.log_axes(stream)

    def frame(self, forces: FrameForces, statistics: FrameStatistics, photograph: JpegPhotograph | None = None) -> None:
        """Write one frame."""
        scene = self._running()
        span = forces.history.count + 1  # one row for the reported forces
        time, strain = float(scene.tracks.time[forces.frame]), self._strain.add(forces.strain)
        clock = Clock(
            self._stream, forces.frame, self._next_sweep, self._next_sweep + span - 1, time, strain, self._rows
        )
        self._next_sweep += span
        drawn, kept = drawn_contacts(forces), kept_sweeps(self._kept, scene.grains.count)
        if photograph is not None:
            log_photograph(clock, scene.canvas, photograph)
        log_caption(clock, scene, forces)
        log_card(clock, scene, forces, statistics)
        log_grains_and_walls(clock, scene, forces)
        self.network_rows += log_network(clock, scene, drawn, self._previous, self._sweeps, kept)
        log_force_uncertainty(clock, scene, drawn)
        self._log_solve(clock, scene, forces)
        log_residual_maps(clock, scene, forces, drawn, self._sweeps, kept)
        log_verdicts(clock, scene, forces)
        log_changes(clock, scene, forces, self._previous, drawn.contacts)
        log_settling(clock, scene, forces)
        log_statistics(clock, scene, statistics)
        log_stress(clock, statistics)
        log_rose(clock, forces)
        self._density.log(clock, forces.fn, statistics.tail_exponent)
        log_rods(clock, scene, drawn)
        if self._film is not None:
            self._film.log(clock, drawn)
        for each in self._grain_maps:
            each.log(clock)
        agreement = self._truth.log(clock, forces) if self._truth else None
        self._previous = forces
        self._clipped += scene.style.clipped(forces.fn)
        self._force_count += len(forces.fn)
        lost = int(scene.tracks.frame(forces.frame).lost[0].sum())
        self._summaries.append(FrameSummary.of(forces, statistics, lost=lost, agreement=agreement))
        if self._send_every and len(self._summaries) % self._send_every == 0:
            self._rows.send()
        if len(self._summaries) % (self._send_every or FRAMES_PER_FLUSH) == 0:
            self._flush(self._stream)
            release_free_memory()  # messages leave holes between the rows that wait: a fifth of all; it takes 3 ms

    def finish(self, notes: tuple[str, ...] = ()) -> None:
        """Write the summary."""
        self._rows.send()
        self._stream.reset_time()
        send_outcome(self._stream, self._summaries)
        clipped, total = self._clipped, self._force_count
        log_summary(self._stream, self._running(), self._summaries, clipped, total, list(notes))

    def _log_solve(self, clock: Clock, scene: Scene, forces: FrameForces) -> None:
        if scene.tolerance is not None:
            log_tolerance(clock, scene.tolerance)
        if forces.history.count == 0:
            return
        if not self._has_residual_styles:
            log_residual_styles(self._stream)
            self._has_residual_styles = True
        history = forces.history
        log_residuals(clock, forces)
        if self._plot is not None:
            marked = chosen_sweeps(history, SweepChoice.LOG, self._kept)
            self._plot.log(clock, forces, history.recorded[marked])

    def _running(self) -> Scene:
        if self._scene is None:
            raise RuntimeError("call Recorder.start first")
        return self._scene
