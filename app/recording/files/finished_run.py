"""Writes a finished run as a recording, within a size limit; the file is replaced only by a complete one."""

from __future__ import annotations

import errno
import os
import shutil
import struct
import time
import uuid
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import rerun as rr

from ...experiment.units import Scale
from ...process.atomic import replacing
from ...process.errors import RunError
from ...process.machine.free_memory import release_free_memory, return_large_blocks
from ...results.results import Results, TruthContacts
from ..look import entities
from ..look.canvas import Canvas
from ..look.force_style import ForceStyle
from ..look.level_of_detail import describe_detail
from ..look.scene import Scene, tracks_in_cell
from ..packing_layers.forces.network import SweepChoice
from ..parts import part_of, remove_parts
from ..tabs.blueprint import RecordingLayout, Tab, make_blueprint
from ..tabs.layout_property import send_layout
from .recorder import BATCHES, SWEEPS_KEPT, PhotographSource, Recorder
from .run_survey import Survey, survey_frames
from .writing import writing

FrameProgress = Callable[[int, int], None]  # frames done, frames in all

PART_FRAMES = 2000  # frames in one file: with more the viewer opens it slowly
FILE_END = struct.Struct("<QQI4s4sI")  # of a recording: place, length and checksum of its index; marks; their number
END_MARKS = [b"RRF2", b"FOOT", 1]
MIN_ROWS = 4  # sweeps per frame that even a short solve keeps
BYTES_PER_CONTACT = 8  # per row, at least: a width and a colour

# Sweeps per frame that are tried in turn to keep a recording below a size.
SWEEP_LIMITS = (40, 20, 10, 0)


@dataclass(frozen=True, slots=True)
class RecordingOptions:
    """The extent of a recording.

    If the recording would be larger than `max_size`, fewer sweeps are written, and a note reports it. A run of more
    than `part_frames` frames is written as several files, which open alone or together as one.
    """

    sweeps: SweepChoice | str = SweepChoice.LOG
    max_size: int | None = None  # [bytes]
    tolerance: float | None = None  # stopping level of the residual, drawn in the residual plots
    active: Tab = Tab.SUMMARY  # the tab in front
    part_frames: int = PART_FRAMES  # frames in one file


DEFAULT_OPTIONS = RecordingOptions()


@dataclass(frozen=True, slots=True)
class RecordingFile:
    """The recording as it was written."""

    path: Path
    size: int  # [bytes] of all its parts
    seconds: float
    frames: int
    network_rows: int  # rows of widths and colours, reported forces included
    sweeps: SweepChoice  # as written: fewer than requested where the size was limited
    clipped: int  # number of forces above the drawn range
    notes: tuple[str, ...]  # sentences for the user
    parts: int = 1  # files


