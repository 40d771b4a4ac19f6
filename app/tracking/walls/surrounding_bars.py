"""The bars of a frame, found from the rods that touch them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from ...solver.bodies.disc_pairs import find_disc_pairs
from ...solver.bodies.grains import Array

BARS = 4  # of a frame
RIM_POINTS = 360  # points on the outline of a rod, from which the hull is computed
SAME_BAR = np.deg2rad(1.5)  # greatest angle between the hull's sides of one bar
MIN_ANGLE = np.deg2rad(12.0)  # least angle between two bars
NEXT = 0.1  # mean radii between two circles that are next to each other
MOST_HELD = 0.8  # of the circles
# Circles that touch a line: so few may be no rods, if the line without them touches more than as many more; times.
FEW, ROUNDS = 2, 3


def find_bars(x: Array, y: Array, radius: Array) -> Array:
    """Find the lines that bound circles on their longest sides: the faces of a frame's bars.

    Circles that the others do not hold, as bolts and spots of a bar's paint, are left out, and one or two that a line
    rests on where more touch it without them.

    Parameters
    ----------
    x, y, radius : (n,) array
        Circles [px].

    Returns
    -------
    (w, 2, 2) array
        Lines from corner to corner [px], the packing on their left in the world, counter-clockwise around it, the
        lowest in the picture first; fewer than four where the hull has fewer sides.
    """
    circles = np.column_stack([x, y, radius])
    circles = circles[are_held(x, y, radius)]
    lines = _hull_lines(circles, BARS)
    for _ in range(ROUNDS):
        touching = _touching(lines, circles)
        number = touching.sum(axis=1)
        left = circles[~touching[number <= FEW].any(axis=0)]
        if not (number <= FEW).any() or len(left) < MOST_HELD * len(circles):
            break
        moved = _hull_lines(left, BARS)
        # A free surface rests on few circles as well, and on few others below them.
        if len(moved) != len(lines) or _touching(moved, circles).sum(axis=1).min() <= number.min() + FEW:
            break
        circles, lines = left, moved
    return lines


def _touching(lines: Array, circles: Array) -> NDArray[np.bool_]:
    """Which circles (n, 3) touch each line (w, 2, 2), as (w, n)."""
    away = np.array([_distances(line, *circles[:, :2].T) for line in lines]).reshape(-1, len(circles))
    return np.abs(away - circles[:, 2]) < NEXT * circles[:, 2].mean()


def _hull_lines(circles: Array, count: int) -> Array:
    """The lines of `find_bars` that bound all circles (n, 3)."""
    x, y, radius = circles.T
    polar = np.linspace(0.0, 2.0 * np.pi, RIM_POINTS, endpoint=False)
    rim_x, rim_y = x[:, None] + radius[:, None] * np.cos(polar), y[:, None] + radius[:, None] * np.sin(polar)
    rim = np.stack([rim_x, rim_y], axis=-1).reshape(-1, 2) * [1.0, -1.0]  # y up
    hull = rim[ConvexHull(rim).vertices]  # counter-clockwise
    side = np.roll(hull, -1, axis=0) - hull
    length, angle = np.linalg.norm(side, axis=1), np.arctan2(side[:, 1], side[:, 0])
    chosen: list[tuple[float, Array]] = []
    weight = np.array([length[np.abs(_wrapped(angle - a)) < SAME_BAR].sum() for a in angle])
    for k in np.argsort(-weight):
        if all(abs(float(_wrapped(angle[k] - other))) > MIN_ANGLE for other, _ in chosen):
            group = np.abs(_wrapped(angle - angle[k])) < SAME_BAR
            direction = side[group].sum(axis=0)
            direction /= np.linalg.norm(direction)
            outward = np.array([direction[1], -direction[0]])
            chosen.append((float(np.arctan2(direction[1], direction[0])), outward * (hull @ outward).max()))
        if len(chosen) == count:
            break
    chosen.sort(key=lambda each: (each[0] + 0.25 * np.pi) % (2.0 * np.pi))
    corners = [_meet(*a, *b) for a, b in pairwise([chosen[-1], *chosen])] if len(chosen) > 2 else []
    lines = [(corners[k], corners[(k + 1) % len(corners)]) for k in range(len(corners))]
    return np.array(lines).reshape(-1, 2, 2) * [1.0, -1.0]


def are_held(x: Array, y: Array, radius: Array) -> NDArray[np.bool_]:
    """Whether each circle (n,) is next to two others or more; all where this is so of few, as in a loose packing."""
    pairs = find_disc_pairs(np.column_stack([x, y]), radius, NEXT * float(radius.mean()))
    held = np.bincount(pairs.ravel(), minlength=len(x)) >= 2
    return held if held.mean() > MOST_HELD else np.ones(len(x), np.bool_)


def depth_in_circles(line: Array, x: Array, y: Array, radius: Array) -> float:
    """Return how far a line (2, 2) reaches into one of n circles at most, over its radius; negative: into none."""
    return float(np.max(1.0 - _distances(line, x, y) / radius))


def _distances(line: Array, x: Array, y: Array) -> Array:
    """Distances (n,) of places from a line (2, 2) that goes on beyond its ends."""
    along = line[1] - line[0]
    across = np.array([-along[1], along[0]]) / np.hypot(*along)
    return np.abs((np.column_stack([x, y]) - line[0]) @ across)


def lines_to_corners(lines: Array) -> Array:
    """Extend or cut lines (w, 2, 2) to the corners where each meets the next."""
    moved = np.array(lines, dtype=np.float64)
    for k in range(len(lines)):
        a, b = lines[k], lines[(k + 1) % len(lines)]
        matrix = np.stack([a[1] - a[0], b[0] - b[1]], axis=1)
        if abs(np.linalg.det(matrix)) < 1e-9:
            continue
        corner = a[0] + np.linalg.solve(matrix, b[0] - a[0])[0] * (a[1] - a[0])
        moved[k, 1] = corner
        moved[(k + 1) % len(lines), 0] = corner
    return moved


def _meet(angle: float, foot: Array, other_angle: float, other_foot: Array) -> Array:
    """Intersection of two lines, each given by its direction and its point nearest to the origin."""
    a, b = np.array([np.cos(angle), np.sin(angle)]), np.array([np.cos(other_angle), np.sin(other_angle)])
    t = np.linalg.solve(np.stack([a, -b], axis=1), other_foot - foot)
    return foot + t[0] * a


def _wrapped(angle: Array) -> Array:
    return np.asarray(np.angle(np.exp(1j * np.asarray(angle))), dtype=np.float64)
