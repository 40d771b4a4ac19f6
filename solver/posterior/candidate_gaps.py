"""Candidate gaps of a sequence, with a reach large enough to include all touching pairs.

The same positions are evaluated more than once, before a sequence is calibrated and after: the last result is cached.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import blake2b

import numpy as np
from jaxtyping import Float

from ..bodies.grains import Array
from ..bodies.motion import Snapshot
from ..bodies.packing import Packing
from ..contacts.pairs import split_keys
from .gap_series import GapNoise, GapSeries, measure_gap_noise, measure_series, smooth_series
from .touching_gaps import TouchingGaps, fit_touching

OPEN_REACH = 0.01  # mean diameters: open gaps that are included beyond those of touching pairs
MAX_REACH = 0.3  # mean diameters: greatest reach
MAX_CACHED_GAPS = 4_000_000  # results of longer sequences are not cached

_cache: dict[bytes, CandidateGaps] = {}  # the last result only


@dataclass(frozen=True, slots=True)
class CandidateGaps:
    """Gaps of candidate pairs over a sequence, and the mixture of touching and open gaps that fits them."""

    series: GapSeries
    noise: GapNoise
    smooth: Float[Array, "f c"]  # [m] smoothed gaps; NaN where a grain is missing
    variance_fraction: Float[Array, "f c"]  # of the noise's variance, that smoothing leaves
    touching: TouchingGaps
    reach: float  # [m]


def find_candidate_gaps(packing: Packing, snapshots: Sequence[Snapshot], reach: float) -> CandidateGaps:
    """Find the gaps of candidate pairs.

    Parameters
    ----------
    packing : Packing
    snapshots : sequence of Snapshot
        The sequence.
    reach : float
        Initial greatest gap [m]; enlarged until it exceeds a + 4 s + 0.01 mean diameters, with a and s the mean and
        standard deviation of touching gaps, or 0.3 mean diameters.

    Raises
    ------
    ValueError
        If no two bodies are within reach.
    """
    key = _hash_input(packing, snapshots, reach)
    found = _cache.get(key)
    if found is None:
        found = _search(packing, snapshots, reach)
        _cache.clear()
        if found.smooth.size <= MAX_CACHED_GAPS:
            _cache[key] = found
    return found


def forget_candidate_gaps() -> None:
    """Release the cached result, which is three times as long as the tracks."""
    _cache.clear()


def _hash_input(packing: Packing, snapshots: Sequence[Snapshot], reach: float) -> bytes:
    """Hash everything that the gaps follow from."""
    digest, grains = blake2b(digest_size=16), packing.grains
    stated = np.array([reach, *(each.sigma for each in snapshots)])
    for each in (stated, grains.radius, grains.boundary):
        _add(digest, each)
    for each in snapshots:
        for part in (each.position, each.present, each.endpoints, each.side, each.cell):
            _add(digest, part)
    return digest.digest()


def _add(digest: blake2b, part: np.ndarray | None) -> None:
    digest.update(b"-" if part is None else str(part.shape).encode() + np.ascontiguousarray(part).tobytes())


def _search(packing: Packing, snapshots: Sequence[Snapshot], reach: float) -> CandidateGaps:
    diameter, grains = 2.0 * float(packing.grains.radius.mean()), packing.grains.count
    stated = float(np.median([each.sigma for each in snapshots]))
    while True:
        series = measure_series(packing, snapshots, reach)
        noise = measure_gap_noise(series, stated)
        at_limit = reach >= MAX_REACH * diameter
        if len(series.key) < grains and not at_limit:  # fewer than two pairs per grain: all gaps share an error
            reach = min(2.0 * reach, MAX_REACH * diameter)
            continue
        smooth, variance_fraction = smooth_series(series.gap, noise)
        touching = _fit_mixture(packing, snapshots, series, smooth, reach, float(np.sqrt(noise.noise)))
        needed = touching.offset + OPEN_REACH * diameter + 4.0 * touching.sd
        if needed <= reach or at_limit:
            return CandidateGaps(series, noise, smooth, variance_fraction, touching, reach)
        reach = min(max(needed, 1.2 * reach), MAX_REACH * diameter)


def _fit_mixture(
    packing: Packing, snapshots: Sequence[Snapshot], series: GapSeries, smooth: Array, reach: float, narrow_sd: float
) -> TouchingGaps:
    """Fit pairs of grains, or pairs with walls where there are no others."""
    with np.errstate(invalid="ignore"):
        gap = np.where(smooth < reach, smooth, np.nan)
    fitted = ~series.with_wall if (~series.with_wall).any() else np.ones(len(series.key), np.bool_)
    return fit_touching(gap[:, fitted], pair_covariates(packing, snapshots, series)[fitted], reach, narrow_sd)


def pair_covariates(packing: Packing, snapshots: Sequence[Snapshot], series: GapSeries) -> Array:
    """Compute the covariates (c, 6) of an error that all gaps share: s, x, y, x², x y, y², each less its mean.

    s is the sum of the pair's radii less two mean radii, over the mean radius; x and y are the pair's position from
    the middle of the packing, over the packing's half width.
    """
    radius, n = packing.grains.radius, packing.grains.count
    i, j = split_keys(series.key, series.body_count)
    position = _mean_position(snapshots)
    size = radius[i] + np.where(j < n, radius[np.minimum(j, n - 1)], radius.mean()) - 2.0 * radius.mean()
    place = np.where((j < n)[:, None], 0.5 * (position[i] + position[np.minimum(j, n - 1)]), position[i])
    place = place - place.mean(axis=0)
    x, y = (place / max(float(np.abs(place).max()), 1e-30)).T
    covariate = np.column_stack([size / radius.mean(), x, y, x * x, x * y, y * y])
    return covariate - covariate.mean(axis=0)


def _mean_position(snapshots: Sequence[Snapshot]) -> Array:
    """Compute the mean position (n, 2) [m] of every grain over its frames; the origin without any."""
    here = np.stack([each.present for each in snapshots])
    position = np.where(here[:, :, None], np.stack([each.position for each in snapshots]), 0.0)
    return position.sum(axis=0) / np.maximum(here.sum(axis=0), 1)[:, None]
