"""The recorder: one run, frame by frame, into a stream; and a finished run into a file."""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from rerun.chunk import RrdReader

from solver.sequence.frame_forces import FrameForces
from solver.statistics.frame_statistics import FrameStatistics

from ...experiment.units import Scale
from ...results.results import Results, TruthContacts
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
from ..curve_layers.starts import UNKNOWN, StartGauge, Starts, log_start_styles, log_starts
from ..curve_layers.statistics import log_statistics, log_statistics_styles
from ..curve_layers.stress_and_fabric import log_polar_axes, log_rose, log_stress
from ..look import entities
from ..look.canvas import Canvas
from ..look.force_style import ForceRange, ForceStyle
from ..look.legends import log_legends
from ..look.scene import Clock, Scene
from ..look.texts import printable
from ..packing_layers.changes import log_changes
from ..packing_layers.network import SweepChoice, chosen_sweeps, log_network
from ..packing_layers.packing import log_packing
from ..packing_layers.photographs import log_photograph
from ..packing_layers.reviewed import log_reviewed
from ..packing_layers.rods import log_rods
from ..packing_layers.stack import StackWriter
from ..packing_layers.touching import log_touching, log_touching_styles
from ..packing_layers.truth import TruthWriter
from ..packing_layers.unconverged import log_unconverged
from ..summary import FrameFacts, log_summary
from ..tabs.axis_ranges import find_extremes
from ..tabs.blueprint import Layout, Tab, make_blueprint
from ..tabs.layout_property import send_layout
from .properties import send_experiment, send_outcome

Photograph = NDArray[np.uint8]  # (H, W) grey
PhotographSource = Callable[[int], Photograph | None]
Progress = Callable[[int, int], None]  # frames done, frames in all

# Messages are cut by size, never by the clock: the same run makes the same file.
BATCHES = rr.ChunkBatcherConfig(flush_tick=3600.0, flush_num_bytes=1_000_000)

# Frames between two moments at which all that was logged reaches the file: what a cut file may lack at its end.
# Fewer make more and smaller messages.
FLUSHED_FRAMES = 8
SWEEPS_KEPT = 40  # per frame, with SweepChoice.LOG
# What is tried in turn to keep a recording below a size: sweeps per frame.
THINNER = (40, 20, 10, 0)


@dataclass(frozen=True, slots=True)
class RecordingReport:
    """What was written."""

    path: Path
    size: int  # [bytes]
    seconds: float
    frames: int
    network_rows: int  # rows of widths and colours, the reported fields among them
    sweeps: SweepChoice  # as written, which is less than asked for where the size was limited
    sweeps_kept: int | None  # per frame at most, None: every visible one
    clipped: int  # forces above the drawn range
    notes: tuple[str, ...]  # sentences for the user


