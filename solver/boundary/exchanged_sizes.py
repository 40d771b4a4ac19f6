"""Grains that are stated to be of another size than they are, as by a wrong row of a table.

A grain that is stated too large lies inside its neighbours in all photographs; one that is stated too small touches
none. The size of each grain is the one with which most of its neighbours touch it and none lies inside it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ..bodies.grains import Array, move_freely

TOUCHING = 0.25  # of the least difference of two sizes: greatest gap or overlap of a touching pair
INSIDE = 3.0  # touching neighbours that outweigh one inside which the grain lies
# Touching neighbours per photograph by which a lesser and a greater size must be better: a loose grain touches none,
# and by chance the hole that it is in may have the size of a greater one.
LESSER, GREATER = 1.5, 2.5
FEWEST = 1.5  # touching neighbours per photograph of a grain that is not loose
ALIKE = 0.5  # difference of two scores that shows no size
USUAL, HARD = 0.98, 0.5  # quantile of the overlaps of other grains, and its limit over that of a touching pair
TIGHT = 0.1  # of a touching pair: median overlap of a grain with its neighbours that is tolerated whatever others have
ROUNDS = 20
KNOWN = 0.6  # fraction of the grains at a wall that touch it, below which the wall is not where it is stated
MOST = 0.3  # fraction of the grains: if more seem exchanged, something else is wrong


@dataclass(frozen=True, slots=True)
class _Pairs:
    """Candidate pairs (m,) of all photographs, those of grains in both orders."""

    grain: NDArray[np.int64]
    other: NDArray[np.int64]  # a grain, or number of grains + a wall, whose radius is zero
    distance: Array  # [m] of the centres, or of the centre from the wall

    def select(self, chosen: NDArray[np.bool_]) -> _Pairs:
        return _Pairs(self.grain[chosen], self.other[chosen], self.distance[chosen])


def find_exchanged_sizes(
    position: Array,
    radius: Array,
    classes: NDArray[np.int64],
    from_walls: Array | None = None,
    boundary: NDArray[np.bool_] | None = None,
) -> Array:
    """Find the radii of grains that are stated to be of another of the stated sizes.

    Parameters
    ----------
    position : (f, n, 2)
        Centres [m], NaN where a grain is missing.
    radius : (n,)
        Stated radii [m].
    classes : (n,)
        Size of each grain, from 0.
    from_walls : (f, n, w), optional
        Distances [m] of the centres from walls, NaN beside them. A wall counts if most grains at it touch it: others
        are not where they are stated to be.
    boundary : (n,), optional
        Grains of the boundary, of which two need not touch; None: none.

    Returns
    -------
    (n,)
        Radii [m]; the stated ones where no other size is clearly better. All stay as stated where more than MOST would
        change, or where the other grains overlap so much that an overlap shows no size. A loose grain in a hole that is
        a little too small for a greater size stays as stated, too: it would overlap its neighbours more than others do.
        So does one that would touch fewer than 1.5 neighbours per photograph, and stand farther from all than it lies
        inside one as stated.

    Notes
    -----
    The score of a size is the number of neighbours with |gap| < t minus 3 Σ min(overlap/t − 1, 1) over those with
    overlap > t, t a quarter of the least difference of two sizes, per photograph. In each round every grain changes to
    its best size if that gains 1.5 (a lesser size) or 2.5 (a greater one), and no less than any of its neighbours.
    """
    sizes = np.array([np.median(radius[classes == c]) for c in range(int(classes.max()) + 1)])
    if len(sizes) < 2:
        return radius
    touch = TOUCHING * float(np.diff(np.sort(sizes)).min())
    reach = float(sizes.max()) + touch
    from_walls = np.empty((*position.shape[:2], 0)) if from_walls is None else from_walls
    pairs = _candidate_pairs(position, from_walls, float(sizes.max()) + reach, reach)
    pairs = pairs.select(move_freely(boundary, pairs.grain, pairs.other))
    pairs, frames = _at_known_walls(pairs, radius, touch), len(position)
    found, of_walls = radius.copy(), np.zeros(from_walls.shape[2])
    for _ in range(ROUNDS):
        others = np.append(found, of_walls)
        own = _score(pairs, found, others, touch) / frames
        trial = np.stack([_score(pairs, np.full_like(found, size), others, touch) / frames for size in sizes])
        # Of sizes that are as good the one nearest to what is stated: a loose grain touches none of its neighbours.
        apart = np.where(trial < trial.max(axis=0) - ALIKE, np.inf, np.abs(sizes[:, None] - radius))
        best = apart.argmin(axis=0)
        gain = trial[best, np.arange(len(found))] - own
        change = gain > np.where(sizes[best] < found, LESSER, GREATER)
        change |= (gain > -ALIKE) & (np.abs(sizes[best] - radius) < np.abs(found - radius) - touch)
        rival = np.zeros(len(found))
        np.maximum.at(rival, pairs.grain, np.append(np.where(change, gain, 0.0), of_walls)[pairs.other])
        change &= gain >= rival
        if not change.any():
            break
        found[change] = sizes[best[change]]
    exchanged = np.abs(found - radius) > touch
    if not exchanged.any():
        return radius
    # A grain whose whole class is stated too large lies inside its neighbours, too: much smaller, it is far from all.
    stands = _score(pairs, found, np.append(found, of_walls), touch) / frames >= FEWEST
    inside = -_least_gap(pairs, radius, np.append(radius, of_walls))
    exchanged &= stands | (_least_gap(pairs, found, np.append(found, of_walls)) < inside)
    pairs = pairs.select(pairs.other < len(radius))
    kept = pairs.select(~(exchanged[pairs.grain] | exchanged[pairs.other]))
    _, overlap = _mean_overlaps(kept, radius, touch)
    usual = float(np.quantile(np.append(overlap, 0.0), USUAL))
    if exchanged.mean() > MOST or not usual < HARD * touch:
        return radius
    of_grain, own = _mean_overlaps(pairs, found, touch)
    for grain in np.flatnonzero(exchanged & (found > radius)).tolist():
        its = own[of_grain == grain]
        if len(its) and np.median(its) > max(usual, TIGHT * touch):
            exchanged[grain] = False
    return np.where(exchanged, found, radius)


def _least_gap(pairs: _Pairs, own: Array, others: Array) -> Array:
    """Least gap (n,) [m] of each grain of radius `own` (n,) among grains and walls of radii `others` (n + w,)."""
    least = np.full(len(own), np.inf)
    np.minimum.at(least, pairs.grain, pairs.distance - own[pairs.grain] - others[pairs.other])
    return least


def _mean_overlaps(pairs: _Pairs, radius: Array, touch: float) -> tuple[NDArray[np.int64], Array]:
    """Grains (p,) and mean overlaps (p,) [m] of pairs that overlap on average over the photographs in which they touch.

    The mean is hardly one of noise, which may be as large as the greatest overlap that shows a size.
    """
    overlap = radius[pairs.grain] + radius[pairs.other] - pairs.distance
    near = overlap > -touch
    _, first, row = np.unique(
        pairs.grain[near] * len(radius) + pairs.other[near], return_index=True, return_inverse=True
    )
    mean = np.bincount(row, weights=overlap[near]) / np.maximum(np.bincount(row), 1)
    return pairs.grain[near][first][mean > 0.0], mean[mean > 0.0]


def _at_known_walls(pairs: _Pairs, radius: Array, touch: float) -> _Pairs:
    """Leave out walls that fewer than KNOWN of the grains touch that are at them with the stated radii (n,)."""
    at_wall = pairs.other >= len(radius)
    gap = np.where(at_wall, pairs.distance - radius[pairs.grain], np.inf)
    here, touching = gap < touch, np.abs(gap) < touch
    count = np.bincount(pairs.other, weights=here)
    known = np.bincount(pairs.other, weights=touching) >= KNOWN * np.maximum(count, 1.0)
    return pairs.select(~at_wall | known[pairs.other])


def _candidate_pairs(position: Array, from_walls: Array, reach: float, at_walls: float) -> _Pairs:
    """List the pairs nearer than `reach`, or `at_walls` [m], in any photograph."""
    grains = position.shape[1]
    first, second, apart = [], [], []
    for place, depth in zip(position, from_walls, strict=True):
        here = np.flatnonzero(np.isfinite(place[:, 0]))
        if not len(here):
            continue
        near = here[KDTree(place[here]).query_pairs(reach, output_type="ndarray")]
        distance = np.linalg.norm(place[near[:, 0]] - place[near[:, 1]], axis=1)
        grain, wall = np.nonzero(depth < at_walls)
        first += [near[:, 0], near[:, 1], grain]
        second += [near[:, 1], near[:, 0], grains + wall]
        apart += [distance, distance, depth[grain, wall]]
    if not apart:
        nothing = np.empty(0, np.int64)
        return _Pairs(nothing, nothing, np.empty(0))
    return _Pairs(np.concatenate(first), np.concatenate(second), np.concatenate(apart))


def _score(pairs: _Pairs, own: Array, others: Array, touch: float) -> Array:
    """Score (n,) of radii `own` (n,) among grains and walls of radii `others` (n + w,) [m], over all photographs."""
    gap = pairs.distance - own[pairs.grain] - others[pairs.other]
    inside = np.clip(-gap / touch - 1.0, 0.0, 1.0)
    value = (np.abs(gap) < touch).astype(np.float64) - INSIDE * inside
    return np.bincount(pairs.grain, weights=value, minlength=len(own)).astype(np.float64)
