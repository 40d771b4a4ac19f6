"""Writes how sure contact detection is of a frame's contacts, of the probability that their two bodies touch."""

from __future__ import annotations

import numpy as np
import rerun as rr

from solver.sequence.frame_forces import FrameForces

from ..look import entities
from ..look.clock import Clock
from ..look.colours import SERIES
from ..look.values import log_scalar

DOUBTFUL = 0.5  # below it a contact is more likely open than not


def log_touching_styles(stream: rr.RecordingStream) -> None:
    """Log names and colours of the curves."""
    for path, name, colour in (
        (entities.EXPECTED_COUNT, "expected: sum of P(touch)", SERIES[1]),
        (entities.DOUBTFUL_COUNT, "kept with P(touch) < 1/2", SERIES[3]),
    ):
        stream.log(path, rr.SeriesLines(colors=[colour], names=name, widths=2.0), static=True)


def log_touching(clock: Clock, forces: FrameForces) -> None:
    """Log how many contacts one frame is expected to have, and how many are doubtful."""
    probability = forces.probability
    clock.end()
    computed = bool(np.isfinite(probability).any())
    log_scalar(clock, entities.EXPECTED_COUNT, float(np.nansum(probability)) if computed else np.nan)
    log_scalar(clock, entities.DOUBTFUL_COUNT, float(np.sum(probability < DOUBTFUL)) if computed else np.nan)
