"""One run's results in memory, as the store keeps them and as recording, scoring and export read them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.tracks import Tracks, WallTracks
from solver.calibration import Calibration
from solver.frame_forces import FrameForces
from solver.frame_statistics import FrameStatistics
from solver.friction_check import FrictionCheck
from solver.grains import Array, Grains
from solver.radius_tuning import RadiusTuning


@dataclass(frozen=True, slots=True)
class TruthContacts:
    """True (or manually judged) contact forces, sorted by frame. j >= number of grains is a wall."""

    frame: NDArray[np.int64]  # (t,)
    i: NDArray[np.int64]  # (t,) row of a grain
    j: NDArray[np.int64]  # (t,) row of a grain, j > i, or grain count + row of a wall
    fn: Array  # (t,) [N]
    ft: Array  # (t,) [N]


@dataclass(frozen=True, slots=True)
class Results:
    """Everything one run found out."""

    name: str
    tracks: Tracks
    walls: WallTracks
    grains: Grains
    friction: float
    frames: Sequence[FrameForces]  # one per frame
    statistics: Sequence[FrameStatistics]  # one per frame
    configuration: str  # the resolved configuration, TOML
    calibration: Calibration | None = None  # None: not tried
    friction_check: FrictionCheck | None = None
    radius_tuning: RadiusTuning | None = None  # None: not asked for
