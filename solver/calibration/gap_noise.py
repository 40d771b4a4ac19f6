"""What the noise of measured positions does to gaps: all gaps of a grain in a frame share it."""

from __future__ import annotations

import numpy as np

from solver.bodies.grains import Array
from solver.calibration.gaps import GapRows, MeasuredSequence


class GapNoise:
    """Errors of the gaps of some rows, to be drawn as often as wanted."""

    def __init__(self, sequence: MeasuredSequence, rows: GapRows, normal: Array, factor: float) -> None:
        """normal (m, 2): unit vectors of the gaps, from i towards j; factor: noise of positions over that stated."""
        n = sequence.grain_count
        self._frame, self._i, self._j, self._normal = rows.frame, rows.i, rows.second_grain(n), normal
        self._shape = sequence.position.shape
        self._sigma = factor * np.where(sequence.present, sequence.sigma, 0.0)[..., None]
        self._other = np.where(rows.with_wall(n), 0.0, 1.0)[:, None]  # a wall has no noise

    def draw(self, rng: np.random.Generator) -> Array:
        """Errors (m,) [m] of the gaps."""
        noise = self._sigma * rng.standard_normal(self._shape)
        apart = self._other * noise[self._frame, self._j] - noise[self._frame, self._i]
        return np.einsum("mk,mk->m", self._normal, apart)
