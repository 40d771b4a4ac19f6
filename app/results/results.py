"""One run's results in memory, as the store keeps them and as recording, scoring and export read them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array, Grains
from solver.boundary.boundary import Boundary
from solver.calibration.calibrate import Calibration
from solver.contacts.pairs import Keys, make_keys
from solver.contacts.radius_tuning import RadiusTuning
from solver.convex.friction_check import FrictionCheck
from solver.sequence.frame_forces import FrameForces
from solver.statistics.frame_statistics import FrameStatistics

from ..tracks import Tracks, WallTracks


@dataclass(frozen=True, slots=True)
class TruthContacts:
    """True (or manually judged) contact forces, sorted by frame. j >= number of grains is a wall."""

    frame: NDArray[np.int64]  # (t,)
    i: NDArray[np.int64]  # (t,) row of a grain
    j: NDArray[np.int64]  # (t,) row of a grain, j > i, or grain count + row of a wall
    fn: Array  # (t,) [N]
    ft: Array  # (t,) [N]

    def outside(self, boundary: NDArray[np.bool_] | None) -> TruthContacts:
        """The same without contacts between two grains of the boundary (n,); None: there is none."""
        if boundary is None:
            return self
        of_boundary = np.append(boundary, False)  # whatever is no grain
        n = len(boundary)
        keep = ~(of_boundary[np.minimum(self.i, n)] & of_boundary[np.minimum(self.j, n)])
        return TruthContacts(self.frame[keep], self.i[keep], self.j[keep], self.fn[keep], self.ft[keep])

    def by_frame(self, bodies: int, frame_count: int) -> tuple[tuple[Keys, Array], ...]:
        """Keys (c,) of the pairs and forces (c, 2) [N] of every frame; bodies: grains and walls together."""
        key, force = make_keys(self.i, self.j, bodies), np.column_stack([self.fn, self.ft])
        bounds = np.searchsorted(self.frame, np.arange(frame_count + 1))
        return tuple((key[a:b], force[a:b]) for a, b in pairwise(bounds))


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
    boundary: Boundary | None = None  # None: taken as it was told
    ensemble_size: int = 0  # sequences solved again for the standard deviations of the forces; 0: free formula
