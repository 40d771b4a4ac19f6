"""Charts of the tracking report as SVG, whose text remains text on screen and on paper."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...solver.bodies.grains import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.ticker import MaxNLocator

SIZE = (5.6, 3.1)  # [in] of a chart, at 72 px each as SVG has it
INK, FAINT = "#1d2430", "#d5d9df"

# Colours that colour-blind readers distinguish (Okabe & Ito 2008); dashes and names distinguish them in print.
LINES = (("#0072b2", "-"), ("#d55e00", "--"), ("#009e73", ":"))
BARS = ("#56b4e9", "#e69f00", "#cc79a7", "#000000", "#999999")

STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",  # letters, not their outlines
    "svg.hashsalt": "tracking",  # the same chart has the same bytes
    "font.family": "DejaVu Sans",  # comes with matplotlib and is wide: a page's substitute font fits as well
    "font.size": 10.0,
    "text.color": INK,
    "axes.labelcolor": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.edgecolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.formatter.useoffset": False,
    "axes.grid.axis": "y",
    "axes.grid": True,
    "grid.color": FAINT,
    "axes.axisbelow": True,
}
NO_METADATA = {"Creator": None, "Date": None, "Format": None, "Type": None}


@dataclass(frozen=True, slots=True)
class Labels:
    """Title and axis labels of a chart."""

    title: str
    across: str
    up: str


def line_chart(x: NDArray[np.int64], lines: Mapping[str, Array], labels: Labels) -> str:
    """Draw lines (f,) by name over x (f,), labelled at their ends; values that are not finite interrupt a line."""

    def draw(axes: Axes) -> None:
        axes.xaxis.set_major_locator(_whole_numbers())
        known = {name: line for name, line in lines.items() if np.isfinite(line).any()}
        ends = []
        for (name, line), (colour, dashes) in zip(known.items(), LINES, strict=False):
            marker = "o" if len(x) < 30 else None  # a single photograph draws no line
            axes.plot(x, line, color=colour, linestyle=dashes, linewidth=1.8, marker=marker, markersize=3.5)
            ends.append((float(line[np.isfinite(line)][-1]), name, colour))
        if not ends:
            axes.text(0.5, 0.5, "not known", ha="center", transform=axes.transAxes)
            axes.set_xticks([])
            axes.set_yticks([])
        axes.margins(x=0.02, y=0.08)
        low, high = axes.get_ylim()
        places = _apart([end[0] for end in ends], 0.075 * (high - low))
        for (_, name, colour), place in zip(ends, places, strict=True):
            axes.annotate(
                name, (1.0, place), xycoords=("axes fraction", "data"), xytext=(6, 0), textcoords="offset points",
                color=colour, va="center", fontweight="bold", annotation_clip=False,
            )  # fmt: skip
        axes.set_ylim(low, high)

    return _draw(draw, labels)


def stacked_chart(x: NDArray[np.int64], bars: Mapping[str, NDArray[np.int64]], labels: Labels) -> str:
    """Draw stacked bars of counts (f,) by name over x (f,)."""

    def draw(axes: Axes) -> None:
        axes.xaxis.set_major_locator(_whole_numbers())
        below = np.zeros(len(x), dtype=np.int64)
        for (name, count), colour in zip(bars.items(), BARS, strict=False):
            axes.bar(x, count, bottom=below, width=0.8, color=colour, edgecolor="white", linewidth=0.5, label=name)
            below = below + count
        axes.set_xlim(float(x.min()) - 0.6, float(x.max()) + 0.6)
        axes.set_ylim(0.0, max(float(below.max()) * 1.25, 1.0))
        axes.yaxis.set_major_locator(_whole_numbers())
        if bars:
            axes.legend(loc="upper right", frameon=False, ncols=len(bars), handlelength=1.0, columnspacing=1.2)

    return _draw(draw, labels)


def _draw(draw: Callable[[Axes], None], labels: Labels) -> str:
    # Imported here, because runs without a report must not wait for it.
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(STYLE):
        figure = Figure(figsize=SIZE, layout="constrained")
        axes = figure.add_subplot()
        draw(axes)
        axes.set_title(labels.title, loc="left", fontweight="bold")
        axes.set_xlabel(labels.across)
        axes.set_ylabel(labels.up)
        written = io.StringIO()
        figure.savefig(written, format="svg", transparent=True, metadata=NO_METADATA)
    picture = written.getvalue()
    return picture[picture.index("<svg") :]


def _whole_numbers() -> MaxNLocator:
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator("auto", integer=True, steps=[1, 2, 5, 10])


def _apart(values: Sequence[float], least: float) -> list[float]:
    """The values, moved apart so that labels at them do not overlap."""
    places = list(values)
    order = sorted(range(len(values)), key=values.__getitem__)
    for lower, upper in pairwise(order):
        places[upper] = max(places[upper], places[lower] + least)
    return places
