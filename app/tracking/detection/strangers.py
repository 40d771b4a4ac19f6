"""Round things that are no grains, and pictures that show the grains better: what to tell of a detection.

Bolts, wheels and holes of an apparatus are circles, too. Those between the walls cannot be told from grains one by
one; those outside the walls, or far from the packing and all of one size, can, and where they are many the settings
that keep them out are worth a sentence.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from solver.bodies.grains import Array

from .detect import Detection

# Fewer circles apart from the packing, or a smaller share of all, may be grains that stand alone.
FEWEST, SHARE = 5, 0.03
# Grains of a packing are no farther from the next one than this, in mean radii.
GAP = 1.0
# Circles whose radii scatter by no more than this share are of one size.
ONE_SIZE = 0.06
MARGIN = 2.0  # mean radii that a region leaves about the packing

# What another channel must show more of, to be named.
MORE_SHARE, MORE = 1.3, 5


def apart_from_packing(detection: Detection) -> NDArray[np.bool_]:
    """Which circles (n,) belong to no part of the largest heap of circles close to one another."""
    n = detection.count
    if n < 2:
        return np.zeros(n, np.bool_)
    centre = np.stack([detection.x, detection.y], axis=1)
    mean = float(detection.radius.mean())
    pairs = KDTree(centre).query_pairs(2.0 * float(detection.radius.max()) + GAP * mean, output_type="ndarray")
    gap = np.linalg.norm(centre[pairs[:, 0]] - centre[pairs[:, 1]], axis=1) - detection.radius[pairs].sum(axis=1)
    close = pairs[gap < GAP * mean]
    graph = coo_array((np.ones(len(close)), (close[:, 0], close[:, 1])), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    return np.asarray(label != np.bincount(label).argmax(), dtype=np.bool_)


def describe_strangers(detection: Detection, within: NDArray[np.bool_] | None, shape: tuple[int, int]) -> list[str]:
    """Sentences about circles that look like the apparatus.

    within (n,): which lie between the walls, None: there are none; shape: rows and columns of the photograph.
    """
    if within is not None:
        outside = ~within
        if outside.sum() < FEWEST or outside.mean() < SHARE:
            return []
        what = f"{int(outside.sum())} of {detection.count} circles lie outside the walls and are left out"
        return [_advise(what, _region_about(detection, within, shape))]
    apart = apart_from_packing(detection)
    radius = detection.radius[apart]
    if (
        apart.sum() < FEWEST
        or apart.mean() < SHARE
        or np.ptp(np.percentile(radius, [10, 90])) > ONE_SIZE * radius.mean()
    ):
        return []
    what = f"{int(apart.sum())} of {detection.count} circles lie apart from the packing and are all of one size"
    return [_advise(what, _region_about(detection, ~apart, shape))]


def describe_channels(count: dict[str, int], used: str) -> list[str]:
    """A sentence where discs stand out in another channel than the one that is used; count: of discs by channel."""
    if not count:
        return []
    best = max(count, key=lambda name: count[name])
    if count[best] < max(MORE_SHARE * count[used], count[used] + MORE):
        return []
    return [
        f"{count[best]} discs stand out in {best}, {count[used]} in {used}: "
        f'photographs.channel = "{best}" looks at them.'
    ]


def _advise(what: str, region: list[int]) -> str:
    return f"{what}: bolts or the frame? photographs.region = {region} keeps them out from the start."


def _region_about(detection: Detection, rows: NDArray[np.bool_], shape: tuple[int, int]) -> list[int]:
    """First column and row, last column and row about some circles."""
    margin = MARGIN * float(detection.radius[rows].mean())
    reach = detection.radius[rows] + margin

    def ends(at: Array, last: int) -> tuple[int, int]:
        return max(int((at - reach).min()), 0), min(int((at + reach).max()) + 1, last)

    left, right = ends(detection.x[rows], shape[1] - 1)
    top, bottom = ends(detection.y[rows], shape[0] - 1)
    return [left, top, right, bottom]
