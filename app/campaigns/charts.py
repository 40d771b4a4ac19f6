"""Charts of a campaign as SVG: results over the varied parameters, and over the frames of every run."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ..figures.figure_style import COLOURS, DASHES, GRID, INK, new_figure, paper_style
from .collect import Row

Curve = Sequence[float | None]
# Columns of the catalogue that are drawn over a varied parameter, with the labels of their axes.
RESULTS = {
    "friction_angle_degrees": "friction angle [°]", "coordination_number": "coordination number", "trust": "trust",
    "r_fn": "r(f_n)",
}  # fmt: skip
MARKERS = "os^vDP"  # of curves with names, which differ in grey by these and their dashes
NAMED = 6  # curves with names of their own; more are drawn in grey, with their median


def varied_parameters(rows: Sequence[Row], keys: Sequence[str]) -> dict[str, list[float | None]]:
    """Return the numeric keys that have several values in the finished runs, with the value of every run."""
    found = {}
    for key in keys:
        values = [_number(row.get(key)) for row in rows]
        if len({each for each in values if each is not None}) > 1:
            found[key] = values
    return found


def draw_over_parameter(key: str, values: Sequence[float | None], rows: Sequence[Row]) -> str:
    """Draw results over a varied parameter, a point for every run and a line through the means of equal values.

    The wide bar of a run covers the tenth to the ninetieth percentile of its frames, the thin line two standard
    deviations of its forces.
    """
    shown = [name for name in RESULTS if any(_number(row.get(name)) is not None for row in rows)]
    with paper_style():
        figure = new_figure("double", 0.3 * math.ceil(len(shown) / 2))
        panels = figure.subplots(math.ceil(len(shown) / 2), 2, squeeze=False, sharex=True).ravel()
        for axes, name in zip(panels, shown, strict=False):
            points = [
                (x, y) for x, y in zip(values, (_number(row.get(name)) for row in rows), strict=True)
                if x is not None and y is not None
            ]  # fmt: skip
            grouped: dict[float, list[float]] = {}
            for x, y in points:
                grouped.setdefault(x, []).append(y)
            means = [(x, sum(ys) / len(ys)) for x, ys in sorted(grouped.items())]
            axes.plot(*zip(*means, strict=True), color=GRID, linewidth=1.0, zorder=1)
            axes.plot(*zip(*points, strict=True), "o", color=COLOURS[0], zorder=4)
            _draw_intervals(axes, name, values, rows)
            axes.set(xlabel=key, ylabel=RESULTS[name])
            axes.xaxis.set_tick_params(labelbottom=True)
        for axes in panels[len(shown) :]:
            axes.axis("off")
        return _svg(figure)


def _draw_intervals(axes: Axes, name: str, values: Sequence[float | None], rows: Sequence[Row]) -> None:
    for x, row in zip(values, rows, strict=True):
        middle, low, high, sd = (_number(row.get(f"{name}{end}")) for end in ("", "_low", "_high", "_sd"))
        if x is None or middle is None:
            continue
        if low is not None and high is not None:
            axes.plot([x, x], [low, high], color=COLOURS[0], alpha=0.35, linewidth=4.0, solid_capstyle="butt", zorder=2)
        if sd is not None:
            axes.plot([x, x], [middle - 2.0 * sd, middle + 2.0 * sd], color=COLOURS[0], linewidth=0.8, zorder=3)


def draw_over_frames(curves: Mapping[str, Curve], label: str) -> str:
    """Draw a value of every run over its frames; many runs in grey, with their median in colour."""
    with paper_style():
        figure = new_figure("double", 0.34)
        axes = figure.add_subplot()
        many = len(curves) > NAMED
        for number, (name, curve) in enumerate(curves.items()):
            known = [(k, value) for k, value in enumerate(curve) if value is not None]
            if known:
                colour = GRID if many else COLOURS[number % len(COLOURS)]
                mark = (
                    {}
                    if many
                    else {"linestyle": DASHES[number % len(DASHES)], "marker": MARKERS[number % len(MARKERS)]}
                )
                axes.plot(*zip(*known, strict=True), color=colour, label=None if many else name, **mark)
        if many:
            middle = [(k, value) for k, value in enumerate(_medians(list(curves.values()))) if value is not None]
            axes.plot(*zip(*middle, strict=True), color=INK, linewidth=1.6, label=f"median of {len(curves)} runs")
        axes.set(xlabel="frame", ylabel=label)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        return _svg(figure)


def _medians(curves: Sequence[Curve]) -> list[float | None]:
    found: list[float | None] = []
    for k in range(max(map(len, curves))):
        known = sorted(value for curve in curves if k < len(curve) for value in curve[k : k + 1] if value is not None)
        half = len(known) // 2
        found.append(None if not known else known[half] if len(known) % 2 else 0.5 * (known[half - 1] + known[half]))
    return found


def _number(value: Any) -> float | None:
    try:
        number = float(value)
    except (TypeError, ValueError):
        return None
    return number if math.isfinite(number) else None


def _svg(figure: Figure) -> str:
    """Return a figure as an SVG element, which a page contains directly."""
    stream = io.StringIO()
    figure.savefig(stream, format="svg", metadata={"Date": None})
    text = stream.getvalue()
    return text[text.index("<svg") :]
