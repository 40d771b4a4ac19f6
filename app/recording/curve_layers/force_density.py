"""Writes the probability density of contact forces over their mean, on a logarithmic axis."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from ...solver.bodies.grains import Array
from ...solver.statistics.force_statistics import mean_normal_force
from ..look import entities
from ..look.axes import Axes, log_texts
from ..look.clock import Clock
from ..look.colours import INK, SERIES
from ..look.values import dots, strips

LARGEST = 8.0  # f_n / ⟨f_n⟩ at the right end of the axis
BINS = 32
DECADES = (-4.0, 0.5)  # log10 of the density, bottom and top

AXES = Axes((0.0, LARGEST), DECADES)
EDGES = np.linspace(0.0, LARGEST, BINS + 1)


class ForceDensity:
    """Histogram of forces, of each frame and pooled over the frames so far."""

    def __init__(self) -> None:
        self._pooled = np.zeros(BINS)  # counts
        self._total = 0  # forces counted, including those beyond the axis

    def log_axes(self, stream: rr.RecordingStream) -> None:
        """Log axes with the exponential e^(−f/⟨f⟩) for comparison."""
        x = np.linspace(0.0, LARGEST, 33)
        AXES.log(
            stream,
            entities.FORCE_DENSITY_AXES,
            x_ticks=[(float(v), f"{v}") for v in range(0, 9, 2)],
            y_ticks=[(-4.0, "10⁻⁴"), (-3.0, "10⁻³"), (-2.0, "10⁻²"), (-1.0, "10⁻¹"), (0.0, "1")],
            notes=[
                (6.2, 0.34, "this frame", SERIES[0]), (6.2, 0.06, "all frames so far", SERIES[1]),
                (6.2, -0.22, "thin: exp(−x)", INK), (7.0, -3.62, "f_n / mean f_n", INK), (0.5, 0.4, "P", INK),
            ],
            guides=[AXES.points(x, -x * np.log10(np.e))],
        )  # fmt: skip

    def log(self, clock: Clock, fn: Array, tail_exponent: float) -> None:
        """Log the density of one frame, with its exponential tail, and of all so far."""
        loaded = fn[np.isfinite(fn) & (fn > 0.0)]
        counts = np.histogram(loaded / mean_normal_force(fn), EDGES)[0] if len(loaded) else np.zeros(BINS)
        self._pooled += counts
        self._total += len(loaded)
        clock.end()
        clock.log(
            entities.FORCE_DENSITY,
            dots(density_points(*merge_bins(counts, 1), len(loaded)), 4.0, SERIES[0], 20.0),
        )
        clock.log(
            entities.FORCE_DENSITY_POOLED,
            strips([density_points(*merge_bins(self._pooled), self._total)], 1.6, SERIES[1], 10.0),
        )
        self._log_tail(clock, loaded / mean_normal_force(fn) if len(loaded) else loaded, tail_exponent)

    def _log_tail(self, clock: Clock, ratio: Array, exponent: float) -> None:
        """Log the density S β exp(−β (x − 1)) above the mean; S is the fraction of the forces (c,) above it."""
        lines, texts = [], []
        above = float(np.mean(ratio > 1.0)) if len(ratio) else 0.0
        if np.isfinite(exponent) and exponent > 0.0 and above > 0.0:
            x = np.linspace(1.0, LARGEST, 29)
            power = np.log10(above * exponent) - exponent * (x - 1.0) * np.log10(np.e)
            shown = power >= DECADES[0]
            lines = [AXES.points(x[shown], power[shown])]
            texts = [(AXES.points(np.array(6.2), np.array(-0.5)), f"its tail exp(−{exponent:.2f} x)", SERIES[0])]
        clock.log(entities.FORCE_DENSITY_TAIL, strips(lines, 0.9, SERIES[0], 15.0))
        log_texts(clock, entities.FORCE_DENSITY_TAIL_VALUE, texts, static=False)


def merge_bins(counts: Array, least: int = 4) -> tuple[Array, Array, Array]:
    """Merge neighbouring bins above the mean until each contains `least` forces.

    Parameters
    ----------
    counts : array (BINS,)
        Forces per bin.
    least : int
        Least number of forces of a merged bin.

    Returns
    -------
    centre, count, width : array (k,)
        The merged bins.
    """
    centre, count, width, start = [], [], [], 0
    for stop in range(1, BINS + 1):
        total = counts[start:stop].sum()
        if total >= least or EDGES[stop] <= 1.0:
            centre.append(0.5 * (EDGES[start] + EDGES[stop]))
            count.append(total)
            width.append(EDGES[stop] - EDGES[start])
            start = stop
    return np.array(centre), np.array(count), np.array(width)


def density_points(centre: Array, count: Array, width: Array, total: int) -> NDArray[np.float32]:
    """Return densities of `total` forces as points of the view (k, 2), without empty bins and those below the axis."""
    with np.errstate(divide="ignore"):
        power = np.log10(count / (max(total, 1) * width))
    shown = power >= DECADES[0]
    return AXES.points(centre[shown], power[shown])
