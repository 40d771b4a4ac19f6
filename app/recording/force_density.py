"""Writes the probability density of contact forces over their mean, on a logarithmic axis."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from app.recording import entities
from app.recording.colours import SERIES, packed_one
from app.recording.plots import Axes
from app.recording.scene import Clock, mean_force
from solver.grains import Array

LARGEST = 8.0  # f_n / ⟨f_n⟩ at the right end of the axis
BINS = 32
DECADES = (-4.0, 0.5)  # log10 of the density, bottom and top

AXES = Axes((0.0, LARGEST), DECADES)
EDGES = np.linspace(0.0, LARGEST, BINS + 1)
CENTRES = 0.5 * (EDGES[1:] + EDGES[:-1])


class ForceDensity:
    """Counts forces frame by frame."""

    def __init__(self) -> None:
        self._pooled = np.zeros(BINS)  # counts
        self._total = 0  # forces counted, those beyond the axis too

    def log_axes(self, stream: rr.RecordingStream) -> None:
        """Log axes with the exponential e^(−f/⟨f⟩) for comparison."""
        x = np.linspace(0.0, LARGEST, 33)
        AXES.log(
            stream,
            entities.FORCE_DENSITY_AXES,
            entities.FORCE_DENSITY_TICKS,
            x_ticks=[(float(v), f"{v}") for v in range(0, 9, 2)],
            y_ticks=[(-4.0, "10⁻⁴"), (-3.0, "10⁻³"), (-2.0, "10⁻²"), (-1.0, "10⁻¹"), (0.0, "1")],
            notes=[
                (6.4, 0.26, "points: this frame"), (6.4, -0.02, "line: all frames so far"),
                (6.4, -0.3, "thin: exp(−x)"),
                (7.1, -3.62, "f_n / mean f_n"), (0.55, 0.36, "P"),
            ],
            guides=[AXES.points(x, -x * np.log10(np.e))],
        )  # fmt: skip

    def log(self, clock: Clock, fn: Array) -> None:
        """Log the density of one frame and of all so far."""
        loaded = fn[np.isfinite(fn) & (fn > 0.0)]
        counts = np.histogram(loaded / mean_force(fn), EDGES)[0] if len(loaded) else np.zeros(BINS)
        self._pooled += counts
        self._total += len(loaded)
        clock.end()
        clock.stream.log(
            entities.FORCE_DENSITY,
            rr.Points2D(
                density_points(counts, len(loaded)),
                radii=np.float32(4.0),
                colors=packed_one(SERIES[0]),
                draw_order=20.0,
            ),
        )
        clock.stream.log(
            entities.FORCE_DENSITY_POOLED,
            rr.LineStrips2D(
                [density_points(self._pooled, self._total)],
                radii=np.float32(1.6),
                colors=packed_one(SERIES[1]),
                draw_order=10.0,
            ),
        )


def density_points(counts: Array, total: int) -> NDArray[np.float32]:
    """Densities as points of the view (k, 2); empty bins and those below the axis have none."""
    with np.errstate(divide="ignore"):
        power = np.log10(counts / (max(total, 1) * (EDGES[1] - EDGES[0])))
    shown = power >= DECADES[0]
    return AXES.points(CENTRES[shown], power[shown])
