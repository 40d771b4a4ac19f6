"""Which candidate circles are grains: those with edges along their outlines that overlap no better circle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ...solver.bodies.grains import Array
from .circles.circle_measurement import CircleMeasurer
from .discs import OVERLAP, Discs, find_discs
from .rings import SCAN_STEP, Circles, not_overlapping, without_overlap

# Least half width of the search for the edges of a ring [px], whose centre has an error of that size or larger.
RING_UNCERTAINTY = 3.0
SMALL_FRACTION = 0.2  # greatest error of a small circle's centre, as a fraction of its radius
TOUCHING = 0.15  # greatest overlap of touching grains, as a fraction of the smaller radius
# Factor of the least quality where grains are plain: nothing but their rims has edges.
CLEAN_QUALITY = 0.6
# Least covered fraction of the bright area that found grains leave, a part of which is always without shape.
CLEAN_COVER_REST = 0.8
DISC_PASSES = 4
# Fraction of the bright area left, below which all grains are found.
MAX_BRIGHT_LEFT = 0.01


def judge_discs(
    measurer: CircleMeasurer, table: Array, smallest: float, min_quality: float, first: Discs | None = None
) -> tuple[Array, bool]:
    """Add the discs that are grains to the table x, y, radius, quality (c, 4), in passes over the bright area left.

    Discs that leave much of the bright area uncovered are no grains. first: the discs of the first pass, where they are
    known. Returns also whether hardly any bright area remains.
    """
    level = measurer.level
    whole, left = 0.0, np.inf
    for k in range(DISC_PASSES + 1):
        discs = first if k == 0 and first is not None else find_discs(level, table, smallest)
        whole, left = max(whole, discs.area), discs.area
        if k == DISC_PASSES or len(discs.candidates.x) == 0 or discs.covered < CLEAN_COVER_REST:
            break
        count = len(table)
        table = judge_circles(measurer, discs.candidates, table, False, min_quality, OVERLAP)
        if len(table) <= count:
            break
    return table, left < MAX_BRIGHT_LEFT * whole


def judge_circles(
    measurer: CircleMeasurer, rough: Circles, table: Array, known: bool, min_quality: float, overlap: float = TOUCHING
) -> Array:
    """Add the candidates that are grains and overlap no better one to the table x, y, radius, quality (c, 4).

    overlap: greatest overlap, as a fraction of the smaller radius.
    """
    unjudged = np.ones(len(rough.x), dtype=np.bool_)
    judged_circles = np.full((len(rough.x), 4), np.nan)  # x, y, radius, quality of those that were measured
    places = np.stack([rough.x, rough.y, rough.radius], axis=1)
    overlapped = np.full_like(places, np.nan)  # x, y, radius of the circle in the table that overlapped each one last
    tree = KDTree(places[:, :2]) if known and len(rough.x) else None
    while True:
        left = np.flatnonzero(unjudged)
        circles, beside = places[left], overlapped[left]
        apart = not_overlapping(circles, table, beside, allowed=0.6)
        overlapped[left] = beside
        left = left[apart]
        if len(left) == 0:
            return table
        # A candidate may remove a true circle and then prove no grain itself, or be removed later by a better circle.
        # Another pass then tests the removed ones.
        chosen = left[without_overlap(rough.x[left], rough.y[left], rough.radius[left], allowed=0.6)]
        unjudged[chosen] = False
        if tree is not None:  # the candidates of the other known radii at that place are compared
            chosen = np.concatenate([_best_of_every_radius(rough, tree, k) for k in chosen])
        new = np.unique(chosen[np.isnan(judged_circles[chosen, 0])])
        judged_circles[new] = _measure(measurer, rough, new, known, min_quality)
        judged = judged_circles[chosen]
        table = np.concatenate([table, judged[judged[:, 3] > min_quality]])
        # A longer outline is more significant at the same quality.
        table = table[np.argsort(-table[:, 3] * np.sqrt(table[:, 2]), kind="stable")]
        table = table[without_overlap(table[:, 0], table[:, 1], table[:, 2], allowed=overlap)]


def _measure(
    measurer: CircleMeasurer, rough: Circles, rows: NDArray[np.intp], known: bool, min_quality: float
) -> Array:
    """Measure x, y, radius, quality (c, 4) of some of the rough circles."""
    size = rough.radius[rows]
    window = np.maximum([search_window(each, known) for each in size], rough.error[rows])
    radius_sd = 0.3 if known else np.inf
    found = measurer.measure(rough_circles(rough.x[rows], rough.y[rows], size, window, radius_sd))
    if not known:
        return found[:, [0, 1, 2, 4]]
    quality = 2.0 * found[:, 4]
    # Around the fitted circle, a narrower window excludes paint near the rim. Alone it would accept too many circles.
    again = np.flatnonzero(quality > min_quality)
    window = np.full(len(again), 0.5 * RING_UNCERTAINTY)
    found[again] = measurer.measure(rough_circles(found[again, 0], found[again, 1], size[again], window, radius_sd))
    quality[again] = np.minimum(found[again, 4], quality[again])
    return np.column_stack([found[:, :2], size, quality])


def rough_circles(x: Array, y: Array, radius: Array, window: Array, radius_sd: float) -> Array:
    """Rough circles (c, 6) for `CircleMeasurer.measure`, without a shift of their edges."""
    return np.column_stack([x, y, radius, window, np.zeros(len(x)), np.full(len(x), radius_sd)])


def _best_of_every_radius(rough: Circles, tree: KDTree, k: int) -> NDArray[np.intp]:
    """The candidate with the highest score of every radius around candidate k."""
    widest = float(rough.radius.max() - rough.radius.min())
    error = max(RING_UNCERTAINTY, float(rough.error[k]))  # besides the difference of two classes' radii
    near = np.sort(np.asarray(tree.query_ball_point([rough.x[k], rough.y[k]], widest + error)))
    distance = np.hypot(rough.x[near] - rough.x[k], rough.y[near] - rough.y[k])
    near = near[distance <= np.abs(rough.radius[near] - rough.radius[k]) + error]
    # Candidates are in the order of their score: the first of every radius is its best.
    _, first = np.unique(rough.radius[near], return_index=True)
    return near[np.sort(first)]


def search_window(radius: float, known: bool) -> float:
    """Half width of the search for edges around a rough circle [px]: narrower for small grains, beside neighbours."""
    window = min(RING_UNCERTAINTY, max(SMALL_FRACTION * radius, 0.5 * RING_UNCERTAINTY))
    return window if known else max(window, 0.6 * (SCAN_STEP - 1.0) * radius)
