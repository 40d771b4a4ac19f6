"""The arguments that commands on an experiment share, and the run that they open."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from ..process.errors import InputError
from .arguments import parse_frames
from .terminal import Form, progress_of

if TYPE_CHECKING:
    from ..run_folder import Run


@dataclass(frozen=True, slots=True)
class Request:
    """The arguments that commands on an experiment share, as given by the user."""

    experiment: Path
    settings: tuple[str, ...] = ()
    quiet: bool = False
    out: Path | None = None
    frames: str | None = None
    max_size: float | None = None  # [MB] of the recording
    full_frames: tuple[int, ...] = ()
    progress: Form = "bars"
    keep_old: bool = False
    print_table: bool = True  # False: standard output is kept for JSON

    @property
    def console(self) -> Console:
        return Console(quiet=self.quiet or not self.print_table)

    def with_setting(self, key: str, value: str | int | None) -> Request:
        """Return the request with one more setting, if a value is given."""
        return self if value is None else replace(self, settings=(*self.settings, f"{key}={json.dumps(value)}"))


@contextmanager
def open_run(request: Request, *, writes: bool = True) -> Iterator[Run]:
    """Open the requested run with a progress display; a run that writes locks its folder."""
    from ..experiment.config.unused_keys import refuse_unused_keys
    from ..experiment.experiment import load_experiment
    from ..run_folder import Run, hold_run

    experiment = load_experiment(request.experiment, request.settings)
    refuse_unused_keys(experiment.config, experiment.file)
    folder = request.out if request.out is not None else Path("runs") / experiment.name
    with progress_of(request.quiet, request.progress) as progress:
        run = Run(
            experiment, folder, parse_frames(request.frames), progress, max_size=byte_count(request.max_size),
            full_frames=request.full_frames, keep_old=request.keep_old,
        )  # fmt: skip
        if not writes:
            yield run
            return
        with hold_run(run):
            yield run


def byte_count(megabytes: float | None) -> int | None:
    """Convert --max-size to bytes. Raises InputError."""
    if megabytes is None:
        return None
    if not (math.isfinite(megabytes) and megabytes > 0.0):
        raise InputError("--max-size", str(megabytes), "is not a positive number of megabytes")
    return int(1e6 * megabytes)
