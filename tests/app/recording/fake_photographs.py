"""Invented photographs: noise, small enough for every day."""

from __future__ import annotations

import numpy as np
from rodsight.experiment.shown import ShownPhotograph, show

from tests.app.recording.fake_results import RADIUS

PIXEL = RADIUS / 12.0  # [m]
SHAPE = (240, 300)


def photograph(frame: int) -> ShownPhotograph:
    return show(np.random.default_rng(frame).integers(40, 220, SHAPE, dtype=np.uint8).astype(np.float32))
