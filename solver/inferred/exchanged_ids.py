"""Grains that have exchanged their names from some photograph on, as trackers do that link poses by their distance.

Two grains cannot pass through each other. Where one suddenly stands where another is expected, and that one where it,
or a third, is expected, their names are exchanged and not their places.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ..bodies.grains import Array
from .interpolated_poses import NEIGHBOURS, neighbour_rows

FAR = 0.5  # of the distance to the nearest grain: a grain that is farther from its expected place may have another name
NEAR = 0.25  # of that distance: a grain that stands nearer to the expected place of another may be that other
# Of the least distance of two grains: motions that differ by less cannot bring one half of its distance astray.
QUIET = 0.15


def find_exchanged_ids(position: Float[Array, "f n 2"]) -> Int[np.ndarray, "f n"]:
    """Find under which name each grain stands in each photograph.

    Parameters
    ----------
    position : array (f, n, 2)
        Centres [m] by name; NaN: no pose.

    Returns
    -------
    int array (f, n)
        Row of `position[k]` that holds the grain which row i of the first photographs named; i where nothing is
        exchanged. Every row of it is a permutation.

    Notes
    -----
    A grain is expected where it was last, moved as the median of its neighbours since then. With d the distance from
    there to the nearest other grain, a grain that stands farther than d/2 from where it is expected, or that has no
    pose, is given the pose of such another name within d/4; if it had no pose before, only that of a new name. The
    names that are left over are given to the grains that are left over, if these have no pose: a tracker that loses a
    grain may take the name of its neighbour for it.
    """
    frames, n = position.shape[:2]
    row = np.tile(np.arange(n), (frames, 1))
    if n <= NEIGHBOURS or frames < 2:
        return row
    last, quiet = position[0].copy(), QUIET * _least_distance(position[0])
    for k in range(1, frames):
        row[k] = row[k - 1]
        now = position[k][row[k]]
        if _moves_as_one(last, now, quiet):
            last = now
            continue
        moved = _continued(last, now)
        if moved is None:
            continue
        _restore(row[k], moved, position[k], seen=np.isfinite(position[k - 1, row[k - 1], 0]))
        now = position[k][row[k]]
        last = np.where(np.isfinite(now), now, moved)
    return row


def _least_distance(place: Array) -> float:
    """Least distance [m] between two of the grains at some places (n, 2) [m]; 0 with fewer than two."""
    known = place[np.isfinite(place[:, 0])]
    return float(KDTree(known).query(known, k=2)[0][:, 1].min()) if len(known) > 1 else 0.0


def _moves_as_one(last: Array, now: Array, most: float) -> bool:
    """Whether all grains are seen again, and none moves by `most` [m] otherwise than the median: none is astray."""
    known = np.isfinite(last[:, 0])
    if not known.any():
        return False
    step = now[known] - last[known]
    return bool(np.abs(step - np.median(step, axis=0)).max() < most)  # not where one has no pose now


def _continued(last: Array, now: Array) -> Array | None:
    """Places (n, 2) [m] where grains are expected, moved from their last ones as their neighbours; None: too few."""
    known, placed = np.flatnonzero(np.isfinite(last[:, 0] + now[:, 0])), np.flatnonzero(np.isfinite(last[:, 0]))
    if len(known) <= NEIGHBOURS:
        return None
    expected = last.copy()
    near = neighbour_rows(last, known, placed)
    expected[placed] += np.median(now[near] - last[near], axis=1)
    return expected


def _restore(row: NDArray[np.int64], expected: Array, position: Array, *, seen: NDArray[np.bool_]) -> None:
    """Change the rows (n,) of grains that stand under the names of others; seen (n,): in the photograph before."""
    placed = np.flatnonzero(np.isfinite(expected[:, 0]))
    distance = np.full(len(row), np.inf)
    distance[placed] = KDTree(expected[placed]).query(expected[placed], k=2)[0][:, 1]
    now = position[row]
    apart = np.linalg.norm(now - expected, axis=1)  # NaN without a pose, or before it has a place
    astray = np.flatnonzero(~(apart <= FAR * distance))
    posed = astray[np.isfinite(now[astray, 0])]
    sought = astray[np.isfinite(expected[astray, 0])]
    if not len(posed) or not len(sought):
        return
    length, nearest = KDTree(now[posed]).query(expected[sought])
    taken = posed[nearest]  # of one grain at most: expected places are farther apart
    # Another grain may move to where one is not seen any more: later only a name that is new is the lost one's.
    may_take = seen[sought] | np.isfinite(now[sought, 0]) | ~np.isfinite(expected[taken, 0])
    fits = (length < NEAR * distance[sought]) & (taken != sought) & may_take
    while fits.any():
        one, other = sought[fits], taken[fits]
        # Who takes a name without giving its own away must have had no pose: its own goes to who gives without taking.
        open_ended = np.isin(sought, np.setdiff1d(one, other)) & np.isfinite(now[sought, 0]) & fits
        if not open_ended.any():
            break
        fits &= ~open_ended
    one, other, former = sought[fits], taken[fits], row.copy()
    row[one] = former[other]
    row[np.setdiff1d(other, one)] = former[np.setdiff1d(one, other)]
