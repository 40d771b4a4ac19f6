"""Rods laid on one another, as in a box, and the match of a detection with them."""

from __future__ import annotations

import numpy as np
from rodsight.solver.bodies.grains import Array
from rodsight.synthetic.speckle import SpeckleSettings
from rodsight.tracking.detection.detect import Detection
from scipy.spatial import KDTree

from tests.app.tracking.speckled import PIXEL_SIZE, Rods

CLASSES = (28.0, 32.0, 44.0)  # [px]
FOUND = 3.0  # [px] from the true centre
WIDTH, HEIGHT = 620, 560  # [px]
ROUNDING = 1e-6  # [px]


def lay_rods(
    seed: int, classes: tuple[float, ...] = CLASSES, *, cut: bool = False, width: int = WIDTH, height: int = HEIGHT
) -> Rods:
    """Lay each rod in the lowest place where it touches two: many contacts, few gaps.

    There are bars on the left, on the right and below; `cut`: no bars, and some rods beyond the border.
    """
    generator = np.random.default_rng(seed)
    left, right, floor = (0.0, float(width), height + 20.0) if cut else (60.3, width - 61.2, height - 60.6)
    circles = np.empty((0, 3))
    while True:
        r = float(generator.choice(classes))
        places = _resting_places(circles, r, left, right, floor)
        x, y = places[np.argmax(places[:, 1])]
        if y < 90.0:
            break
        circles = np.vstack([circles, (x, y, r)])
    x, y, radius = circles.T
    # World points, y up; the packing lies on the left of each bar.
    corners = np.array([[left, 20.0], [left, floor], [right, floor], [right, 20.0]])
    world = np.stack([corners[:, 0], height - 1 - corners[:, 1]], axis=1) * PIXEL_SIZE
    bars = np.stack([world[:-1], world[1:]], axis=1)
    settings = SpeckleSettings(pixel_size=PIXEL_SIZE)
    return Rods(width, height, x, y, radius, settings, np.empty((0, 2, 2)) if cut else bars)


def _resting_places(circles: Array, r: float, left: float, right: float, floor: float) -> Array:
    """Places (p, 2) [px] of a rod of radius r: on the floor, on a rod and a side, on two rods."""
    line = np.arange(left + r, right - r, 2.0)
    places = [np.column_stack([line, np.full(len(line), floor - r)])]
    x, y, radius = circles.T
    for side in (left + r, right - r):
        height_squared = (radius + r) ** 2 - (side - x) ** 2
        reachable = height_squared > 0
        places.append(
            np.column_stack([np.full(reachable.sum(), side), y[reachable] - np.sqrt(height_squared[reachable])])
        )
    a, b = np.tril_indices(len(circles), -1)
    distance = np.hypot(x[b] - x[a], y[b] - y[a])
    reachable = distance < radius[a] + radius[b] + 2 * r
    a, b, distance = a[reachable], b[reachable], distance[reachable]
    along = ((radius[a] + r) ** 2 - (radius[b] + r) ** 2 + distance**2) / (2 * distance)
    across = np.sqrt(np.maximum((radius[a] + r) ** 2 - along**2, 0.0))
    ux, uy = (x[b] - x[a]) / distance, (y[b] - y[a]) / distance
    for side in (-across, across):
        places.append(np.column_stack([x[a] + along * ux + side * uy, y[a] + along * uy - side * ux]))
    found = np.concatenate(places)
    px, py = found.T
    within = (px >= left + r - ROUNDING) & (px <= right - r + ROUNDING) & (py <= floor - r + ROUNDING)
    found = found[within]
    apart = np.hypot(found[:, :1] - x, found[:, 1:] - y) > r + radius - ROUNDING
    return found[apart.all(axis=1)]


def match(found: Detection, rods: Rods) -> tuple[np.ndarray, np.ndarray]:
    """Return the index of the detection nearest to each rod, and whether it is that rod."""
    distance, index = KDTree(np.stack([found.x, found.y], axis=1)).query(np.stack([rods.x, rods.y], axis=1))
    return index, distance < FOUND
