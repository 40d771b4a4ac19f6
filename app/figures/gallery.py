"""The figures by name, and their files."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Literal, get_args

import numpy as np
from matplotlib.figure import Figure

from ..inference.zero_start import solve_from_zero
from ..process.atomic import write_atomically
from ..results.comparison import compare_runs, compare_with_truth
from ..results.results import Results, TruthContacts
from ..solver.even_subset import even_subset
from ..solver.frame_forces import FrameStatus
from .contact_sheet import draw_sheet
from .difference import draw_difference
from .directions import draw_rose, draw_stress
from .distributions import draw_density
from .figure_style import NothingToDrawError, Width, paper_style
from .force_network import draw_forces
from .fringes import draw_fringes
from .kinematics import draw_kinematics
from .paper.paper_set import Picture, draw_apparatus, draw_recorded, draw_strip, draw_zero_starts
from .time_curves import draw_time
from .truth_comparison import draw_truth

FigureName = Literal[
    "forces", "density", "rose", "stress", "time", "sheet", "kinematics", "fringes", "truth", "difference"
]
FileKind = Literal["pdf", "svg", "png"]
FigureSet = Literal["results", "paper"]
ZERO_STARTS = 12  # frames swept from zero forces, of which two are drawn

NEED_TRUTH = ("truth", "difference")

_DRAW: dict[str, Callable[[Results, int, Width], Figure]] = {
    "forces": draw_forces, "density": draw_density, "rose": draw_rose, "stress": draw_stress, "time": draw_time,
    "sheet": draw_sheet, "kinematics": draw_kinematics, "fringes": draw_fringes,
}  # fmt: skip


def draw_figure(
    results: Results,
    name: str,
    frame: int | None = None,
    *,
    width: Width = "single",
    truth: TruthContacts | None = None,
    against: Results | None = None,
) -> Figure:
    """Draw one figure of a run.

    Parameters
    ----------
    results : Results
        The results of the run.
    name : str
        A name of FigureName.
    frame : int, optional
        The frame; None: `default_frame`.
    width : str
        "single" or "double" column.
    truth : TruthContacts, optional
        True forces, for the figures "truth" and "difference".
    against : Results, optional
        Another run of the same packing, for the figure "difference"; None: the true forces.

    Returns
    -------
    Figure
        The figure.

    Raises
    ------
    ValueError
        If there is no such figure, no truth for one that needs it, no force in the frame, or another packing.
    IndexError
        If there is no such frame.
    """
    if name not in get_args(FigureName):
        raise ValueError(f"there is no figure {name!r}: the figures are {', '.join(get_args(FigureName))}")
    shown = default_frame(results) if frame is None else frame
    if not 0 <= shown < len(results.frames):
        raise IndexError(f"there is no frame {shown}: frames go from 0 to {len(results.frames) - 1}")
    if results.frames[shown].status is FrameStatus.FAILED:
        raise ValueError(f"frame {shown} has no forces: {results.frames[shown].failed_reason}")
    with paper_style():
        if name == "difference" and against is not None:
            return _draw_difference_of_runs(results, against, shown, width)
        if name in NEED_TRUTH:
            if truth is None:
                raise ValueError("no truth is known: the experiment file names none")
            if name == "truth":
                return draw_truth(results, truth, shown, width)
            return draw_difference(compare_with_truth(results, truth, name="inferred"), shown, width)
        return _DRAW[name](results, shown, width)


def _draw_difference_of_runs(results: Results, against: Results, frame: int, width: Width) -> Figure:
    names = (results.name, against.name if against.name != results.name else f"other {against.name}")
    comparison = compare_runs(results, against, names=names)
    if frame >= len(comparison.base.frames):
        raise ValueError(f"frame {frame} is not in both runs")
    return draw_difference(comparison, frame, width)


def default_frame(results: Results) -> int:
    """Return the last settled frame; if there is none, the last with forces."""
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
    """Write every figure for which the run has data.

    Parameters
    ----------
    results : Results
        The results of the run.
    folder : Path
        Folder of the figures; it is created.
    kinds : sequence of str
        Kinds of files: "pdf", "svg", "png".
    frame : int, optional
        The frame; None: `default_frame`.
    width : str
        "single" or "double" column.
    truth : TruthContacts, optional
        True forces, for the figures "truth" and "difference".

    Returns
    -------
    list of Path
        The files.
    """
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for name in get_args(FigureName):
        if name in NEED_TRUTH and truth is None:
            continue
        with suppress(NothingToDrawError):
            files += _write(draw_figure(results, name, frame, width=width, truth=truth), folder / name, kinds)
    return files


def write_paper_set(
    results: Results,
    folder: Path,
    kinds: Sequence[FileKind],
    *,
    frame: int | None = None,
    width: Width = "double",
    truth: TruthContacts | None = None,
    pictures: Sequence[Picture] = (),
) -> list[Path]:
    """Write the figures of the paper that introduced the method, from a run.

    Parameters
    ----------
    results : Results
        The results of the run.
    folder : Path
        Folder of the figures; it is created.
    kinds : sequence of str
        Kinds of files: "pdf", "svg", "png".
    frame : int, optional
        The frame with which the strip of networks ends; None: `default_frame`.
    width : str
        "single" or "double" column.
    truth : TruthContacts, optional
        True forces, as recorded ones.
    pictures : sequence of Picture
        Photographs of the first and the last frame.

    Returns
    -------
    list of Path
        apparatus, zero_forces, networks, recorded.

    Raises
    ------
    IndexError, ValueError
        There is no such frame, or fewer than two frames have forces.
    """
    shown = default_frame(results) if frame is None else frame
    if not 0 <= shown < len(results.frames):
        raise IndexError(f"there is no frame {shown}: frames go from 0 to {len(results.frames) - 1}")
    candidates = 1 + even_subset(len(results.frames) - 1, ZERO_STARTS)
    found = [each for each in solve_from_zero(results, candidates.tolist()) if np.isfinite(each.agreement)]
    if len(found) < 2:
        raise ValueError("fewer than two frames have forces: the paper's figures compare frames")
    found.sort(key=lambda each: each.agreement)
    folder.mkdir(parents=True, exist_ok=True)
    with paper_style():
        figures = {
            "apparatus": draw_apparatus(results, pictures, width),
            "zero_forces": draw_zero_starts(results, found[0], found[-1], width),
            "networks": draw_strip(results, shown, width),
            "recorded": draw_recorded(results, truth, shown, width),
        }
    return [file for name, figure in figures.items() for file in _write(figure, folder / name, kinds)]


def _write(figure: Figure, stem: Path, kinds: Sequence[FileKind]) -> list[Path]:
    """Write a figure as files of these kinds."""
    files = [stem.with_suffix(f".{kind}") for kind in kinds]
    for file, kind in zip(files, kinds, strict=True):
        stream = io.BytesIO()  # a file that cannot be written to confuses matplotlib
        with paper_style():  # holds the fonts of PDF and SVG
            figure.savefig(stream, format=kind)
        write_atomically(file, stream.getvalue())
    return files
