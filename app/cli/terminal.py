"""The terminal: tables as wide as it is, sentences that may be copied, progress with the time left."""

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

from ..progress import Progress, silent
from .compiling import SENTENCE, hearing_of_compilation

Form = Literal["bars", "lines"]
WIDE = 120  # columns of a table that goes to a file


@contextmanager
def progress_bars() -> Iterator[Progress]:
    """Give a callable that draws one bar per stage on standard error, and one while kernels are compiled."""
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

    def show(stage: str, done: int, total: int) -> None:
        if stage not in tasks:
            tasks[stage] = bars.add_task(stage, total=total)
        bars.update(tasks[stage], completed=done, total=total)

    def compiling(count: int) -> None:
        if count == 1:
            bars.console.print(SENTENCE)
        show("compiling", count, count)

    with bars, hearing_of_compilation(compiling):
        yield show


def progress_lines(stage: str, done: int, total: int) -> None:
    """Tell progress on standard error as lines of JSON, for a program that reads them."""
    print(json.dumps({"stage": stage, "done": done, "total": total}), file=sys.stderr, flush=True)


@contextmanager
def progress_of(quiet: bool, form: Form = "bars") -> Iterator[Progress]:
    """Bars on a terminal, silence elsewhere and where it was asked for; lines wherever they were asked for."""
    if form == "lines":
        yield progress_lines
    elif quiet or not sys.stderr.isatty():
        yield silent
    else:
        with progress_bars() as progress:
            yield progress


def table_console(width: int = WIDE, *, quiet: bool = False) -> Console:
    """A console for tables: as wide as the terminal, or `width` columns where the output goes to a file."""
    return Console(quiet=quiet) if sys.stdout.isatty() else Console(width=width, quiet=quiet)


def tell(console: Console, sentence: str) -> None:
    """Print a sentence as it is: no markup, no colours, no line break in a path or command to be copied."""
    console.print(sentence, markup=False, highlight=False, soft_wrap=True)
