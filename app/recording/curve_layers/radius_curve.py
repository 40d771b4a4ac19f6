"""Draws the coordination number over a common change of all radii, if the radii were tuned by it."""

from __future__ import annotations

import numpy as np
import rerun as rr

from ...solver.contacts.radius_tuning import RadiusTuning
from ..look import entities
from ..look.axes import Axes, round_ticks
from ..look.colours import INK, SERIES
from ..look.values import dots, strips

WIDTH, HEIGHT = 400.0, 480.0  # of the plot, in units of its view
RADIUS_BOUNDS = ((-60.0, WIDTH + 25.0), (-15.0, HEIGHT + 45.0))  # of a view with its labels


def log_radius_curve(stream: rr.RecordingStream, tuning: RadiusTuning) -> None:
    """Log the curve z(δR), static, with the target coordination number and the change that was found."""
    change, number = 1e6 * tuning.change, tuning.coordination_number
    low, high = min(float(number.min()), tuning.wanted), max(float(number.max()), tuning.wanted)
    margin = 0.1 * max(high - low, 0.1)
    axes = Axes(
        (float(change[0]), float(change[-1])), (low - 2.0 * margin, high + 3.0 * margin), width=WIDTH, height=HEIGHT
    )
    span = axes.x_range[1] - axes.x_range[0]
    wanted = axes.points(np.array(axes.x_range), np.full(2, tuning.wanted))
    notes = [(axes.x_range[0] + 0.66 * span, low - 0.6 * margin, "change of all radii [µm]", INK)]
    notes += [(axes.x_range[0] + 0.25 * span, high + 2.7 * margin, "z without rattlers", SERIES[0])]
    if tuning.met:
        label = f"z = {tuning.reached:.2f} at {1e6 * tuning.found:+.1f} µm"
        notes += [(axes.x_range[0] + 0.25 * span, high + 1.9 * margin, label, SERIES[2])]
    axes.log(
        stream, entities.RADIUS_AXES, x_ticks=round_ticks(*axes.x_range, 4.0),
        y_ticks=round_ticks(*axes.y_range, 4.0), notes=notes, guides=[wanted],
    )  # fmt: skip
    stream.log(entities.RADIUS_CURVE, strips([axes.points(change, number)], 1.6, SERIES[0], 10.0), static=True)
    found = axes.points(np.array([1e6 * tuning.found]), np.array([tuning.reached])) if tuning.met else []
    stream.log(entities.RADIUS_FOUND, dots(found, 6.0, SERIES[2], 20.0), static=True)
