"""Terminal output: tables, lines for copying, progress with the remaining time."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Literal

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.progress import Progress as Bars

from ..compilation.ahead import STAGE as COMPILATION
from ..process.progress import Progress, no_progress
from .compiling import COMPILATION_NOTE, count_compilations

Form = Literal["bars", "lines"]
FILE_WIDTH = 120  # columns of a table in a file


@contextmanager
def progress_bars() -> Iterator[Progress]:
    """Yield a callable that draws one bar per stage on standard error, and one for the compilation of kernels."""
    bars = Bars(
        TextColumn("{task.description:<10}"),
        BarColumn(bar_width=36),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=Console(stderr=True),
    )
    tasks: dict[str, TaskID] = {}

    def show(stage: str, done: int, total: int | None) -> None:
        if stage not in tasks:
            if stage == COMPILATION:
                bars.console.print(COMPILATION_NOTE)
            tasks[stage] = bars.add_task(stage, total=total)
        bars.update(tasks[stage], completed=done, total=total)

    def compile_here(count: int) -> None:
        """Show kernels that this process compiles itself, whose total is unknown, unless others are compiled ahead."""
        if COMPILATION not in tasks or bars.tasks[tasks[COMPILATION]].total is None:
            show(COMPILATION, count, None)

    with bars, count_compilations(compile_here):
        yield show


def progress_lines(stage: str, done: int, total: int) -> None:
    """Write progress to standard error as lines of JSON, for other programs."""
    print(json.dumps({"stage": stage, "done": done, "total": total}), file=sys.stderr, flush=True)


@contextmanager
def progress_of(quiet: bool, form: Form = "bars") -> Iterator[Progress]:
    """Yield a progress callable: JSON lines on request, bars on a terminal, otherwise nothing."""
    if form == "lines":
        yield progress_lines
    elif quiet or not sys.stderr.isatty():
        yield no_progress
    else:
        with progress_bars() as progress:
            yield progress


def table_console(width: int = FILE_WIDTH, *, quiet: bool = False) -> Console:
    """Return a console for tables, as wide as the terminal, or `width` columns in a file."""
    return Console(quiet=quiet) if sys.stdout.isatty() else Console(width=width, quiet=quiet)


def print_line(console: Console, sentence: str) -> None:
    """Print a sentence without markup, colours or line breaks, so that paths and commands can be copied."""
    console.print(sentence, markup=False, highlight=False, soft_wrap=True)