def write_recording(
    results: Results,
    path: Path | str,
    *,
    photograph: PhotographSource | None = None,
    scale: Scale | None = None,
    truth: TruthContacts | None = None,
    progress: FrameProgress | None = None,
    options: RecordingOptions = DEFAULT_OPTIONS,
) -> RecordingFile:
    """Write a run as a recording with its blueprint; an older file is replaced only by a complete new one.

    Parameters
    ----------
    results : Results
        The results of the run.
    path : Path or str
        The recording.
    photograph : callable, optional
        Returns the photograph of a frame as it is shown, or None; requires `scale`.
    scale : Scale, optional
        Place and size of the grains in the photographs.
    truth : TruthContacts, optional
        True forces, shown beside the inferred ones.
    progress : callable, optional
        Called with the frames done and their total number.
    options : RecordingOptions
        Sweeps, size limit, tab in front and frames per file.

    Returns
    -------
    RecordingFile
        Size, frames, sweeps and notes of the recording.

    Raises
    ------
    ValueError
        If photographs are given without a scale, or there is no such tab.
    RunError
        If the disk has too little free space.
    OSError
        If the disk refuses a write.
    """
    if photograph is not None and scale is None:
        raise ValueError("photographs need a scale: the place and size of the grains in them")
    path, begin = Path(path), time.perf_counter()
    return_large_blocks()
    sweeps, max_size, part_frames = SweepChoice(options.sweeps), options.max_size, options.part_frames
    survey = survey_frames(results)
    _check_free_space(path.parent, survey.contact_count, sweeps, max_size)
    first = photograph(0) if photograph else None
    tracks = tracks_in_cell(results.tracks, results.walls)
    canvas = Canvas.around(tracks, scale, None if first is None else first.shape, results.walls)
    camera = "" if results.lens is None else results.lens.describe_terms()
    scene = Scene(
        results.name, tracks, results.walls, results.grains, results.friction, results.configuration, canvas,
        ForceStyle.on(canvas, survey.force_range), truth, options.tolerance, results.radius_tuning,
        tuple(each.statement() for each in results.diagnosis), camera,
        results.kinematics_of if results.kinematics_of(slice(1)) else None, results.fringes,
    )  # fmt: skip
    run = _Run(results, survey, scene, photograph, options.active, progress, part_frames)
    parts = [part_of(path, 1 + k) for k in range(max(-(-len(results.frames) // part_frames), 1))]
    left_out = describe_detail(results.grains.count, survey.most_contacts)
    notes: tuple[str, ...] = (left_out,) if left_out else ()
    plans = _plans(sweeps, limited=max_size is not None)
    with ExitStack() as stack:  # files appear in reverse order: the first one completes the recording
        unfinished = [stack.enter_context(replacing(each)) for each in parts]
        for number, plan in enumerate(plans):
            if number:
                shown = f"{plan.kept} sweeps per frame" if plan.kept else "the reported fields only"
                notes = (
                    *notes[: bool(left_out)],
                    f"Limited to {_megabytes(max_size or 0)}: {shown} instead of sweeps = {sweeps}.",
                )
            last = number == len(plans) - 1
            recorder = _write(run, unfinished, plan, notes, None if last else max_size)
            if recorder is not None and (max_size is None or _size(unfinished) <= max_size or last):
                break
        else:
            raise AssertionError("the last plan is always written")
        if max_size is not None and _size(unfinished) > max_size:
            notes = (*notes, f"Still larger than {_megabytes(max_size)}: the frames themselves need that much.")
        if len(parts) > 1:
            notes = (*notes, f"The recording is {len(parts)} files, which open alone or, by the first, as one.")
    remove_parts(path, len(parts) + 1)
    return RecordingFile(
        path, _size(parts), time.perf_counter() - begin, len(results.frames), recorder.network_rows,
        plan.sweeps, recorder.clipped, notes, len(parts),
    )  # fmt: skip


def _size(files: list[Path]) -> int:
    return sum(each.stat().st_size for each in files)


def _layout_of(scene: Scene, survey: Survey, frames: int, *, photographs: bool) -> RecordingLayout:
    """Return the layout of the recording of a finished run."""
    return RecordingLayout(
        scene.canvas, scene.rod_length, frames, photographs, scene.truth is not None, scene.walls.count,
        scene.radius_tuning is not None, scene.walls.force is not None, survey.has_error_budget, survey.extremes,
        scene.kinematics is not None, scene.fringes is not None,
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Run:
    """The run that is written."""

    results: Results
    survey: Survey
    scene: Scene
    photograph: PhotographSource | None
    active: Tab
    progress: FrameProgress | None
    part_frames: int


@dataclass(frozen=True, slots=True)
class _Plan:
    """The sweeps that are written."""

    sweeps: SweepChoice
    kept: int  # sweeps per frame at most


def _plans(choice: SweepChoice, *, limited: bool) -> list[_Plan]:
    """Return the plans to try in turn, that with the most sweeps first."""
    plans = [_Plan(choice, SWEEPS_KEPT)]
    if choice is SweepChoice.NONE:
        return [_Plan(choice, 0)]
    if limited:
        limits = SWEEP_LIMITS if choice is SweepChoice.ALL else SWEEP_LIMITS[1:]
        plans += [_Plan(SweepChoice.LOG if kept else SweepChoice.NONE, kept) for kept in limits]
    return plans


def _write(run: _Run, parts: list[Path], plan: _Plan, notes: tuple[str, ...], max_size: int | None) -> Recorder | None:
    """Write the run part by part; return None as soon as it exceeds max_size."""
    results, photograph, total = run.results, run.photograph, len(run.results.frames)
    layout = _layout_of(run.scene, run.survey, total, photographs=photograph is not None)
    name, recorder, before = str(uuid.uuid4()), None, 0
    for number, part in enumerate(parts):
        begin, end = number * run.part_frames, min((number + 1) * run.part_frames, total)
        stream = rr.RecordingStream(entities.APPLICATION_ID, recording_id=name, batcher_config=BATCHES)
        with writing(stream, part, make_blueprint(layout, active=run.active)) as written:
            if recorder is None:
                recorder = Recorder(stream, sweeps=plan.sweeps, kept=plan.kept, flush=written.flush)
                recorder.start(run.scene)
                release_free_memory()  # of the ranges of all frames
            else:
                recorder.continue_in(stream, written.flush)
            send_layout(stream, layout)
            for k in range(begin, end):
                forces = results.frames[k]
                recorder.frame(forces, results.statistics[k], photograph(forces.frame) if photograph else None)
                if run.progress:
                    run.progress(k + 1, total)
                written.check()
                if max_size is not None and before + written.size > max_size:
                    return None
            recorder.finish(notes)
        _check_complete(part)
        before += part.stat().st_size
    return recorder


def _check_free_space(folder: Path, contacts: int, choice: SweepChoice, max_size: int | None) -> None:
    """Raise RunError before any work if the disk has too little space for the forces of all frames."""
    rows = 1 if choice is SweepChoice.NONE or max_size is not None else 1 + MIN_ROWS
    needed, free = contacts * rows * BYTES_PER_CONTACT, shutil.disk_usage(folder).free
    if free < needed:
        raise RunError(
            f"{folder}: has {_megabytes(free)} free, and the recording needs more than {_megabytes(needed)}: free some "
            "space, or choose another --out"
        )


def _check_complete(part: Path) -> None:
    """Raise OSError if the file has no end: the stream writes in the background and reports no error.

    Only the last bytes are read, which state where the index lies: opening the file takes .1 MB of memory a frame.
    """
    with part.open("rb") as stream:
        size = stream.seek(0, os.SEEK_END)
        stream.seek(max(size - FILE_END.size, 0))
        end = stream.read()
    if len(end) == FILE_END.size:
        start, length, _checksum, *marks = FILE_END.unpack(end)
        if marks == END_MARKS and start + length == size - FILE_END.size:
            return
    raise OSError(errno.EIO, "the recording could not be written completely (is the disk full?)", str(part))


def _megabytes(size: int) -> str:
    return f"{1e-6 * size:.3g} MB"
