"""What the benchmarks found over time: a table that every asking adds to, and its picture.

python -m tests.benchmarks --append adds rows; python -m tests.benchmarks.history draws them anew.
"""

from __future__ import annotations

import csv
import io
import subprocess
from collections.abc import Iterable
from datetime import date
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, NamedTuple

from rodsight.atomic import write_atomically

from tests.benchmarks.timing import Row, processor_name

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROOT = Path(__file__).parents[2]
HISTORY = Path(__file__).parent / "history.csv"
PICTURE = ROOT / "app" / "docs" / "pictures" / "speed_history.svg"
COLUMNS = 3  # of panels
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00")  # of machines, for every vision


class Entry(NamedTuple):
    """A figure of one commit: median, least and greatest of its turns."""

    commit: str
    date: str
    machine: str
    figure: str
    unit: str
    median: float
    least: float
    greatest: float
    turns: int


def entries_of(rows: Iterable[Row], commit: str, day: str, machine: str) -> list[Entry]:
    """Entries of the rows that tell their turns; others print words alone."""
    return [
        Entry(commit, day, machine, row.what, row.unit, *_spread(row.turns), len(row.turns))
        for row in rows
        if row.turns
    ]


def append(rows: Iterable[Row], commit: str, file: Path = HISTORY) -> int:
    """Add what was measured of a commit on this machine; gives how many figures."""
    new = entries_of(rows, commit, date.today().isoformat(), processor_name())
    _write(file, [*read(file), *new])
    return len(new)


def read(file: Path = HISTORY) -> list[Entry]:
    """All entries in the order in which they were added; none without a file."""
    if not file.exists():
        return []
    with file.open(encoding="utf-8", newline="") as stream:
        return [
            Entry(*(row[name] for name in Entry._fields[:5]), *(float(row[name]) for name in Entry._fields[5:8]),
                  int(row["turns"]))
            for row in csv.DictReader(stream)
        ]  # fmt: skip


def present_commit() -> str:
    """The commit that lies here, with a plus where files were changed since."""
    commit = _git("rev-parse", "--short=10", "HEAD")
    return f"{commit}+" if _git("status", "--porcelain", "--untracked-files=no") else commit


def draw(entries: list[Entry], picture: Path = PICTURE) -> None:
    """A panel for every figure: medians over the commits, in the order of measuring, with their spread."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    commits = list(dict.fromkeys(entry.commit for entry in entries))
    machines = list(dict.fromkeys(entry.machine for entry in entries))
    figures = list(dict.fromkeys(entry.figure for entry in entries))
    lines = -(-len(figures) // COLUMNS)
    with mpl.rc_context({"svg.hashsalt": "rodsight", "svg.fonttype": "none", "font.size": 8}):
        page = Figure(figsize=(10.0, 0.6 + 1.9 * lines), layout="constrained")
        panels = page.subplots(lines, COLUMNS, squeeze=False).ravel()
        for panel, figure in zip(panels, figures, strict=False):
            _draw_figure(panel, [entry for entry in entries if entry.figure == figure], commits, machines)
        for panel in panels[len(figures) :]:
            panel.set_axis_off()
        handles = [
            mpl.lines.Line2D([], [], color=COLOURS[k % len(COLOURS)], marker="o", label=machine)
            for k, machine in enumerate(machines)
        ]
        page.legend(handles=handles, loc="outside lower center", frameon=False)
        told = io.BytesIO()
        page.savefig(told, format="svg", metadata={"Date": None})
    write_atomically(picture, told.getvalue())


def _draw_figure(panel: Axes, entries: list[Entry], commits: list[str], machines: list[str]) -> None:
    for k, machine in enumerate(machines):
        own = [entry for entry in entries if entry.machine == machine]
        place = [commits.index(entry.commit) for entry in own]
        middle = [entry.median for entry in own]
        below = [entry.median - entry.least for entry in own]
        above = [entry.greatest - entry.median for entry in own]
        panel.errorbar(place, middle, [below, above], fmt="o-", color=COLOURS[k % len(COLOURS)], ms=3.0, capsize=2.0)
    panel.set_title(f"{entries[0].figure.replace('`', '')}\n[{entries[0].unit}]", fontsize=8)
    panel.set_xticks(range(len(commits)), [commit[:7] for commit in commits], rotation=30 if len(commits) > 3 else 0)
    panel.set_xlim(-0.5, len(commits) - 0.5)
    panel.set_ylim(0.0, 1.15 * max(entry.greatest for entry in entries))
    panel.grid(axis="y", lw=0.3)


def _spread(turns: tuple[float, ...]) -> tuple[float, float, float]:
    return median(turns), min(turns), max(turns)


def _write(file: Path, entries: list[Entry]) -> None:
    told = io.StringIO()
    writer = csv.writer(told, lineterminator="\n")
    writer.writerow(Entry._fields)
    writer.writerows([f"{value:.6g}" if isinstance(value, float) else value for value in entry] for entry in entries)
    write_atomically(file, told.getvalue().encode())


def _git(*words: str) -> str:
    told = subprocess.run(["git", *words], cwd=ROOT, check=True, capture_output=True, text=True)
    return told.stdout.strip()


if __name__ == "__main__":
    draw(read())
