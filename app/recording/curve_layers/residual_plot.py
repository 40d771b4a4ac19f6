"""Draws the residuals of a frame over its sweeps on two logarithmic axes, which the viewer lacks.

The curves are those of the chain, with the stopping level and the residuals of a start from zero forces; on the
timeline `sweep` points move along the curves.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from ...solver.bodies.grains import Array
from ...solver.frame_forces import FrameForces
from ...solver.nlgs.start_residuals import COLD_SWEEPS
from ...solver.nlgs.sweep_record import SweepHistory
from ...solver.statistics.force_statistics import mean_normal_force
from ..look import entities
from ..look.axes import Axes
from ..look.clock import Clock
from ..look.colours import INK, SERIES, Rgba, packed
from ..look.values import dots, strips
from ..packing_layers.residual_maps import changes_per_sweep

DECADES = (-6.0, 2.0)  # log10 of a residual, bottom and top
MAX_POINTS = 220  # of a curve
MIN_SWEEPS = 1000  # least range of the axis
COLOURS: tuple[Rgba, ...] = (SERIES[0], SERIES[1], SERIES[3])  # natural map, unbalance, mean change
COLD: Rgba = (176, 222, 128, 150)
_POWERS = "⁰¹²³⁴⁵⁶"


class ResidualPlot:
    """Draws the residuals of frames; the axis of sweeps covers the sweeps of the first frame."""

    def __init__(self, tolerance: float | None) -> None:
        self._tolerance = tolerance
        self._axes: Axes | None = None

    def continue_in(self, stream: rr.RecordingStream) -> None:
        """Log the axes into another stream."""
        if self._axes is not None:
            self._log_axes(stream, self._axes)

    def log(self, clock: Clock, forces: FrameForces, marked: NDArray[np.int64]) -> None:
        """Draw one frame.

        Parameters
        ----------
        clock : Clock
            The frame on the timelines.
        forces : FrameForces
            The frame, with the residuals of at least one sweep.
        marked : array (r,)
            Sweeps, ascending, at which points are drawn on the curves.
        """
        history, cold = forces.history, forces.cold_residual
        cold = np.full(len(COLD_SWEEPS), np.nan) if cold is None else cold
        axes = self._axes or self._begin(clock.stream, history.count)
        residuals = np.stack([history.natural_map, history.unbalance, mean_changes(history)])
        curves = [axes_points(axes, *envelope(each)) for each in residuals]
        known = np.isfinite(cold) & (cold > 0.0)
        lines = [*curves, axes_points(axes, COLD_SWEEPS[known].astype(float), cold[known])]
        shown = [len(line) > 1 for line in lines]
        clock.start()
        clock.log(
            entities.RESIDUAL_CURVES,
            strips(
                [line for line, keep in zip(lines, shown, strict=True) if keep], np.array([1.4, 1.0, 0.8, 1.2])[shown],
                packed(np.array([*COLOURS, COLD], np.uint8)[shown]), 10.0,
            ),
        )  # fmt: skip
        self._mark_reported(clock, axes, forces)
        self._mark(clock, axes, residuals, np.unique(np.clip(marked, 0, history.count - 1)))

    def _mark(self, clock: Clock, axes: Axes, residuals: Array, at: NDArray[np.int64]) -> None:
        """Log points on the curves (3, s) at sweeps; the first row contains their style."""
        rows = at if len(at) and at[0] == 0 else np.concatenate([[0], at])
        places = [axes_points(axes, np.full(3, 1.0 + row), residuals[:, row], keep=True) for row in rows.tolist()]
        clock.start()
        clock.log(entities.RESIDUAL_MARKS, dots(places[0], 4.5, packed(np.array(COLOURS, np.uint8)), 20.0))
        if len(rows) > 1:
            columns = rr.Points2D.columns(positions=np.concatenate(places[1:]))
            clock.send(entities.RESIDUAL_MARKS, clock.columns(rows[1:]), columns.partition(np.full(len(rows) - 1, 3)))

    def _mark_reported(self, clock: Clock, axes: Axes, forces: FrameForces) -> None:
        """Log the unbalance of the reported field, beyond the last sweep, with its name."""
        sweep, value = np.array([forces.history.count + 1.0]), np.array([forces.unbalance])
        known = np.isfinite(value)
        clock.end()
        clock.log(
            entities.RESIDUAL_REPORTED,
            rr.Points2D(
                axes_points(axes, sweep[known], value[known], keep=True), radii=np.float32(6.5),
                colors=packed(np.array(COLOURS[1:2], np.uint8)[known]), labels=["reported"] * int(known.sum()),
                show_labels=True, draw_order=30.0,
            ),
        )  # fmt: skip

    def _begin(self, stream: rr.RecordingStream, count: int) -> Axes:
        decades = float(np.ceil(np.log10(max(count, MIN_SWEEPS)) - 1e-9))
        self._axes = Axes((0.0, decades), DECADES)
        self._log_axes(stream, self._axes)
        return self._axes

    def _log_axes(self, stream: rr.RecordingStream, axes: Axes) -> None:
        """Log the axes, static."""
        decades, level = axes.x_range[1], []
        if self._tolerance is not None and self._tolerance > 0.0:
            height = float(np.clip(np.log10(self._tolerance), *DECADES))
            level = [axes.points(np.array([0.0, decades]), np.full(2, height))]
        notes = [
            (0.24, 0.98, "natural map", COLOURS[0]),
            (0.24, 0.91, "of a cold start", (*COLD[:3], 255)),
            (0.68, 0.98, "worst force residual / mean f_n", COLOURS[1]),
            (0.68, 0.91, "change per sweep / mean f_n", COLOURS[2]),
            (0.5, 0.06, "across: sweep", INK),
        ]  # fmt: skip
        if level:
            notes.append((0.46, 0.84, "straight: stopping level", INK))
        axes.log(
            stream,
            entities.RESIDUAL_AXES,
            x_ticks=[(float(k), _power(k)) for k in range(int(decades) + 1)],
            y_ticks=[(float(k), _power(k)) for k in range(int(DECADES[0]), int(DECADES[1]) + 1, 2)],
            notes=[(x * decades, DECADES[0] + y * (DECADES[1] - DECADES[0]), text, of) for x, y, text, of in notes],
            guides=level,
        )


def mean_changes(history: SweepHistory) -> Array:
    """Return the mean |Δf| per sweep over the mean f_n at the end of the chain.

    The greatest |Δf| / |f| of a contact, in contrast, depends on the weakest contacts only.

    Parameters
    ----------
    history : SweepHistory
        Sweeps of one frame.

    Returns
    -------
    array (s,)
        The mean since the logarithmically spaced sweep before; NaN at others.
    """
    mean = np.full(history.count, np.nan)
    if len(history.recorded) > 1 and history.fn.shape[1]:
        rows = history.spaced_rows  # others are stored rounded
        recorded = history.recorded[rows]
        change = changes_per_sweep(recorded, history.fn[rows], history.ft[rows]).mean(axis=1)
        level = mean_normal_force(history.fn[-1])
        if level > 0.0:
            mean[recorded[1:]] = change / level
    return mean


def envelope(residual: Array) -> tuple[Array, Array]:
    """Thin a curve to logarithmic steps.

    Parameters
    ----------
    residual : array (s,)
        Residual of every sweep.

    Returns
    -------
    sweep, residual : array (k,)
        Sweep, counted from 1, and value of the greatest residual of each step.
    """
    edges = np.unique(np.round(np.geomspace(1.0, len(residual) + 1.0, MAX_POINTS)).astype(np.int64)) - 1
    known = np.where(np.isfinite(residual), residual, -1.0)
    at = [a + int(np.argmax(known[a:b])) for a, b in pairwise(edges.tolist())]
    at = np.array(at, np.int64)
    at = at[known[at] > 0.0]
    return (1.0 + at).astype(np.float64), residual[at]


def axes_points(axes: Axes, sweep: Array, residual: Array, *, keep: bool = False) -> NDArray[np.float32]:
    """Return points of the plot.

    Parameters
    ----------
    axes : Axes
        Axes of log10 of sweep and residual; points outside are drawn at their ends.
    sweep, residual : array (k,)
        Sweep, counted from 1, and residual.
    keep : bool
        Draw unknown and zero residuals at the bottom; otherwise they are left out.

    Returns
    -------
    array (k, 2)
        View coordinates.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = np.log10(sweep), np.log10(residual)
    y = np.where(np.isfinite(y), y, DECADES[0]) if keep else y
    known = np.isfinite(y)
    return axes.points(np.clip(x[known], *axes.x_range), np.clip(y[known], *DECADES))


def _power(exponent: int) -> str:
    if exponent == 0:
        return "1"
    return f"10{'⁻' if exponent < 0 else ''}{_POWERS[abs(exponent)]}"
