"""Gaps of candidate pairs over a sequence: their noise, their random walk, and their smoothing over frames.

The changes of a gap over l frames separate its noise from its walk: noise adds the same variance to every difference,
a random walk adds one in proportion to l. A low quantile of the changes gives the noise, because most pairs keep
touching; a high quantile gives the walk, because large changes must not be smoothed away.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.special import ndtri

from ..bodies.grains import Array
from ..bodies.motion import Snapshot
from ..bodies.packing import Packing
from ..contacts.contacts import detect_contacts, measure_pairs
from ..contacts.pairs import Keys, are_present, join_keys, split_keys

NOISE_QUANTILE = 0.3  # of the absolute changes
MAX_LAG = 7  # frames
WALK_QUANTILE = 0.9  # of the absolute changes
MIN_DIFFERENCES = 100  # a lag with fewer is not used
MAX_SMOOTHING = 3.0  # greatest ρ: more smoothing is worse where contacts form and break
DENSE = 256  # frames of a sequence, from which on no matrix of all pairs of frames is made
RIDGE = 1e-12  # of the smoothing, where no frame is known
MIN_VARIANCE_FRACTION = 0.1  # lower limit of a measured variance, over the stated one


@dataclass(frozen=True, slots=True)
class GapSeries:
    """Measured gaps of every pair that is within reach in some frame; NaN where a grain is absent."""

    key: Keys  # (c,) ascending
    gap: Float[Array, "f c"]  # [m]
    grain_count: int
    body_count: int

    @property
    def with_wall(self) -> np.ndarray:
        return split_keys(self.key, self.body_count)[1] >= self.grain_count


@dataclass(frozen=True, slots=True)
class GapNoise:
    """Noise and random walk of a gap between two grains."""

    noise: float  # v [m²], variance of a measured gap in one photograph
    walk: float  # q [m²] per frame, variance of the true change, from the larger changes

    @property
    def sigma(self) -> float:
        """Standard deviation of a position component [m] from photograph to photograph."""
        return float(np.sqrt(0.5 * self.noise))

    @property
    def smoothing(self) -> float:
        """ρ = min(v/q, 3), the weight of a change between frames against that of a measured gap."""
        return MAX_SMOOTHING if self.walk * MAX_SMOOTHING <= self.noise else self.noise / self.walk


def measure_series(packing: Packing, snapshots: Sequence[Snapshot], reach: float) -> GapSeries:
    """Measure, in every frame, the pairs whose gap is below `reach` [m] in at least one frame."""
    grains = packing.grains
    walls = [packing.walls_of(each) for each in snapshots]
    near = [
        detect_contacts(grains, each.position, each.present, wall, reach)
        for each, wall in zip(snapshots, walls, strict=True)
    ]
    bodies = grains.count + (walls[0].count if walls else 0)
    key = join_keys(*(each.key for each in near))
    gap = np.full((len(snapshots), len(key)), np.nan)
    for k, (each, wall) in enumerate(zip(snapshots, walls, strict=True)):
        here = are_present(key, each.present, bodies)
        gap[k, here] = measure_pairs(grains, each.position, wall, key[here]).gap
    return GapSeries(key, gap, grains.count, bodies)


def measure_gap_noise(series: GapSeries, stated: float) -> GapNoise:
    """Measure noise and walk of the gaps between grains.

    Parameters
    ----------
    series : GapSeries
        Gaps of a sequence.
    stated : float
        Standard deviation of a position component [m], which is used where fewer than two lags have enough changes.

    Notes
    -----
    The variance of the change over l frames is D_l = (Q_p(|Δ_l g|) / Φ⁻¹((1 + p)/2))², with Q_p the quantile p = 0.3.
    Non-negative least squares of relative errors on

        D_l = 2 v + q' l,  l = 1 … 7,

    gives the noise v, at least 0.2 stated². The walk is q = max(D_1(p = 0.9) − 2 v, 0).
    """
    gap = series.gap[:, ~series.with_wall]
    lag, variance, walk_variance = [], [], 0.0
    for l in range(1, min(MAX_LAG, len(gap) - 1) + 1):
        change = np.abs(gap[l:] - gap[:-l])
        change = change[np.isfinite(change)]
        if len(change) >= MIN_DIFFERENCES:
            spread = _variance_by_quantile(change, NOISE_QUANTILE)
            if spread > 0.0:  # the noise is unknown where frames are copies
                lag.append(float(l))
                variance.append(spread)
            if l == 1:
                walk_variance = _variance_by_quantile(change, WALK_QUANTILE)
    if len(lag) < 2:
        return GapNoise(2.0 * stated**2, max(walk_variance - 4.0 * stated**2, 0.0))
    from scipy.optimize import nnls  # imported here: it is a tenth of all import time

    # Relative errors weigh the same at every lag.
    design = np.column_stack([np.full(len(lag), 2.0), lag]) / np.array(variance)[:, None]
    noise = max(float(nnls(design, np.ones(len(lag)))[0][0]), 2.0 * MIN_VARIANCE_FRACTION * stated**2)
    return GapNoise(noise, max(walk_variance - 2.0 * noise, 0.0))


def _variance_by_quantile(change: Array, fraction: float) -> float:
    """Estimate the variance of normal changes from the quantile `fraction` of their absolute values."""
    return float(np.quantile(change, fraction) / ndtri(0.5 + 0.5 * fraction)) ** 2


def smooth_series(gap: Array, noise: GapNoise) -> tuple[Array, Array]:
    """Smooth gaps over frames.

    Parameters
    ----------
    gap : array (f, c)
        Gaps [m], NaN where unknown.
    noise : GapNoise
        Noise and walk, which set the smoothing ρ.

    Returns
    -------
    smooth : array (f, c)
        Smoothed gaps [m], NaN where `gap` is.
    variance_fraction : array (f, c)
        Fraction of the noise's variance that remains.

    Notes
    -----
    smooth = (S + ρ DᵀD)⁻¹ S gap, the posterior mean of a random walk: D takes differences of successive frames, S is
    diagonal with 1 where the gap is known and 0 elsewhere. The fraction is the diagonal of (S + ρ DᵀD)⁻¹.
    """
    frames = len(gap)
    long = frames > DENSE
    step = np.empty((0, 0)) if long else np.diff(np.eye(frames), axis=0)
    stiffness = noise.smoothing * step.T @ step
    smooth, variance_fraction = np.full_like(gap, np.nan), np.full_like(gap, np.nan)
    patterns, pattern_of = np.unique(np.isfinite(gap), axis=1, return_inverse=True)
    for p, seen in enumerate(patterns.T):
        if not seen.any():
            continue
        columns = np.flatnonzero(pattern_of.ravel() == p)
        rows = np.ix_(seen, columns)
        if long:
            found, remaining = _smooth_long(gap[:, columns], seen, noise.smoothing)
            smooth[rows], variance_fraction[rows] = found[seen], remaining[seen, None]
            continue
        inverse = np.linalg.inv(np.diag(seen.astype(np.float64)) + stiffness + RIDGE * np.eye(frames))
        smooth[rows] = inverse[np.ix_(seen, seen)] @ gap[rows]
        variance_fraction[rows] = np.diag(inverse)[seen][:, None]
    return smooth, variance_fraction


def _smooth_long(gap: Array, seen: np.ndarray, smoothing: float) -> tuple[Array, Array]:
    """Smooth gaps (f, c) that are known in the same frames (f,), in a memory and a time in proportion to f.

    Returns
    -------
    smooth : array (f, c)
    variance_fraction : array (f,)

    Notes
    -----
    The matrix A of `smooth_series` has three diagonals. With a its middle one and −ρ beside it, the pivots from both
    ends, l_k = a_k − ρ²/l_{k−1} and u_k = a_k − ρ²/u_{k+1}, give the diagonal of the inverse: 1/(l_k + u_k − a_k).
    """
    from scipy.linalg import solveh_banded  # imported here, as above

    middle = seen + RIDGE + smoothing * np.concatenate([[1.0], np.full(len(gap) - 2, 2.0), [1.0]])
    banded = np.stack([np.full(len(gap), -smoothing), middle])
    smooth = solveh_banded(banded, np.where(seen[:, None], gap, 0.0))
    return smooth, 1.0 / (_pivots(middle, smoothing) + _pivots(middle[::-1], smoothing)[::-1] - middle)


def _pivots(middle: Array, smoothing: float) -> Array:
    pivots = middle.tolist()
    for k in range(1, len(pivots)):
        pivots[k] -= smoothing**2 / pivots[k - 1]
    return np.array(pivots)
