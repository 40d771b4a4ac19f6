"""Common style of all figures for papers: column widths, fonts, lines, colours and scale bars."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Literal

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

Width = Literal["single", "double"]
WIDTHS: dict[Width, float] = {"single": 85.0, "double": 175.0}  # [mm] of one column, and of a page with two
MILLIMETRE = 1.0 / 25.4  # in inches

# Dark enough on white; CIE76 differences of at least 25 under all kinds of colour blindness; in grey the dashes differ.
BLUE, VERMILION, GREEN, PURPLE = "#005AD4", "#D55D00", "#009E74", "#AB4695"
COLOURS = (BLUE, VERMILION, GREEN, PURPLE)
DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.2, 1.2)), (0, (6, 1.5, 1.2, 1.5)))
INK, GRID, OUTLINE = "#1a1a1a", "#d8d8d8", "#b4b8c0"

_STYLE: dict[Any, Any] = {
    "font.size": 8.0, "font.family": "sans-serif", "mathtext.default": "regular", "axes.labelsize": 8.0,
    "axes.titlesize": 8.0, "xtick.labelsize": 7.0, "ytick.labelsize": 7.0, "legend.fontsize": 7.0,
    "axes.linewidth": 0.6, "axes.edgecolor": INK, "axes.labelcolor": INK, "text.color": INK, "xtick.color": INK,
    "ytick.color": INK, "xtick.major.width": 0.6, "ytick.major.width": 0.6, "lines.linewidth": 1.1,
    "lines.markersize": 3.0, "legend.frameon": False, "figure.facecolor": "white", "axes.facecolor": "white",
    "savefig.facecolor": "white", "pdf.fonttype": 42, "svg.fonttype": "none", "axes.spines.top": False,
    "axes.spines.right": False,
}  # fmt: skip


class NothingToDrawError(ValueError):
    """The run lacks what a figure shows."""


@contextmanager
def paper_style() -> Iterator[None]:
    """Apply fonts and lines for papers while the block runs, independent of the settings of the user."""
    with rc_context(_STYLE):
        yield


def new_figure(width: Width, height: float) -> Figure:
    """Return an empty figure of the width of a column, of a height in units of its width; it needs no display."""
    across = WIDTHS[width] * MILLIMETRE
    figure = Figure(figsize=(across, height * across), layout="constrained", dpi=200)
    FigureCanvasAgg(figure)
    return figure


def add_title(axes: Axes, text: str) -> None:
    """Add a small title above the axes, left-aligned."""
    axes.set_title(text, loc="left", fontsize=7.0)


def add_scale_bar(axes: Axes, length: float) -> None:
    """Add a bar of `length` [m] in the lower left corner, below the drawing, labelled in millimetres or metres."""
    label = f"{1e3 * length:g} mm" if length < 1.0 else f"{length:g} m"
    x0, y0 = axes.get_xlim()[0], axes.get_ylim()[0]
    width = abs(axes.get_xlim()[1] - x0)
    x, y = x0 + 0.02 * width, y0 + 0.045 * width
    axes.plot([x, x + length], [y, y], color=INK, linewidth=1.8, solid_capstyle="butt", zorder=9)
    axes.text(x + 0.5 * length, y - 0.022 * width, label, fontsize=6.0, va="top", ha="center", zorder=9)
