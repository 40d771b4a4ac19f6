"""Mean (affine) displacement field of a packing and the fluctuations of its grains about it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from ..bodies.cell import Cell
from ..bodies.grains import Array
from ..bodies.strain import MIN_GRAINS, displacement_gradient

FLUCTUATION_EDGES = np.linspace(-6.0, 6.0, 49)  # of the bins of fluctuations over their rms
FLUCTUATION_BINS = len(FLUCTUATION_EDGES) - 1


@dataclass(frozen=True, slots=True)
class MeanField:
    """Displacement field of one interval."""

    gradient: Float[Array, "2 2"]  # ∂u_a/∂x_b by positions before
    fluctuation: Float[Array, "n 2"]  # [m]; NaN where a grain is not seen in both frames


def fit_mean_field(
    before: Float[Array, "n 2"], after: Float[Array, "n 2"], cells: tuple[Cell, Cell] | None = None
) -> MeanField:
    """Fit the affine displacement field and subtract it.

    Parameters
    ----------
    before, after : (n, 2)
        Positions [m] in both frames; NaN: not seen.
    cells : tuple of Cell, optional
        The periodic cell in both frames, whose deformation is the gradient.

    Returns
    -------
    MeanField
        All NaN for fewer than MIN_GRAINS grains.

    Notes
    -----
    u'_i = u_i − (a + G x_i), with a and G by least squares over all grains that are seen in both frames. In a periodic
    cell G = H'ᵀ H⁻ᵀ − 1, H and H' its vectors by rows, and u' is reduced to its nearest image.
    """
    seen = np.asarray(np.isfinite(np.hstack([before, after])).all(axis=1))
    fluctuation = np.full(before.shape, np.nan)
    if seen.sum() < MIN_GRAINS:
        return MeanField(np.full((2, 2), np.nan), fluctuation)
    if cells is None:
        gradient = displacement_gradient(before, after - before, seen)
        left = (after - before)[seen] - before[seen] @ gradient.T
    else:
        old, new = cells
        gradient = np.linalg.solve(old.vectors, new.vectors).T - np.eye(2)
        left = after[seen] - before[seen] @ (np.eye(2) + gradient).T
        left = left + new.shift(left)
    fluctuation[seen] = left - left.mean(axis=0)
    return MeanField(gradient, fluctuation)


def fluctuation_density(component: Array, rms: float) -> Array:
    """Return the probability density of components (m,) over their rms in the bins of FLUCTUATION_EDGES."""
    if len(component) == 0 or not rms > 0.0:
        return np.full(FLUCTUATION_BINS, np.nan)
    counts, _ = np.histogram(component / rms, FLUCTUATION_EDGES)
    return counts / (len(component) * np.diff(FLUCTUATION_EDGES))


def excess_kurtosis(component: NDArray[np.floating]) -> float:
    """Return ⟨u⁴⟩/⟨u²⟩² − 3 of components (m,) of zero mean: 0 for a Gaussian; NaN where all are zero."""
    square = float(np.mean(component**2)) if len(component) else 0.0
    return float(np.mean(component**4)) / square**2 - 3.0 if square > 0.0 else float("nan")
