"""Arguments that several commands share: their names on the command line, their help, and what they mean."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import tyro

from ..errors import InputError

ExperimentPath = Annotated[
    Path,
    tyro.conf.Positional,
    tyro.conf.arg(metavar="EXPERIMENT", help="folder of the experiment, or its experiment.toml"),
]
Out = Annotated[Path | None, tyro.conf.arg(metavar="DIR", help="folder of the results; default runs/<name>")]
Settings = Annotated[
    tuple[str, ...],
    tyro.conf.UseAppendAction,
    tyro.conf.arg(
        name="set",
        metavar="KEY=VALUE",
        help="lay a setting over experiment.toml, e.g. solver.kappa=0.1; rodsight settings lists them",
    ),
]
Frames = Annotated[str | None, tyro.conf.arg(metavar="A:B", help="only the frames A … B − 1")]
ProgressForm = Annotated[
    Literal["bars", "lines"],
    tyro.conf.arg(name="progress", help="lines: as JSON on standard error, for programs; default bars, on a terminal"),
]
Quiet = Annotated[bool, tyro.conf.FlagCreatePairsOff, tyro.conf.arg(help="show no progress and no table")]
Sweeps = Annotated[
    Literal["all", "log", "none"] | None, tyro.conf.arg(help="whose forces the recording holds; default log")
]

Ensemble = Annotated[
    int | None,
    tyro.conf.arg(metavar="K", help="error bars from K sequences solved again with resampled inputs; 8 are enough"),
]
MaxSize = Annotated[
    float | None, tyro.conf.arg(metavar="MB", help="of the recording [MB]: fewer sweeps where it would be larger")
]
FullFrames = Annotated[
    tuple[int, ...],
    tyro.conf.arg(
        metavar="FRAME", help="with --sweeps all: every sweep of these frames to a side file, others thinned"
    ),
]


def parse_frames(text: str | None) -> tuple[int, int | None]:
    """First frame and end (None: to the last) of a range A:B; either side may be left out. Raises InputError."""
    if text is None:
        return 0, None
    first, colon, last = text.partition(":")
    try:
        if not colon:
            raise ValueError
        return int(first or 0), int(last) if last else None
    except ValueError:
        raise InputError("--frames", text, "is not A:B, such as 0:12") from None
