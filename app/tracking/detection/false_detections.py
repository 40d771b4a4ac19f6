"""Messages about detections: circles that are no grains, and channels with more discs.

Bolts, wheels and holes of an apparatus are circles as well. Between the walls they cannot be distinguished from grains
one by one. Outside the walls, or far from the packing and all of one size, they can; where they are many, a message
names the setting that excludes them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from ...solver.bodies.grains import Array
from .detect import Detection

# Least number and fraction of circles apart from the packing; fewer may be isolated grains.
MIN_COUNT, MIN_FRACTION = 5, 0.03
# Greatest gap between neighbouring grains of a packing, in mean radii.
MAX_GAP = 1.0
# Greatest relative range (10th to 90th percentile) of the radii of circles of one size.
MAX_SPREAD = 0.06
MARGIN = 2.0  # margin of a region around the packing, in mean radii

# Least ratio and difference of the number of discs for which another channel is named.
MIN_GAIN_RATIO, MIN_GAIN = 1.3, 5


def separate_circles(detection: Detection) -> NDArray[np.bool_]:
    """Return which circles (n,) do not belong to the largest cluster of neighbouring circles."""
    n = detection.count
    if n < 2:
        return np.zeros(n, np.bool_)
    centre = np.stack([detection.x, detection.y], axis=1)
    mean = float(detection.radius.mean())
    pairs = KDTree(centre).query_pairs(2.0 * float(detection.radius.max()) + MAX_GAP * mean, output_type="ndarray")
    gap = np.linalg.norm(centre[pairs[:, 0]] - centre[pairs[:, 1]], axis=1) - detection.radius[pairs].sum(axis=1)
    close = pairs[gap < MAX_GAP * mean]
    graph = coo_array((np.ones(len(close)), (close[:, 0], close[:, 1])), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    return np.asarray(label != np.bincount(label).argmax(), dtype=np.bool_)


def describe_false_detections(
    detection: Detection, within: NDArray[np.bool_] | None, shape: tuple[int, int]
) -> list[str]:
    """Describe circles that are probably parts of the apparatus.

    Parameters
    ----------
    detection : Detection
        n circles.
    within : (n,) array or None
        Circles between the walls; None: there are no walls.
    shape : tuple
        Rows and columns of the photograph.

    Returns
    -------
    list of str
        Messages; empty where there are too few such circles.
    """
    if within is not None:
        outside = ~within
        if outside.sum() < MIN_COUNT or outside.mean() < MIN_FRACTION:
            return []
        fact = f"{int(outside.sum())} of {detection.count} circles lie outside the walls and are left out"
        return [_region_advice(fact, _region_about(detection, within, shape))]
    separate = separate_circles(detection)
    radius = detection.radius[separate]
    if (
        separate.sum() < MIN_COUNT
        or separate.mean() < MIN_FRACTION
        or np.ptp(np.percentile(radius, [10, 90])) > MAX_SPREAD * radius.mean()
    ):
        return []
    fact = f"{int(separate.sum())} of {detection.count} circles lie apart from the packing and are all of one size"
    return [_region_advice(fact, _region_about(detection, ~separate, shape))]


def describe_channels(count: dict[str, int], used: str, found: int = 0) -> list[str]:
    """Describe a channel with more discs than the one that is used.

    Parameters
    ----------
    count : dict of str to int
        Discs in a small copy of each channel.
    used : str
        The channel that is used.
    found : int
        Discs that the whole picture of that channel shows.
    """
    if not count:
        return []
    best = max(count, key=lambda name: count[name])
    if found >= count[best] or count[best] < max(MIN_GAIN_RATIO * count[used], count[used] + MIN_GAIN):
        return []
    return [
        f"{count[best]} discs are detected in the {best} channel and {count[used]} in {used}: set "
        f'photographs.channel = "{best}".'
    ]


def _region_advice(fact: str, region: list[int]) -> str:
    return f"{fact}: if they are bolts or the frame, photographs.region = {region} excludes them."


def _region_about(detection: Detection, rows: NDArray[np.bool_], shape: tuple[int, int]) -> list[int]:
    """First column and row, last column and row of the region around some circles."""
    margin = MARGIN * float(detection.radius[rows].mean())
    reach = detection.radius[rows] + margin

    def ends(at: Array, last: int) -> tuple[int, int]:
        return max(int((at - reach).min()), 0), min(int((at + reach).max()) + 1, last)

    left, right = ends(detection.x[rows], shape[1] - 1)
    top, bottom = ends(detection.y[rows], shape[0] - 1)
    return [left, top, right, bottom]
