"""A finished run as one recording: as much of it as a size allows, in place only when it is whole."""

from __future__ import annotations

import os
import shutil
import time
import uuid
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import rerun as rr
from rerun.chunk import RrdReader

from ...errors import RunError
from ...experiment.units import Scale
from ...results.results import Results, TruthContacts
from ..look import entities
from ..look.canvas import Canvas
from ..look.detail import describe_detail
from ..look.force_style import ForceStyle
from ..look.scene import Scene, tracks_in_cell
from ..packing_layers.forces.network import SweepChoice
from ..parts import forget_parts, part_of
from ..tabs.blueprint import Layout, Tab, make_blueprint
from ..tabs.layout_property import send_layout
from ..viewing.viewer import run_tool
from .recorder import BATCHES, SWEEPS_KEPT, PhotographSource, Recorder
from .survey import Survey, survey_frames
from .writing import writing

FrameProgress = Callable[[int, int], None]  # frames done, frames in all

PART_FRAMES = 2000  # photographs in one file: more make the viewer slow to open it
LONG = 200  # frames from which on the index of a recording, .2 MB a frame in memory, is made by a process of its own
WHOLE = ".whole.part"  # a recording that has been given its index
LEAST_ROWS = 4  # sweeps of a frame that even a short solve keeps
BYTES_PER_CONTACT = 8  # and row, at least: a width and a colour

# What is tried in turn to keep a recording below a size: sweeps per frame.
THINNER = (40, 20, 10, 0)


@dataclass(frozen=True, slots=True)
class RecordingFile:
    """A recording as it was written."""

    path: Path
    size: int  # [bytes] of all its parts
    seconds: float
    frames: int
    network_rows: int  # rows of widths and colours, the reported fields among them
    sweeps: SweepChoice  # as written, which is less than asked for where the size was limited
    clipped: int  # forces above the drawn range
    notes: tuple[str, ...]  # sentences for the user
    parts: int = 1  # files


