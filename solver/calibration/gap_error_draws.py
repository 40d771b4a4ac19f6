"""Random errors of gaps by the noise of positions, which all gaps of a grain in a frame share."""

from __future__ import annotations

import numpy as np
from numba import njit

from ..bodies.grains import Array
from .gaps import GapRows, MeasuredSequence


class GapErrorDraws:
    """Draws of the errors of the gaps of some rows.

    Notes
    -----
    e = n·(σ_j ξ_j − σ_i ξ_i), with ξ ~ N(0, I) for each grain and frame; a wall has none.
    """

    def __init__(self, sequence: MeasuredSequence, rows: GapRows, normal: Array, factor: float) -> None:
        """normal (m, 2): unit vectors of the gaps, from i towards j; factor: true over stated noise."""
        n = sequence.grain_count
        self._shape = sequence.position.shape
        self._sigma = factor * np.where(sequence.present, sequence.sigma, 0.0).ravel()
        start = rows.frame.astype(np.int64) * n
        self._first, self._second = start + rows.i, start + rows.second_grain(n)  # the same where there is a wall
        self._normal = normal

    def draw(self, rng: np.random.Generator) -> Array:
        """Draw the errors (m,) [m] of the gaps."""
        error = np.empty(len(self._normal))
        noise = rng.standard_normal(self._shape).reshape(-1, 2)
        _open_gaps(self._first, self._second, self._normal, self._sigma, noise, error)
        return error


@njit(cache=True, nogil=True, error_model="numpy")
def _open_gaps(first, second, normal, sigma, noise, error):  # type: ignore[no-untyped-def]
    """Set the errors (m,) of the gaps from unit noise (k, 2) of positions and sigma (k,); a wall has no noise."""
    for c in range(len(error)):
        i, j, x, y = first[c], second[c], normal[c, 0], normal[c, 1]
        error[c] = -sigma[i] * (x * noise[i, 0] + y * noise[i, 1])
        if j != i:
            error[c] += sigma[j] * (x * noise[j, 0] + y * noise[j, 1])
