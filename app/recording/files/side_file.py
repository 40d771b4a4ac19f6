"""Writes a side file with every kept sweep of selected frames; the viewer shows it and its recording as one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import rerun as rr
from rerun.chunk import RrdReader

from ...drawing.accumulated_strain import accumulated_strains
from ...drawing.force_range import ForceRange
from ...process.atomic import replacing
from ...process.errors import InputError
from ...results.results import Results
from ..look.clock import Clock
from ..look.force_style import ForceStyle
from ..packing_layers.forces.network import SweepChoice, send_sweeps, visible_sweeps
from ..tabs.layout_property import read_layout
from .recorder import BATCHES
from .writing import writing


def write_side_file(results: Results, recording: Path, target: Path, frames: Sequence[int]) -> str:
    """Write a side file and return a sentence that reports it; raise InputError for a frame that does not exist."""
    try:
        size = record_side_file(results, recording, target, frames)
    except ValueError as error:
        raise InputError("--full-frames", "", str(error)) from None
    shown = ", ".join(map(str, frames))
    return f"Every kept sweep of the frames {shown} is in {target} ({1e-6 * size:.1f} MB)."


def record_side_file(results: Results, recording: Path | str, target: Path | str, frames: Sequence[int]) -> int:
    """Write all kept sweeps of selected frames beside a recording of the same results.

    The file has the identity of the recording: `rodsight view RECORDING SIDE` shows one recording.

    Parameters
    ----------
    results : Results
        The results of the run.
    recording : Path or str
        The recording of these results.
    target : Path or str
        The side file.
    frames : sequence of int
        The frames.

    Returns
    -------
    int
        Size of the file [bytes].

    Raises
    ------
    FileNotFoundError
        If there is no recording.
    ValueError
        If a frame does not exist.
    """
    recording, target = Path(recording), Path(target)
    if not recording.is_file():
        raise FileNotFoundError(f"there is no recording {recording}")
    count = len(results.frames)
    wrong = [frame for frame in frames if not 0 <= frame < count]
    if wrong:
        raise ValueError(f"there is no frame {wrong[0]}: frames count from 0 to {count - 1}")
    entry = RrdReader(str(recording)).recordings()[0]
    style = ForceStyle.on(read_layout(recording).canvas, ForceRange.of(results.frames))
    stream = rr.RecordingStream(
        entry.application_id, recording_id=entry.recording_id, send_properties=False, batcher_config=BATCHES
    )
    with replacing(target) as part, writing(stream, part):
        stream.set_log_time_enabled(False)
        first = 0
        strains = accumulated_strains([forces.strain for forces in results.frames])
        for forces, strain in zip(results.frames, strains, strict=True):
            span = forces.history.count + 1
            if forces.frame in frames and forces.contacts.count:
                time = float(results.tracks.time[forces.frame])
                clock = Clock(stream, forces.frame, first, first + span - 1, time, strain)
                rows, fn, _ = visible_sweeps(forces, span - 1, SweepChoice.ALL, 0)
                # The first row, with the geometry, is in the recording.
                send_sweeps(clock, style, rows[1:], fn[1:], thin=True)
            first += span
    return target.stat().st_size