def write_recording(
    results: Results,
    path: Path | str,
    *,
    photograph: PhotographSource | None = None,
    scale: Scale | None = None,
    sweeps: SweepChoice | str = SweepChoice.LOG,
    truth: TruthContacts | None = None,
    progress: FrameProgress | None = None,
    max_size: int | None = None,
    tolerance: float | None = None,
    active: Tab = Tab.EXPERIMENT,
    part_frames: int = PART_FRAMES,
) -> RecordingFile:
    """Write a run as a recording with its blueprint; an older file is replaced only when the new one is whole.

    part_frames: photographs in one file; more make files beside the first that open alone, and with it as one.

    photograph: frame → how it is shown, or None; needs `scale`. sweeps: see SweepChoice.
    tolerance: stopping level of the residual, drawn into the plot. max_size [bytes]: fewer sweeps are
    written where the file would be larger; what was left out is said in the report and the summary.
    """
    if photograph is not None and scale is None:
        raise ValueError("photographs need the scale that says where the grains are in them")
    path, begin = Path(path), time.perf_counter()
    survey = survey_frames(results)
    _ask_for_room(path.parent, survey.contact_count, SweepChoice(sweeps), max_size)
    first = photograph(0) if photograph else None
    tracks = tracks_in_cell(results.tracks, results.walls)
    canvas = Canvas.around(tracks, scale, None if first is None else first.shape)
    scene = Scene(
        results.name, tracks, results.walls, results.grains, results.friction, results.configuration, canvas,
        ForceStyle.on(canvas, survey.force_range), truth, tolerance, results.radius_tuning,
    )  # fmt: skip
    run = _Run(results, survey, scene, photograph, active, progress, part_frames)
    parts = [part_of(path, 1 + k) for k in range(max(-(-len(results.frames) // part_frames), 1))]
    unfinished = [each.with_name(each.name + ".part") for each in parts]
    left_out = describe_detail(results.grains.count, survey.most_contacts)
    notes: tuple[str, ...] = (left_out,) if left_out else ()
    plans = _plans(SweepChoice(sweeps), limited=max_size is not None)
    try:
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
        for part, file in reversed(list(zip(unfinished, parts, strict=True))):  # the first tells that all are there
            os.replace(part, file)
        forget_parts(path, len(parts) + 1)
    finally:
        for part in unfinished:
            part.unlink(missing_ok=True)
    return RecordingFile(
        path, _size(parts), time.perf_counter() - begin, len(results.frames), recorder.network_rows,
        plan.sweeps, recorder.clipped, notes, len(parts),
    )  # fmt: skip


def _size(files: list[Path]) -> int:
    return sum(each.stat().st_size for each in files)


def _layout_of(scene: Scene, survey: Survey, frames: int, *, photographs: bool) -> Layout:
    """What the blueprint must know of a finished run."""
    return Layout(
        scene.canvas, scene.rod_length, frames, photographs, scene.truth is not None, scene.walls.count,
        scene.radius_tuning is not None, scene.walls.force is not None, survey.has_error_budget, survey.extremes,
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Run:
    """What is written, however much of it."""

    results: Results
    survey: Survey
    scene: Scene
    photograph: PhotographSource | None
    active: Tab
    progress: FrameProgress | None
    part_frames: int


@dataclass(frozen=True, slots=True)
class _Plan:
    """How much is written."""

    sweeps: SweepChoice
    kept: int  # sweeps per frame at most


def _plans(choice: SweepChoice, *, limited: bool) -> list[_Plan]:
    """What to try in turn, fullest first."""
    plans = [_Plan(choice, SWEEPS_KEPT)]
    if choice is SweepChoice.NONE:
        return [_Plan(choice, 0)]
    if limited:
        thinner = THINNER if choice is SweepChoice.ALL else THINNER[1:]
        plans += [_Plan(SweepChoice.LOG if kept else SweepChoice.NONE, kept) for kept in thinner]
    return plans


def _write(run: _Run, parts: list[Path], plan: _Plan, notes: tuple[str, ...], max_size: int | None) -> Recorder | None:
    """Write the whole run, part by part; None, early, where it grows beyond max_size."""
    results, photograph, total = run.results, run.photograph, len(run.results.frames)
    layout = _layout_of(run.scene, run.survey, total, photographs=photograph is not None)
    name, recorder, before = str(uuid.uuid4()), None, 0
    for number, part in enumerate(parts):
        begin, end = number * run.part_frames, min((number + 1) * run.part_frames, total)
        indexed = end - begin < LONG
        stream = rr.RecordingStream(entities.APPLICATION_ID, recording_id=name, batcher_config=BATCHES)
        with writing(stream, part, make_blueprint(layout, active=run.active), indexed=indexed) as written:
            if recorder is None:
                recorder = Recorder(stream, sweeps=plan.sweeps, kept=plan.kept, flush=written.flush)
                recorder.start(run.scene)
            else:
                recorder.go_on(stream, written.flush)
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
        if not indexed:
            _give_index(part)
        _check_whole(part)
        before += part.stat().st_size
    return recorder


def _give_index(part: Path) -> None:
    """Copy a recording message by message, its index at the end; raises OSError where that fails."""
    whole = part.with_name(part.name.removesuffix(".part") + WHOLE)
    try:
        run_tool("filter", part, "-o", whole)
        os.replace(whole, part)
    finally:
        whole.unlink(missing_ok=True)


def _ask_for_room(folder: Path, contacts: int, choice: SweepChoice, max_size: int | None) -> None:
    """Raise RunError where not even the forces of all frames would find room: better now than after minutes."""
    rows = 1 if choice is SweepChoice.NONE or max_size is not None else 1 + LEAST_ROWS
    needed, free = contacts * rows * BYTES_PER_CONTACT, shutil.disk_usage(folder).free
    if free < needed:
        raise RunError(
            f"{folder}: has {_megabytes(free)} free, and the recording needs more than {_megabytes(needed)}: make "
            "room, or take another --out"
        )


def _check_whole(part: Path) -> None:
    """Raise OSError where the end of the file is not there: the stream writes in the background and does not tell."""
    try:
        os.fspath(part).encode()
    except UnicodeEncodeError:  # a name that is no text: the reader cannot open it
        return
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", rr.error_utils.RerunWarning)  # of a missing end: store() raises for it
            RrdReader(str(part)).store()
    except (RuntimeError, ValueError) as error:
        raise OSError(f"the recording could not be written whole (is the disk full?): {error}") from error


def _megabytes(size: int) -> str:
    return f"{1e-6 * size:.3g} MB"