class Recorder:
    """Writes a run into a stream, one frame at a time. The stream is the caller's: file, socket or memory.

    Call start once, frame for the frames in their order, finish once. starts: whether warm and cold starts are
    measured, which takes sweeps of its own.
    """

    def __init__(
        self,
        stream: rr.RecordingStream,
        *,
        sweeps: SweepChoice = SweepChoice.LOG,
        kept: int = SWEEPS_KEPT,
        flush_every: int = FLUSHED_FRAMES,
        starts: bool = True,
    ) -> None:
        rr.set_strict_mode(True)  # else the SDK warns and leaves out what it could not write
        self._stream = stream
        self._sweeps, self._kept, self._flush_every = sweeps, kept, flush_every
        self._starts = starts
        self._scene: Scene | None = None
        self._truth: TruthWriter | None = None
        self._gauge: StartGauge | None = None
        self._stack: StackWriter | None = None
        self._plot: ResidualPlot | None = None
        self._former: FrameForces | None = None
        self._density = ForceDensity()
        self._facts: list[FrameFacts] = []
        self._next_sweep = 0
        self._swept = False
        self._clipped = self._drawn = 0
        self.network_rows = 0

    @property
    def clipped(self) -> int:
        """Forces so far that are above the drawn range."""
        return self._clipped

    def start(self, scene: Scene) -> None:
        """Write what does not change: styles, axes, legends, the properties of the recording."""
        stream = self._stream
        stream.set_log_time_enabled(False)
        self._scene = scene
        stream.send_recording_name(printable(scene.name))
        send_experiment(stream, scene)
        self._gauge = StartGauge(scene) if self._starts else None
        self._stack = StackWriter(scene)
        self._plot = ResidualPlot(scene.tolerance)
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
        if scene.truth is not None:
            self._truth = TruthWriter(scene, scene.truth)
            self._truth.log_axes(stream)

    def frame(self, forces: FrameForces, statistics: FrameStatistics, photograph: Photograph | None = None) -> None:
        """Write one frame."""
        scene = self._running()
        span = forces.history.count + 1  # the reported field has a place of its own
        clock = Clock(self._stream, forces.frame, self._next_sweep, self._next_sweep + span - 1)
        self._next_sweep += span
        if photograph is not None:
            log_photograph(clock, scene.canvas, photograph)
        log_packing(clock, scene, forces)
        self.network_rows += log_network(clock, scene, forces, self._sweeps, self._kept)
        starts = self._gauge.measure(forces) if self._gauge else UNKNOWN
        log_starts(clock, starts)
        self._log_solve(clock, scene, forces, starts)
        log_unconverged(clock, scene, forces, self._sweeps, self._kept)
        log_touching(clock, scene, forces)
        log_reviewed(clock, scene, forces)
        changes = log_changes(clock, scene, forces, self._former)
        log_settling(clock, scene, forces, changes)
        log_statistics(clock, scene, statistics)
        log_stress(clock, statistics)
        log_rose(clock, forces)
        self._density.log(clock, forces.fn, statistics.tail_exponent)
        log_rods(clock, scene, forces)
        if self._stack is not None:
            self._stack.log(clock, forces)
        agreement = self._truth.log(clock, forces) if self._truth else None
        self._former = forces
        self._clipped += scene.style.clipped(forces.fn)
        self._drawn += len(forces.fn)
        lost = int((~scene.tracks.present[forces.frame]).sum())
        self._facts.append(
            FrameFacts.of(forces, statistics, similarity=changes.similarity, lost=lost, agreement=agreement)
        )
        if len(self._facts) % self._flush_every == 0:
            self._stream.flush()

    def finish(self, notes: tuple[str, ...] = ()) -> None:
        """Write the summary."""
        self._stream.reset_time()
        send_outcome(self._stream, self._facts)
        log_summary(self._stream, self._running(), self._facts, self._clipped, self._drawn, list(notes))

    def _log_solve(self, clock: Clock, scene: Scene, forces: FrameForces, starts: Starts) -> None:
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
            self._plot.log(clock, history, starts, history.recorded[few])

    def _running(self) -> Scene:
        if self._scene is None:
            raise RuntimeError("Recorder.start must come first")
        return self._scene


