"""The figures by name, and their files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal, get_args

from matplotlib.figure import Figure

from solver.sequence.frame_forces import FrameStatus

from ..results.results import Results, TruthContacts
from .directions import draw_rose, draw_stress
from .distributions import draw_density
from .force_network import draw_forces
from .page import Width, paper_style
from .time_lines import draw_time
from .truth_comparison import draw_truth

FigureName = Literal["forces", "density", "rose", "stress", "time", "truth"]
FileKind = Literal["pdf", "svg", "png"]

_DRAW: dict[str, Callable[[Results, int, Width], Figure]] = {
    "forces": draw_forces, "density": draw_density, "rose": draw_rose, "stress": draw_stress, "time": draw_time,
}  # fmt: skip


def draw_figure(
    results: Results,
    name: str,
    frame: int | None = None,
    *,
    width: Width = "single",
    truth: TruthContacts | None = None,
) -> Figure:
    """One figure of a run: `name` of FigureName, of a frame, by default `usual_frame`.

    Raises ValueError for a figure that is not known, for "truth" without a truth, for a frame without forces;
    IndexError for a frame that is not there.
    """
    if name not in get_args(FigureName):
        raise ValueError(f"there is no figure {name!r}: figures are {', '.join(get_args(FigureName))}")
    shown = usual_frame(results) if frame is None else frame
    if not 0 <= shown < len(results.frames):
        raise IndexError(f"there is no frame {shown}: frames go from 0 to {len(results.frames) - 1}")
    if results.frames[shown].status is FrameStatus.FAILED:
        raise ValueError(f"frame {shown} has no forces: {results.frames[shown].failed_reason}")
    with paper_style():
        if name == "truth":
            if truth is None:
                raise ValueError("no truth is known: the experiment file names none")
            return draw_truth(results, truth, shown, width)
        return _DRAW[name](results, shown, width)


def usual_frame(results: Results) -> int:
    """The last settled frame; the last one with forces where none is."""
    solved = [each.frame for each in results.frames if each.status is not FrameStatus.FAILED]
    settled = [each.frame for each in results.frames if each.status is FrameStatus.SETTLED]
    return (settled or solved or [0])[-1]


def write_figures(
    results: Results,
    folder: Path,
    kinds: Sequence[FileKind],
    *,
    frame: int | None = None,
    width: Width = "single",
    truth: TruthContacts | None = None,
) -> list[Path]:
    """Write every figure that the run has data for, in each kind of file; returns the files."""
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for name in get_args(FigureName):
        if name == "truth" and truth is None:
            continue
        figure = draw_figure(results, name, frame, width=width, truth=truth)
        for kind in kinds:
            files.append(folder / f"{name}.{kind}")
            with paper_style():  # the kinds of letters in PDF and SVG are settled when they are written
                figure.savefig(files[-1])
    return files
