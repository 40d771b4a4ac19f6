"""Writes log10 of the residuals of every sweep, as the viewer has no logarithmic axis."""

from __future__ import annotations

import numpy as np
import rerun as rr

from ...solver.bodies.grains import Array
from ...solver.frame_forces import FrameForces
from ..look import entities
from ..look.clock import Clock
from ..look.colours import INK, SERIES
from ..look.values import log_curve_style, log_scalar, send_scalars

SMALLEST = 1e-16  # smaller residuals are drawn here: rounding level


def log_residual_styles(stream: rr.RecordingStream) -> None:
    """Log names and colours of the residual curves."""
    log_curve_style(stream, entities.SWEEP_NATURAL_MAP, "natural map", SERIES[0], 1.5)
    log_curve_style(stream, entities.SWEEP_UNBALANCE, "worst force residual / mean f_n", SERIES[1], 1.5)
    log_curve_style(stream, entities.SWEEP_FORCE_CHANGE, "greatest |Δf|/|f| of a contact", SERIES[3], 1.0)


def log_tolerance(clock: Clock, tolerance: float) -> None:
    """Log the stopping level, once per frame."""
    clock.start()
    log_scalar(clock, entities.TOLERANCE, float(power_of_ten(np.array(tolerance))))


def log_tolerance_style(stream: rr.RecordingStream) -> None:
    """Log name and colour of the stopping level."""
    log_curve_style(stream, entities.TOLERANCE, "stopping level", INK, 1.0)


def log_residuals(clock: Clock, forces: FrameForces) -> None:
    """Log the residuals of every measured sweep of one frame (at least one), then those of the reported field.

    The change of the last sweep stays, as the reported field has none.
    """
    history = forces.history
    for path, residual, reported in (
        (entities.SWEEP_NATURAL_MAP, history.natural_map, forces.natural_map),
        (entities.SWEEP_UNBALANCE, history.unbalance, forces.unbalance),
        (entities.SWEEP_FORCE_CHANGE, history.force_change, history.force_change[-1]),
    ):
        powers = power_of_ten(residual)
        known = np.flatnonzero(np.isfinite(powers))  # unmeasured sweeps are left out: gaps would interrupt the curve
        if len(known):
            when = rr.TimeColumn(entities.SWEEP, sequence=clock.first + known)
            send_scalars(clock, path, when, powers[known])
        clock.end()
        log_scalar(clock, path, float(power_of_ten(np.array(reported))))


def power_of_ten(residual: Array) -> Array:
    """Return log10 of residuals, at least that of SMALLEST; NaN stays NaN, infinity becomes NaN."""
    residual = np.where(np.isinf(residual), np.nan, residual)
    return np.log10(np.maximum(residual, SMALLEST))
