"""Writes the expected number of contacts and the number of ambiguous ones, from P(touch)."""

from __future__ import annotations

import numpy as np
import rerun as rr

from ...solver.frame_forces import FrameForces
from ..look import entities
from ..look.clock import Clock
from ..look.colours import SERIES
from ..look.values import log_scalar

AMBIGUOUS = 0.5  # P(touch) below which a contact is more probably open than closed


def log_contact_count_styles(stream: rr.RecordingStream) -> None:
    """Log names and colours of the curves."""
    for path, name, colour in (
        (entities.EXPECTED_COUNT, "expected: sum of P(touch)", SERIES[1]),
        (entities.AMBIGUOUS_COUNT, "kept with P(touch) < 1/2", SERIES[3]),
    ):
        stream.log(path, rr.SeriesLines(colors=[colour], names=name, widths=2.0), static=True)


def log_contact_counts(clock: Clock, forces: FrameForces) -> None:
    """Log the expected number of contacts of one frame, and the number of ambiguous ones."""
    probability = forces.probability
    clock.end()
    computed = bool(np.isfinite(probability).any())
    log_scalar(clock, entities.EXPECTED_COUNT, float(np.nansum(probability)) if computed else np.nan)
    log_scalar(clock, entities.AMBIGUOUS_COUNT, float(np.sum(probability < AMBIGUOUS)) if computed else np.nan)
