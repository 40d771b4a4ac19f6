"""What all figures for papers share: column widths, letters, lines, colours, units."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Literal

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

Width = Literal["single", "double"]
WIDTHS: dict[Width, float] = {"single": 85.0, "double": 175.0}  # [mm] of one column, and of a page of two
MILLIMETRE = 1.0 / 25.4  # in inches

# Dark enough on white, apart by a CIE76 of 25 under deuteranopia and protanopia, and in grey by their dashes.
BLUE, VERMILION, GREEN, PURPLE = "#006CD3", "#D55D00", "#009E74", "#AB4695"
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


@contextmanager
def paper_style() -> Iterator[None]:
    """Letters and lines of a paper while a figure is drawn, whatever the user's own settings are."""
    with rc_context(_STYLE):
        yield


def new_figure(width: Width, height: float) -> Figure:
    """An empty figure of a column's width; height over width. It needs no display."""
    across = WIDTHS[width] * MILLIMETRE
    figure = Figure(figsize=(across, height * across), layout="constrained", dpi=200)
    FigureCanvasAgg(figure)
    return figure


def add_title(axes: Axes, text: str) -> None:
    """Say above the axes what is seen, to the left and small."""
    axes.set_title(text, loc="left", fontsize=7.0)


def add_scale_bar(axes: Axes, length: float) -> None:
    """A bar of `length` [m] in the lower left corner, below the drawing, its length told in millimetres or metres."""
    told = f"{1e3 * length:g} mm" if length < 1.0 else f"{length:g} m"
    x0, y0 = axes.get_xlim()[0], axes.get_ylim()[0]
    width = abs(axes.get_xlim()[1] - x0)
    x, y = x0 + 0.02 * width, y0 + 0.035 * width
    axes.plot([x, x + length], [y, y], color=INK, linewidth=1.8, solid_capstyle="butt", zorder=9)
    axes.text(x + length + 0.012 * width, y, told, fontsize=7.0, va="center", zorder=9)
