"""Macroscopic quantities over time, with their intervals where these are known."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from ..drawing.accumulated_strain import accumulated_strains
from ..results.results import Results
from ..solver.bodies.grains import Array
from ..solver.frame_forces import FrameStatus
from .figure_style import COLOURS, DASHES, GRID, Width, add_title, new_figure

STATUS_MARKS = {
    FrameStatus.RESET: "o", FrameStatus.SUSPECT: "x", FrameStatus.REARRANGING: "^", FrameStatus.FAILED: "D",
}  # fmt: skip
DEGREE = 180.0 / np.pi
# Per panel: label of the axis, and field, name and factor of every curve.
PANELS: tuple[tuple[str, tuple[tuple[str, str, float], ...]], ...] = (
    ("friction angle [°]", (("friction_angle", "φ", DEGREE), ("wall_ratio_angle", "at the plate", DEGREE))),
    (
        "coordination number",
        (("coordination_number", "z", 1.0), ("coordination_number_without_rattlers", "without rattlers", 1.0)),
    ),
    ("fraction", (("sliding_fraction", "sliding", 1.0), ("mobilisation", "mobilisation", 1.0))),
)


def draw_time(results: Results, frame: int, width: Width) -> Figure:
    """Draw friction angle, coordination number, sliding and trust over time; bands are two standard deviations."""
    figure = new_figure(width, 1.45 if width == "single" else 0.95)
    panels = figure.subplots(len(PANELS) + 1, 1, sharex=True)
    for axes, (axis_label, curves) in zip(panels[:-1], PANELS, strict=True):
        for (name, label, factor), colour, dash in zip(curves, COLOURS, DASHES, strict=False):
            _curve(axes, results, name, label, factor, colour, dash)
        axes.set_ylabel(axis_label)
        axes.legend(loc="best", ncols=2)
    _trust(panels[-1], results)
    panels[-1].set_xlabel("time [s]")
    for axes in panels:
        axes.axvline(results.tracks.time[frame], color=GRID, linewidth=0.8, zorder=0)
        axes.yaxis.get_major_locator().set_params(nbins=4)
    _add_strain(panels[0], results)
    figure.align_ylabels()
    add_title(panels[0], f"{results.name}: the test over time")
    return figure


def _add_strain(axes: Axes, results: Results) -> None:
    """Add an axis of the accumulated strain on top, which goes on through a reversal."""
    strain = 100.0 * np.array(accumulated_strains([each.strain for each in results.frames]))
    time = results.tracks.time
    known = np.isfinite(strain)
    if known.sum() < 2 or not strain[known][-1] > strain[known][0]:
        return
    at, value = time[known], np.maximum.accumulate(strain[known] + 1e-9 * np.arange(known.sum()))

    # An axis is wider than its data: beyond them time and strain go on at their mean rate.
    rate, margin = (value[-1] - value[0]) / (at[-1] - at[0]), at[-1] - at[0]
    at = np.concatenate([[at[0] - margin], at, [at[-1] + margin]])
    value = np.concatenate([[value[0] - rate * margin], value, [value[-1] + rate * margin]])

    def strain_of(when: ArrayLike) -> Array:
        return np.asarray(np.interp(np.asarray(when), at, value))

    def time_of(accumulated: ArrayLike) -> Array:
        return np.asarray(np.interp(np.asarray(accumulated), value, at))

    top = axes.secondary_xaxis("top", functions=(strain_of, time_of))
    top.set_xlabel("accumulated strain [%]")


def _curve(axes: Axes, results: Results, name: str, label: str, factor: float, colour: str, dash: object) -> None:
    value = factor * np.array([getattr(each, name) for each in results.statistics], np.float64)
    if not np.isfinite(value).any():
        return
    time = results.tracks.time
    axes.plot(time, value, color=colour, linestyle=dash, label=label)  # type: ignore[arg-type]
    deviation = [getattr(each, f"{name}_sd", None) for each in results.statistics]
    if all(each is not None for each in deviation):
        half_width = 2.0 * factor * np.array(deviation, np.float64)
        axes.fill_between(time, value - half_width, value + half_width, color=colour, alpha=0.18, linewidth=0.0)


def _trust(axes: Axes, results: Results) -> None:
    time, trust = results.tracks.time, np.array([each.trust for each in results.frames])
    axes.plot(time, trust, color=COLOURS[2], label="trust")
    for status, mark in STATUS_MARKS.items():
        here = np.array([each.status is status for each in results.frames])
        if here.any():
            height = np.where(np.isfinite(trust[here]), trust[here], 0.05)
            axes.plot(time[here], height, mark, color=COLOURS[1], mfc="white", label=status.name.lower())
    axes.set(ylim=(0.0, 1.05), ylabel="trust")
    axes.legend(loc="lower right", ncols=3)
