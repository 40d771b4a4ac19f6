"""Detection of a bar's inner edge, from a line drawn by hand near it or from the rods that touch it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.spatial import ConvexHull

from ...experiment.pictures.image import Image
from ...solver.bodies.disc_pairs import find_disc_pairs
from ...solver.bodies.grains import Array
from ...solver.even_subset import even_subset

BLUR = 1.5  # [px] standard deviation of the smoothing: paint is finer than a bar
SPACING = 2.0  # [px] between profiles along a line
STEP = 0.25  # [px] along a profile
PASSES = 6  # of the robust fit
OUTLIER = 2.0  # [px] distance from the line beyond which an edge belongs to something else: a rod, paint
MIN_WINDOW = 1.0  # [px] half width of the last searches
RIM_POINTS = 360  # points on the outline of a rod, from which the hull is computed
SAME_BAR = np.deg2rad(1.5)  # greatest angle between the hull's sides of one bar
MIN_ANGLE = np.deg2rad(12.0)  # least angle between two bars
NEXT = 0.1  # mean radii between two circles that are next to each other
MOST_HELD = 0.8  # of the circles
# Circles that touch a line: so few may be no rods, if the line without them touches more than as many more; times.
FEW, ROUNDS = 2, 3


def snap_to_edge(image: Image, line: Array, max_shift: float) -> tuple[Array, float]:
    """Move a line onto the bar's edge near it.

    The packing lies on the left of the line in the world, y up. The edge is the innermost transition from the bright
    bar to the dark between the rods.

    Parameters
    ----------
    image : (H, W) array
        The photograph [grey].
    line : (2, 2) array
        End points x, y [px].
    max_shift : float
        Greatest distance of the edge from the line [px].

    Returns
    -------
    line : (2, 2) array
        The end points, displaced along the normal [px].
    fraction : float
        Fraction of the profiles that agree with the line; below about a third there is no edge.
    """
    smooth = gaussian_filter(np.asarray(image, np.float32), BLUR)
    start, end = np.asarray(line, np.float64)
    length = float(np.linalg.norm(end - start))
    along = (end - start) / max(length, 1e-9)
    inward = np.array([along[1], -along[0]])  # y down: left in the world
    count = max(int(length / SPACING), 8)
    position = np.linspace(0.02, 0.98, count) * length
    offset = np.arange(-max_shift, max_shift + STEP, STEP)
    points = start + position[:, None, None] * along + offset[None, :, None] * inward
    profile = map_coordinates(smooth, [points[..., 1], points[..., 0]], order=1, mode="nearest")
    slope = -np.gradient(profile, STEP, axis=1)  # bright outside, dark inside
    fit, window, fraction = np.zeros(2), max_shift, 0.0
    centred = position / length - 0.5
    for k in range(PASSES):
        expected = fit[0] + fit[1] * centred
        near = np.abs(offset[None] - expected[:, None]) <= window
        slope_in_window = np.where(near, slope, 0.0)
        best = slope_in_window.argmax(axis=1)
        strength = slope_in_window.max(axis=1)
        edge = offset[best] + subpixel_peak(slope_in_window, best) * STEP
        strong = strength > 0.3 * np.percentile(strength, 90)
        if strong.sum() < 4:
            return np.asarray(line, np.float64), 0.0
        fit = _fit_line(centred[strong], edge[strong], consensus=k == 0)
        within = strong & (np.abs(edge - fit[0] - fit[1] * centred) < OUTLIER)
        fraction = float(within.mean())
        if within.sum() >= 4:
            fit = np.polynomial.polynomial.polyfit(centred[within], edge[within], 1)
        window = max(window / 2.5, MIN_WINDOW)
    ends = fit[0] + fit[1] * np.array([-0.5, 0.5])
    return np.stack([start, end]) + ends[:, None] * inward, fraction


def find_bars(x: Array, y: Array, radius: Array, count: int = 4) -> Array:
    """Find the lines that bound circles on their longest sides: the faces of a frame's bars.

    Circles that the others do not hold, as bolts and spots of a bar's paint, are left out, and one or two that a line
    rests on where more touch it without them.

    Parameters
    ----------
    x, y, radius : (n,) array
        Circles [px].
    count : int
        Greatest number of lines.

    Returns
    -------
    (w, 2, 2) array
        Lines from corner to corner [px], the packing on their left in the world, counter-clockwise around it, the
        lowest in the picture first; fewer than `count` where the hull has fewer sides.
    """
    circles = np.column_stack([x, y, radius])
    circles = circles[are_held(x, y, radius)]
    lines = _hull_lines(circles, count)
    for _ in range(ROUNDS):
        touching = _touching(lines, circles)
        number = touching.sum(axis=1)
        left = circles[~touching[number <= FEW].any(axis=0)]
        if not (number <= FEW).any() or len(left) < MOST_HELD * len(circles):
            break
        moved = _hull_lines(left, count)
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


def subpixel_peak(slope: Array, at: NDArray[np.intp]) -> Array:
    """Return the offsets (p,) of the greatest slopes from their steps, by the parabola through three points."""
    rows = np.arange(len(at))
    middle = np.clip(at, 1, slope.shape[1] - 2)
    left, here, right = (slope[rows, middle + k] for k in (-1, 0, 1))
    bend = left - 2.0 * here + right
    return np.where((bend < 0.0) & (middle == at), 0.5 * (left - right) / np.where(bend < 0.0, bend, -1.0), 0.0)


def _fit_line(x: Array, y: Array, *, consensus: bool) -> Array:
    """Offset and slope of a line: by least squares, or with consensus the line through two points near most points."""
    if not consensus:
        return np.asarray(np.polynomial.polynomial.polyfit(x, y, 1), dtype=np.float64)
    few = even_subset(len(x), 40)
    i, j = np.triu_indices(len(few), 1)
    a, b = few[i], few[j]
    slope = (y[b] - y[a]) / np.where(x[b] != x[a], x[b] - x[a], 1.0)
    offset = y[a] - slope * x[a]
    agree = (np.abs(y[None] - offset[:, None] - slope[:, None] * x[None]) < OUTLIER).sum(axis=1)
    best = int(agree.argmax())
    return np.array([offset[best], slope[best]])


def _wrapped(angle: Array) -> Array:
    return np.asarray(np.angle(np.exp(1j * np.asarray(angle))), dtype=np.float64)
