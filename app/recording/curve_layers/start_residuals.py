"""Writes the residuals at the start of a solve: from the former forces (warm) and from zero forces (cold)."""

from __future__ import annotations

import numpy as np
import rerun as rr

from ...solver.frame_forces import FrameForces
from ..look import entities
from ..look.clock import Clock
from ..look.colours import SERIES
from ..look.values import log_scalar
from .convergence import power_of_ten


def log_start_styles(stream: rr.RecordingStream) -> None:
    """Log names and colours of the curves."""
    for path, name, colour in (
        (entities.COLD_RESIDUAL, "cold: one sweep from zero forces", SERIES[1]),
        (entities.WARM_RESIDUAL, "warm: one sweep from the former forces", SERIES[0]),
    ):
        stream.log(path, rr.SeriesLines(colors=[colour], names=name, widths=2.0), static=True)


def log_starts(clock: Clock, forces: FrameForces) -> None:
    """Log the start residuals of one frame."""
    clock.end()
    cold = np.nan if forces.cold_residual is None else forces.cold_residual[0]
    for path, value in (
        (entities.COLD_RESIDUAL, cold),
        (entities.WARM_RESIDUAL, forces.warm_residual),
    ):
        log_scalar(clock, path, float(power_of_ten(np.array(value))))
    log_scalar(clock, entities.SAVED_SWEEPS, forces.sweeps_saved)
