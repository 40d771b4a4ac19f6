"""Places of grains that one photograph lacks, from the gaps to their neighbours before and after.

A grain that touches a neighbour in the photographs before and after touches it in between, although the packing moves
by much more than the noise of a position. The gaps of pairs are therefore interpolated, and the grain stands where
its gaps are nearest to these. Errors of radii cancel where a pair keeps its gap.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ..bodies.grains import Array, Grains
from ..bodies.walls import Walls
from ..contacts.contacts import Contacts, detect_contacts, measure_pairs
from ..robust_scale import SD_OVER_MAD

NEIGHBOURS = 8  # whose median motion a grain follows
REACH = 0.1  # of a mean radius: greatest gap of a pair that determines a place
CURVATURE = 0.3  # of a gap: by so much it departs from its interpolation, standard deviation
ROUNDS = 6  # of Gauss-Newton steps


@dataclass(frozen=True, slots=True)
class InterpolatedPoses:
    """Grains (m,) that photograph `frame` lacks, interpolated in time."""

    frame: int
    row: Int[np.ndarray, " m"]  # of the grains
    before: Int[np.ndarray, " m"]  # photograph that shows it last before
    after: Int[np.ndarray, " m"]  # and first after
    fraction: Float[Array, " m"]  # of the time from the one to the other
    place: Float[Array, "m 2"]  # [m] interpolated
    sd: Float[Array, " m"]  # [m] standard deviation of a component of it


def neighbour_rows(position: Array, among: NDArray[np.int64], of: NDArray[np.int64]) -> NDArray[np.int64]:
    """Rows of the nearest of `among` for each of `of` (m, NEIGHBOURS), itself left out; position (n, 2) [m]."""
    finite = among[np.isfinite(position[among, 0])]
    _, near = KDTree(position[finite]).query(position[of], k=NEIGHBOURS + 1)
    rows = finite[near]
    own = rows == of[:, None]
    own[~own.any(axis=1), -1] = True  # it is not among them: the farthest is left out
    return rows[~own].reshape(len(of), NEIGHBOURS)


def interpolate_poses(time: Array, position: Array, k: int, row: NDArray[np.intp]) -> InterpolatedPoses:
    """Interpolate grains in time, corrected by the deviation of their neighbours from such lines.

    Parameters
    ----------
    time : array (f,)
        Of the photographs [s].
    position : array (f, n, 2)
        Measured centres [m]; NaN: not measured.
    k : int
        Photograph that lacks the grains.
    row : array (m,)
        Rows of the grains, each of which another photograph shows.

    Returns
    -------
    InterpolatedPoses
        In the first and last photograph grains follow their neighbours from the photograph beside it.
    """
    before, after = _ends(position, k, row)
    fraction = _fraction(time, k, before, after)
    place, sd = np.empty((len(row), 2)), np.empty(len(row))
    for ends in np.unique(np.column_stack([before, after]), axis=0):
        these = np.flatnonzero((before == ends[0]) & (after == ends[1]))
        t = fraction[these[0]]
        line = (1.0 - t) * position[ends[0]] + t * position[ends[1]]
        known = np.flatnonzero(np.isfinite(line[:, 0] + position[k, :, 0]))
        near = neighbour_rows(line, known, row[these])
        deviation = position[k][near] - line[near]
        middle = np.median(deviation, axis=1)
        place[these] = line[row[these]] + middle
        sd[these] = SD_OVER_MAD * np.median(np.abs(deviation - middle[:, None]), axis=1).mean(axis=1)
    return InterpolatedPoses(k, row, before, after, fraction, place, sd)


def _ends(position: Array, k: int, rows: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The photographs before and after k that show each grain, twice the same at an end."""
    before, after = np.empty_like(rows), np.empty_like(rows)
    for m, row in enumerate(rows):
        seen = np.flatnonzero(np.isfinite(position[:, row, 0]))
        earlier, later = seen[seen < k], seen[seen > k]
        before[m] = earlier[-1] if len(earlier) else later[0]
        after[m] = later[0] if len(later) else before[m]
    return before, after


