"""The poses of the grains in one photograph."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array


@dataclass(frozen=True, slots=True)
class FramePoses:
    """The poses of n grains in one photograph. Grains without a pose have NaN."""

    x: Array  # (n,) [px] column
    y: Array  # (n,) [px] row, down
    rotation: Array  # (n,) [rad] from the first photograph, positive from x towards y, continuous
    sigma: Array  # (n,) [px] standard deviation of a component of the displacement from the first photograph
    zncc: Array  # (n,) correlation with the reference patch
    second_zncc: Array  # (n,) of the best other place where a search found the grain, 0: none; NaN: not searched
    status: NDArray[np.uint8]  # (n,) TrackStatus
    reference: NDArray[np.int32]  # (n,) photograph that the reference patch was cut out of

    @property
    def has_pose(self) -> NDArray[np.bool_]:
        return np.isfinite(self.x)

    @property
    def pose(self) -> Array:
        """x, y, rotation (n, 3)."""
        return np.stack([self.x, self.y, self.rotation], axis=1)
