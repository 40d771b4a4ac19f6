"""Arguments that several commands share: their names on the command line and their help."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import FlagCreatePairsOff, Positional, UseAppendAction, arg

from ..process.errors import InputError
from ..process.frame_range import FrameRange

Flag = Annotated[bool, FlagCreatePairsOff]
ExperimentPath = Annotated[
    Path, Positional, arg(metavar="EXPERIMENT", help="folder of the experiment, or its experiment.toml")
]
Out = Annotated[Path | None, arg(metavar="DIR", help="folder of the results; default runs/<name>")]
Settings = Annotated[
    tuple[str, ...],
    UseAppendAction,
    arg(
        name="set",
        metavar="KEY=VALUE",
        help="override a key of experiment.toml, e.g. solver.kappa=0.1; rodsight settings lists them",
    ),
]
KeepOld = Annotated[Flag, arg(help="use stored results of the same input as they are, although other code made them")]
Frames = Annotated[str | None, arg(metavar="A:B[:STEP]", help="only the frames A … B − 1, or every STEP-th of them")]
AsJson = Annotated[Flag, arg(name="json", help="print JSON")]
ProgressForm = Annotated[
    Literal["bars", "lines"],
    arg(name="progress", help="lines: as JSON on standard error, for programs; default bars, on a terminal"),
]
Workers = Annotated[int | None, arg(metavar="N", help="processes; default: one per core")]
Threads = Annotated[int | None, arg(metavar="N", help="threads of tracking and solving; default: one per core")]
Scheduler = Annotated[str | None, arg(metavar="ADDRESS", help="run on the machines of this dask scheduler instead")]
Port = Annotated[int, arg(help="of the page on 127.0.0.1; 0: a free one")]
Browser = Annotated[bool, arg(help="open the page")]
ResultsPath = Annotated[Path, Positional, arg(metavar="RESULTS", help="a run's folder, or results.h5")]
Quiet = Annotated[Flag, arg(help="show no progress and no table")]
Sweeps = Annotated[Literal["all", "log", "none"] | None, arg(help="sweeps whose forces are recorded; default log")]

Ensemble = Annotated[
    int | None, arg(metavar="K", help="error bars from K solutions with resampled inputs; 8 are enough")
]
MaxSize = Annotated[float | None, arg(metavar="MB", help="of the recording [MB]; sweeps are thinned to stay below it")]
FullFrames = Annotated[
    tuple[int, ...],
    arg(metavar="FRAME", help="with --sweeps all: every sweep of these frames in a side file, others thinned"),
]


def parse_frames(text: str | None) -> FrameRange:
    """Parse a range A:B or A:B:STEP, all parts optional. Raises InputError."""
    if text is None:
        return FrameRange()
    try:
        first, last, *steps = text.split(":")
        step = int(steps[0]) if steps and steps[0] else 1
        if len(steps) > 1 or step < 1:
            raise ValueError
        return FrameRange(int(first or 0), int(last) if last else None, step)
    except ValueError:
        raise InputError("--frames", text, "is not A:B or A:B:STEP, such as 0:12 or 0:60:4") from None


def refuse_step(frames: FrameRange) -> tuple[int, int | None]:
    """Return first frame and end of a range that may have no step. Raises InputError."""
    if frames.step != 1:
        raise InputError("--frames", str(frames), "has a step, which applies to run, track, solve and record only")
    return frames.start, frames.stop


def refuse_unused(command: str, given: Mapping[str, object], when: str) -> None:
    """Raise InputError for the first option that was given although it has no effect.

    Parameters
    ----------
    command : str
        The command.
    given : mapping of str to object
        Values by option; None, False and an empty tuple stand for an option that was not given.
    when : str
        When these options do not apply, such as "without --follow".
    """
    for option, value in given.items():
        if was_given(value):
            raise InputError(command, option, f"does not apply {when}")


def was_given(value: object) -> bool:
    """Return whether an option was given; None, False and an empty tuple stand for one that was not."""
    return not (value is None or value is False or value == ())


def worker_count(workers: int | None) -> int:
    """Return the number of processes; default: one per available core. Raises InputError."""
    from ..solver.parallel import available_cores

    if workers is None:
        return available_cores()
    if workers < 1:
        raise InputError("--workers", str(workers), "must be at least one")
    return workers