def _fraction(time: Array, k: int, before: NDArray[np.intp], after: NDArray[np.intp]) -> Array:
    """Of the time from `before` to `after` (m,); 0 where they are the same."""
    span = time[after] - time[before]
    return np.divide(time[k] - time[before], span, out=np.zeros(len(span)), where=span > 0.0)


def settle_poses(
    poses: InterpolatedPoses, grains: Grains, position: Array, sigma: float, walls_at: Callable[[int], Walls]
) -> Array:
    """Move interpolated grains to where their gaps are nearest to the interpolated gaps.

    Parameters
    ----------
    poses : InterpolatedPoses
    grains : Grains
    position : array (f, n, 2)
        Measured centres [m]; NaN: not measured.
    sigma : float
        Standard deviation of a position component [m].
    walls_at : callable
        Walls of a photograph.

    Returns
    -------
    array (m, 2)
        Centres [m].

    Notes
    -----
    Minimises |x − x₀|²/s₀² + Σ (g(x) − ĝ)²/s² with ĝ = (1 − t) g_before + t g_after and
    s² = 4 σ² + (0.3 max(|g_before|, |g_after|))².
    """
    here, n = position[poses.frame].copy(), grains.count
    here[poses.row] = poses.place
    known = np.isfinite(here[:, 0])
    walls = walls_at(poses.frame)
    near = detect_contacts(grains, here, known, walls, REACH * float(grains.radius.mean()))
    number = np.full(n + walls.count, -1)
    number[poses.row] = np.arange(len(poses.row))
    ends = [(rows, number[body[rows]]) for body in (near.i, near.j) for rows in [np.flatnonzero(number[body] >= 0)]]
    pair = np.concatenate([rows for rows, _ in ends])
    who = np.concatenate([whose for _, whose in ends])
    sign = np.repeat([-1.0, 1.0], [len(rows) for rows, _ in ends])  # a step along the normal from i to j
    earlier, later = (
        _gaps_in(each[who], near.select, pair, grains, position, walls_at) for each in (poses.before, poses.after)
    )
    fraction = poses.fraction[who]
    target = (1.0 - fraction) * earlier + fraction * later
    use = np.isfinite(target)
    pair, who, sign, target = pair[use], who[use], sign[use], target[use]
    spread = CURVATURE * np.maximum(np.abs(earlier[use]), np.abs(later[use]))
    weight = 1.0 / (4.0 * sigma**2 + spread**2)
    share = 1.0 / np.bincount(pair, minlength=near.count)[pair]  # both ends of a pair may move
    key, own = near.key, 1.0 / np.maximum(poses.sd, sigma) ** 2
    for _ in range(ROUNDS):
        now = measure_pairs(grains, here, walls, key)
        along = sign[:, None] * now.normal[pair]
        pull = weight * share * (target - now.gap[pair])
        left = own[:, None] * (poses.place - here[poses.row])
        np.add.at(left, who, pull[:, None] * along)
        matrix = own[:, None, None] * np.eye(2)
        np.add.at(matrix, who, weight[:, None, None] * along[:, :, None] * along[:, None, :])
        here[poses.row] += np.linalg.solve(matrix, left[..., None])[..., 0]
    return here[poses.row]


def _gaps_in(
    frame: NDArray[np.int64],
    select: Callable[[NDArray[np.intp]], Contacts],
    pair: NDArray[np.intp],
    grains: Grains,
    position: Array,
    walls_at: Callable[[int], Walls],
) -> Array:
    """Gaps (p,) [m] of pairs, each in a photograph of its own; NaN where a grain is not measured there."""
    gap = np.full(len(pair), np.nan)
    for k in np.unique(frame):
        rows = np.flatnonzero(frame == k)
        keys = select(pair[rows]).key
        some, back = np.unique(keys, return_inverse=True)
        gap[rows] = measure_pairs(grains, position[k], walls_at(int(k)), some).gap[back]
    return gap
