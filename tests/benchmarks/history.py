"""History of the benchmarks: a table with the figures of every run, and its plot.

python -m tests.benchmarks --append adds rows; python -m tests.benchmarks.history draws them.
"""

from __future__ import annotations

import csv
import io
import subprocess
from collections.abc import Iterable
from datetime import date
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any, NamedTuple

from rodsight.process.atomic import write_atomically

from tests.benchmarks.timing import Row, processor_name

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROOT = Path(__file__).parents[2]
HISTORY = Path(__file__).parent / "history.csv"
PICTURE = ROOT / "app" / "docs" / "pictures" / "speed_history.svg"
COLUMNS = 3  # of panels
COLOURS = (
    "#0072b2",
    "#d55e00",
    "#009e73",
    "#cc79a7",
    "#56b4e9",
    "#e69f00",
)  # of machines; distinguishable with colour blindness …
MARKERS, LINES = "os^Dv", ("-", "--", ":", "-.")  # … and in grey


class Entry(NamedTuple):
    """A figure of one commit: median, least and greatest of its rounds."""

    commit: str
    date: str
    machine: str
    figure: str
    unit: str
    median: float
    least: float
    greatest: float
    turns: int


def make_entries(rows: Iterable[Row], commit: str, day: str, machine: str) -> list[Entry]:
    """Make an entry of every row with values; rows of text alone are left out."""
    return [
        Entry(commit, day, machine, row.label, row.unit, *_median_and_range(row.rounds), len(row.rounds))
        for row in rows
        if row.rounds
    ]


def append(rows: Iterable[Row], commit: str, file: Path = HISTORY) -> int:
    """Append the figures of a commit on this machine; returns their number."""
    new = make_entries(rows, commit, date.today().isoformat(), processor_name())
    _write(file, [*read(file), *new])
    return len(new)


def read(file: Path = HISTORY) -> list[Entry]:
    """Read all entries in the order of their addition; none without a file."""
    if not file.exists():
        return []
    with file.open(encoding="utf-8", newline="") as stream:
        return [
            Entry(*(row[name] for name in Entry._fields[:5]), *(float(row[name]) for name in Entry._fields[5:8]),
                  int(row["turns"]))
            for row in csv.DictReader(stream)
        ]  # fmt: skip


def present_commit() -> str:
    """Commit that is checked out, with a plus if files are modified."""
    commit = _git("rev-parse", "--short=10", "HEAD")
    return f"{commit}+" if _git("status", "--porcelain", "--untracked-files=no") else commit


def draw(entries: list[Entry], picture: Path = PICTURE) -> None:
    """Draw a panel for every figure: medians over the commits in the order of measurement, with their range."""
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
        handles = [mpl.lines.Line2D([], [], label=machine, **_style(k)) for k, machine in enumerate(machines)]
        page.legend(handles=handles, loc="outside lower center", frameon=False)
        text = io.BytesIO()
        page.savefig(text, format="svg", metadata={"Date": None})
    write_atomically(picture, text.getvalue())


def _draw_figure(panel: Axes, entries: list[Entry], commits: list[str], machines: list[str]) -> None:
    for k, machine in enumerate(machines):
        own = [entry for entry in entries if entry.machine == machine]
        place = [commits.index(entry.commit) for entry in own]
        middle = [entry.median for entry in own]
        below = [entry.median - entry.least for entry in own]
        above = [entry.greatest - entry.median for entry in own]
        panel.errorbar(place, middle, [below, above], ms=3.0, capsize=2.0, **_style(k))
    panel.set_title(f"{entries[0].figure.replace('`', '')}\n[{entries[0].unit}]", fontsize=8)
    panel.set_xticks(range(len(commits)), [commit[:7] for commit in commits], rotation=30 if len(commits) > 3 else 0)
    panel.set_xlim(-0.5, len(commits) - 0.5)
    panel.set_ylim(0.0, 1.15 * max(entry.greatest for entry in entries))
    panel.grid(axis="y", lw=0.3)


def _style(k: int) -> dict[str, Any]:
    """Return the colour, mark and line of machine k."""
    return {"color": COLOURS[k % len(COLOURS)], "marker": MARKERS[k % len(MARKERS)], "ls": LINES[k % len(LINES)]}


def _median_and_range(rounds: tuple[float, ...]) -> tuple[float, float, float]:
    return median(rounds), min(rounds), max(rounds)


def _write(file: Path, entries: list[Entry]) -> None:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(Entry._fields)
    writer.writerows([f"{value:.6g}" if isinstance(value, float) else value for value in entry] for entry in entries)
    write_atomically(file, text.getvalue().encode())


def _git(*words: str) -> str:
    text = subprocess.run(["git", *words], cwd=ROOT, check=True, capture_output=True, text=True)
    return text.stdout.strip()


if __name__ == "__main__":
    draw(read())