def record(
    results: Results,
    path: Path | str,
    *,
    photograph: PhotographSource | None = None,
    scale: Scale | None = None,
    sweeps: SweepChoice | str = SweepChoice.LOG,
    truth: TruthContacts | None = None,
    progress: Progress | None = None,
    max_size: int | None = None,
    tolerance: float | None = None,
    active: Tab = Tab.EXPERIMENT,
) -> RecordingReport:
    """Write a run as a recording with its blueprint; an older file is replaced only when the new one is whole.

    photograph: frame → grey picture (H, W) or None; needs `scale`. sweeps: see SweepChoice.
    tolerance: stopping level of the residual, drawn into the plot. max_size [bytes]: fewer sweeps are
    written where the file would be larger; what was left out is said in the report and the summary.
    """
    if photograph is not None and scale is None:
        raise ValueError("photographs need the scale that says where the grains are in them")
    path, begin = Path(path), time.perf_counter()
    first = photograph(0) if photograph else None
    canvas = Canvas.around(results.tracks, scale, None if first is None else (first.shape[0], first.shape[1]))
    scene = Scene(
        results.name, results.tracks, results.walls, results.grains, results.friction, results.configuration, canvas,
        ForceStyle.on(canvas, ForceRange.of(results.frames)), truth, tolerance, results.radius_tuning,
    )  # fmt: skip
    part = path.with_name(path.name + ".part")
    notes: tuple[str, ...] = ()
    plans = _plans(SweepChoice(sweeps), limited=max_size is not None)
    try:
        for number, (choice, kept) in enumerate(plans):
            if number:
                shown = f"{kept} sweeps per frame" if kept else "the reported fields only"
                notes = (f"Limited to {_megabytes(max_size or 0)}: {shown} instead of sweeps = {sweeps}.",)
            last = number == len(plans) - 1
            recorder = _write(
                results, scene, part, choice, kept, photograph, progress, notes, active, None if last else max_size
            )
            if recorder is not None and (max_size is None or part.stat().st_size <= max_size or last):
                break
        else:
            raise AssertionError("the last plan is always written")
        if max_size is not None and part.stat().st_size > max_size:
            notes = (*notes, f"Still larger than {_megabytes(max_size)}: the frames themselves need that much.")
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)
    return RecordingReport(
        path, path.stat().st_size, time.perf_counter() - begin, len(results.frames), recorder.network_rows,
        choice, None if choice is SweepChoice.ALL else kept, recorder.clipped, notes,
    )  # fmt: skip


def layout_of(results: Results, scene: Scene, *, photographs: bool) -> Layout:
    """What the blueprint must know of a finished run."""
    return Layout(
        scene.canvas, scene.rod_length, len(results.frames), photographs, scene.truth is not None, scene.walls.count,
        scene.radius_tuning is not None, find_extremes(results),
    )  # fmt: skip


def _plans(choice: SweepChoice, *, limited: bool) -> list[tuple[SweepChoice, int]]:
    """What to try in turn, fullest first."""
    plans = [(choice, SWEEPS_KEPT)]
    if choice is SweepChoice.NONE:
        return [(choice, 0)]
    if limited:
        thinner = THINNER if choice is SweepChoice.ALL else THINNER[1:]
        plans += [(SweepChoice.LOG if kept else SweepChoice.NONE, kept) for kept in thinner]
    return plans


def _write(
    results: Results,
    scene: Scene,
    part: Path,
    choice: SweepChoice,
    kept: int,
    photograph: PhotographSource | None,
    progress: Progress | None,
    notes: tuple[str, ...],
    active: Tab,
    max_size: int | None,
) -> Recorder | None:
    """Write the whole run to `part`; None, early, where it grows beyond max_size."""
    stream = rr.RecordingStream(entities.APPLICATION_ID, batcher_config=BATCHES)
    layout = layout_of(results, scene, photographs=photograph is not None)
    stream.save(part, default_blueprint=make_blueprint(layout, active=active))
    try:
        recorder = Recorder(stream, sweeps=choice, kept=kept)
        recorder.start(scene)
        send_layout(stream, layout)
        for done, (forces, statistics) in enumerate(zip(results.frames, results.statistics, strict=True)):
            recorder.frame(forces, statistics, photograph(forces.frame) if photograph else None)
            if progress:
                progress(done + 1, len(results.frames))
            if max_size is not None and part.stat().st_size > max_size:
                return None
        recorder.finish(notes)
    finally:
        stream.disconnect()
    _check_whole(part)
    return recorder


def _check_whole(part: Path) -> None:
    """Raise OSError where the end of the file is not there: the stream writes in the background and does not tell."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", rr.error_utils.RerunWarning)  # of a missing end: store() raises for it
            RrdReader(str(part)).store()
    except (RuntimeError, ValueError) as error:
        raise OSError(f"the recording could not be written whole (is the disk full?): {error}") from error


def _megabytes(size: int) -> str:
    return f"{1e-6 * size:.3g} MB"
