"""Synthetic photographs: noise, small enough for fast tests."""

from __future__ import annotations

import numpy as np
from rodsight.experiment.jpeg_photographs import JpegPhotograph, encode_jpeg

from tests.app.recording.fake_results import RADIUS

PIXEL = RADIUS / 12.0  # [m]
SHAPE = (240, 300)


def photograph(frame: int) -> JpegPhotograph:
    return encode_jpeg(np.random.default_rng(frame).integers(40, 220, SHAPE, dtype=np.uint8).astype(np.float32))
