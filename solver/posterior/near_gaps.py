"""Gaps of a sequence looked at far enough that those of touching pairs are all among them.

The same positions are asked more than once, before a sequence is calibrated and after: what was found last is kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import blake2b

import numpy as np
from jaxtyping import Float

from solver.bodies.grains import Array
from solver.bodies.motion import Snapshot
from solver.bodies.packing import Packing
from solver.contacts.pairs import split_keys
from solver.posterior.gap_series import GapNoise, GapSeries, measure_noise, measure_series, smooth_series
from solver.posterior.touching import TouchingGaps, fit_touching

NEAR = 0.01  # [mean diameter] of gaps of pairs that do not touch but may soon
FARTHEST = 0.3  # mean diameters: pairs beyond it are no near pairs
MOST_KEPT = 4_000_000  # gaps: what is found of longer sequences is not kept for who asks again

_last: dict[bytes, NearGaps] = {}  # one at most


@dataclass(frozen=True, slots=True)
class NearGaps:
    """Gaps of near pairs over a sequence, and the mixture of touching and open ones that fits them."""

    series: GapSeries
    noise: GapNoise
    smooth: Float[Array, "f c"]  # [m] the gaps freed of noise; NaN where a grain is missing
    left: Float[Array, "f c"]  # share of the noise's variance that is left
    touching: TouchingGaps
    reach: float  # [m]


def find_near_gaps(packing: Packing, snapshots: Sequence[Snapshot], reach: float) -> NearGaps:
    """Find the gaps of touching pairs, looking farther than `reach` [m] where they lie there.

    Errors: ValueError if no two bodies are near.
    """
    name = _name(packing, snapshots, reach)
    found = _last.get(name)
    if found is None:
        found = _search(packing, snapshots, reach)
        _last.clear()
        if found.smooth.size <= MOST_KEPT:
            _last[name] = found
    return found


def _name(packing: Packing, snapshots: Sequence[Snapshot], reach: float) -> bytes:
    """A number that names all that the gaps follow from."""
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


def _search(packing: Packing, snapshots: Sequence[Snapshot], reach: float) -> NearGaps:
    diameter, grains = 2.0 * float(packing.grains.radius.mean()), packing.grains.count
    stated = float(np.median([each.sigma for each in snapshots]))
    while True:
        series = measure_series(packing, snapshots, reach)
        noise = measure_noise(series, stated)
        farthest = reach >= FARTHEST * diameter
        if len(series.key) < grains and not farthest:  # fewer than two a grain: something shifts all gaps
            reach = min(2.0 * reach, FARTHEST * diameter)
            continue
        smooth, left = smooth_series(series.gap, noise)
        touching = _fit_mixture(packing, snapshots, series, smooth, reach, float(np.sqrt(noise.noise)))
        needed = touching.offset + NEAR * diameter + 4.0 * touching.deviation
        if needed <= reach or farthest:
            return NearGaps(series, noise, smooth, left, touching, reach)
        reach = min(max(needed, 1.2 * reach), FARTHEST * diameter)


def _fit_mixture(
    packing: Packing, snapshots: Sequence[Snapshot], series: GapSeries, smooth: Array, reach: float, narrow: float
) -> TouchingGaps:
    """Fit pairs of grains where there are any: walls are known otherwise."""
    with np.errstate(invalid="ignore"):
        gap = np.where(smooth < reach, smooth, np.nan)
    some = ~series.with_wall if (~series.with_wall).any() else np.ones(len(series.key), np.bool_)
    return fit_touching(gap[:, some], traits_of(packing, snapshots, series)[some], reach, narrow)


def traits_of(packing: Packing, snapshots: Sequence[Snapshot], series: GapSeries) -> Array:
    """What an error that the gaps share may depend on (c, 6): size of the pair, its place, squares of that.

    Size in mean radii beyond the mean of two; place from the middle of the packing, over its half width.
    """
    radius, n = packing.grains.radius, packing.grains.count
    i, j = split_keys(series.key, series.body_count)
    position = _mean_position(snapshots)
    size = radius[i] + np.where(j < n, radius[np.minimum(j, n - 1)], radius.mean()) - 2.0 * radius.mean()
    place = np.where((j < n)[:, None], 0.5 * (position[i] + position[np.minimum(j, n - 1)]), position[i])
    place = place - place.mean(axis=0)
    x, y = (place / max(float(np.abs(place).max()), 1e-30)).T
    trait = np.column_stack([size / radius.mean(), x, y, x * x, x * y, y * y])
    return trait - trait.mean(axis=0)


def _mean_position(snapshots: Sequence[Snapshot]) -> Array:
    """Mean place of every grain over the frames that show it (n, 2) [m]; the origin if none does."""
    here = np.stack([each.present for each in snapshots])
    position = np.where(here[:, :, None], np.stack([each.position for each in snapshots]), 0.0)
    return position.sum(axis=0) / np.maximum(here.sum(axis=0), 1)[:, None]
