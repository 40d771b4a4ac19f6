"""Gaps of near pairs over a sequence: their noise from photograph to photograph, and what is left when it is smoothed.

Noise of a gap and its walk are told apart by how its changes grow with time: noise adds the same to every difference,
a walk in proportion to the frames between. The quieter changes tell the noise, for most pairs touch and stay as they
are; the livelier ones tell how far a gap walks, for they must not be smoothed away.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.special import ndtri

from solver.bodies.grains import Array
from solver.bodies.motion import Snapshot
from solver.bodies.packing import Packing
from solver.contacts.contacts import detect_contacts, measure_pairs
from solver.contacts.pairs import Keys, are_there, join_keys, split_keys

QUIET = 0.3  # quantile of the changes that tells the noise
LAGS = 7  # frames
LIVELY = 0.9  # quantile of the changes that tells how far gaps walk
FEWEST = 100  # differences below which a lag says nothing
STIFFEST = 3.0  # most that gaps are smoothed: more hurts where contacts come and go
DOUBTFUL = 0.1  # least share of the stated variance that is believed of a measurement


@dataclass(frozen=True, slots=True)
class GapSeries:
    """Measured gaps of every pair that is near in some frame. Rows of absent grains are NaN."""

    key: Keys  # (c,) ascending
    gap: Float[Array, "f c"]  # [m]
    grain_count: int
    body_count: int

    @property
    def with_wall(self) -> np.ndarray:
        return split_keys(self.key, self.body_count)[1] >= self.grain_count


@dataclass(frozen=True, slots=True)
class GapNoise:
    """How a gap between two grains changes from frame to frame."""

    noise: float  # v [m²], variance of a measured gap in one photograph
    walk: float  # q [m²] per frame, variance of the true change of the livelier ones

    @property
    def sigma(self) -> float:
        """Standard deviation of a position component [m] from photograph to photograph."""
        return float(np.sqrt(0.5 * self.noise))

    @property
    def smoothing(self) -> float:
        """ρ, the weight of a step between frames against a measured gap."""
        return STIFFEST if self.walk * STIFFEST <= self.noise else self.noise / self.walk


def measure_series(packing: Packing, snapshots: Sequence[Snapshot], reach: float) -> GapSeries:
    """Measure, in every frame, the pairs whose gap is below `reach` [m] in some frame."""
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
        here = are_there(key, each.present, bodies)
        gap[k, here] = measure_pairs(grains, each.position, wall, key[here]).gap
    return GapSeries(key, gap, grains.count, bodies)


def measure_noise(series: GapSeries, stated: float) -> GapNoise:
    """Measure noise and walk of the gaps between grains.

    stated [m]: standard deviation of a position component, which stands where too few photographs tell.
    """
    gap = series.gap[:, ~series.with_wall]
    lag, spread, lively = [], [], 0.0
    for l in range(1, min(LAGS, len(gap) - 1) + 1):
        change = np.abs(gap[l:] - gap[:-l])
        change = change[np.isfinite(change)]
        if len(change) >= FEWEST:
            lag.append(float(l))
            spread.append(_variance_by_quantile(change, QUIET))
            if l == 1:
                lively = _variance_by_quantile(change, LIVELY)
    if len(lag) < 2:
        return GapNoise(2.0 * stated**2, max(lively - 4.0 * stated**2, 0.0))
    from scipy.optimize import nnls  # a tenth of all that is imported, and not for every start

    # Relative errors weigh the same at every lag.
    design = np.column_stack([np.full(len(lag), 2.0), lag]) / np.array(spread)[:, None]
    noise = max(float(nnls(design, np.ones(len(lag)))[0][0]), 2.0 * DOUBTFUL * stated**2)
    return GapNoise(noise, max(lively - 2.0 * noise, 0.0))


def _variance_by_quantile(change: Array, share: float) -> float:
    """Variance of a normal law of which `share` of the changes, without sign, are as small as these are."""
    return float(np.quantile(change, share) / ndtri(0.5 + 0.5 * share)) ** 2


def smooth_series(gap: Array, noise: GapNoise) -> tuple[Array, Array]:
    """Smooth gaps (f, c) [m] over frames by (1 + ρ DᵀD)⁻¹; NaN where unknown, and left so.

    Also gives the share (f, c) of the noise's variance that is left, the diagonal of that matrix.
    """
    frames = len(gap)
    step = np.diff(np.eye(frames), axis=0)
    stiffness = noise.smoothing * step.T @ step
    smooth, left = np.full_like(gap, np.nan), np.full_like(gap, np.nan)
    patterns, member = np.unique(np.isfinite(gap), axis=1, return_inverse=True)
    for p, seen in enumerate(patterns.T):
        if not seen.any():
            continue
        columns = np.flatnonzero(member.ravel() == p)
        inverse = np.linalg.inv(np.diag(seen.astype(np.float64)) + stiffness + 1e-12 * np.eye(frames))
        rows = np.ix_(seen, columns)
        smooth[rows] = inverse[np.ix_(seen, seen)] @ gap[rows]
        left[rows] = np.diag(inverse)[seen][:, None]
    return smooth, left
