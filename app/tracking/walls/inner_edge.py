"""The inner edge of a bar beside the packing: from a line drawn by hand near it, or from the rods that bear on it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.spatial import ConvexHull

from solver.bodies.grains import Array

from ...experiment.photographs import Image

BLUR = 1.5  # [px] of the picture that is searched: paint is smaller than a bar
SPACING = 2.0  # [px] between profiles along a line
STEP = 0.25  # [px] along a profile
PASSES = 6  # of the robust fit
OUTLIER = 2.0  # [px] from the line, from which on an edge is something else: a rod, paint
NARROWEST = 1.0  # [px] to which the search narrows
ON_CIRCLE = 360  # points on the outline of a rod, of which the hull is made
ALIKE = np.deg2rad(1.5)  # directions of the hull's sides that belong to one bar
SAME = np.deg2rad(12.0)  # two bars of a frame never lie as close in direction


def snap_to_edge(image: Image, line: Array, reach: float) -> tuple[Array, float]:
    """Move a line (2, 2) [px] onto the bar's edge beside it, no farther than reach [px].

    The packing lies to the left of the line as seen in the world: in the picture, on its right side when y points
    down. The edge is where the bar's bright ends towards the dark between the rods, the innermost such place. Gives
    the line, of the same ends as far as they go, and the share of the profiles that agree with it: below a third or so
    there is no edge.
    """
    smooth = gaussian_filter(np.asarray(image, np.float32), BLUR)
    start, end = np.asarray(line, np.float64)
    length = float(np.linalg.norm(end - start))
    along = (end - start) / max(length, 1e-9)
    inward = np.array([along[1], -along[0]])  # y down: left in the world
    count = max(int(length / SPACING), 8)
    place = np.linspace(0.02, 0.98, count) * length
    offset = np.arange(-reach, reach + STEP, STEP)
    points = start + place[:, None, None] * along + offset[None, :, None] * inward
    profile = map_coordinates(smooth, [points[..., 1], points[..., 0]], order=1, mode="nearest")
    slope = -np.gradient(profile, STEP, axis=1)  # bright outside, dark inside
    fit, window, share = np.zeros(2), reach, 0.0
    centred = place / length - 0.5
    for k in range(PASSES):
        expected = fit[0] + fit[1] * centred
        near = np.abs(offset[None] - expected[:, None]) <= window
        weighed = np.where(near, slope, 0.0)
        best = weighed.argmax(axis=1)
        strength = weighed.max(axis=1)
        found = offset[best] + peak_between(weighed, best) * STEP
        strong = strength > 0.3 * np.percentile(strength, 90)
        if strong.sum() < 4:
            return np.asarray(line, np.float64), 0.0
        fit = _fit_line(centred[strong], found[strong], consensus=k == 0)
        within = strong & (np.abs(found - fit[0] - fit[1] * centred) < OUTLIER)
        share = float(within.mean())
        if within.sum() >= 4:
            fit = np.polynomial.polynomial.polyfit(centred[within], found[within], 1)
        window = max(window / 2.5, NARROWEST)
    ends = fit[0] + fit[1] * np.array([-0.5, 0.5])
    return np.stack([start, end]) + ends[:, None] * inward, share


def find_bars(x: Array, y: Array, radius: Array, count: int = 4) -> Array:
    """The lines (w, 2, 2) [px] that bound circles (n,) [px] on their longest sides: where bars of a frame lie.

    In order around the packing, counter-clockwise as seen, beginning with the lowest in the picture; every line runs
    from corner to corner with the packing on its left in the world. Fewer than count where the hull has fewer sides.
    """
    turn = np.linspace(0.0, 2.0 * np.pi, ON_CIRCLE, endpoint=False)
    rim = np.stack([x[:, None] + radius[:, None] * np.cos(turn), y[:, None] + radius[:, None] * np.sin(turn)], axis=-1)
    rim = rim.reshape(-1, 2) * [1.0, -1.0]  # y up
    hull = rim[ConvexHull(rim).vertices]  # counter-clockwise
    side = np.roll(hull, -1, axis=0) - hull
    length, angle = np.linalg.norm(side, axis=1), np.arctan2(side[:, 1], side[:, 0])
    chosen: list[tuple[float, Array]] = []
    weight = np.array([length[np.abs(_wrapped(angle - a)) < ALIKE].sum() for a in angle])
    for k in np.argsort(-weight):
        if all(abs(float(_wrapped(angle[k] - other))) > SAME for other, _ in chosen):
            group = np.abs(_wrapped(angle - angle[k])) < ALIKE
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


def meeting_lines(lines: Array) -> Array:
    """Lines (w, 2, 2) lengthened or cut to the corners where each meets the next."""
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
    """Where two lines meet, each told by its direction and by its point nearest to the origin."""
    a, b = np.array([np.cos(angle), np.sin(angle)]), np.array([np.cos(other_angle), np.sin(other_angle)])
    t = np.linalg.solve(np.stack([a, -b], axis=1), other_foot - foot)
    return foot + t[0] * a


def peak_between(slope: Array, at: NDArray[np.intp]) -> Array:
    """Where between the steps the greatest slope of every profile lies (p,), by the parabola through three."""
    rows = np.arange(len(at))
    middle = np.clip(at, 1, slope.shape[1] - 2)
    left, here, right = (slope[rows, middle + k] for k in (-1, 0, 1))
    bend = left - 2.0 * here + right
    return np.where((bend < 0.0) & (middle == at), 0.5 * (left - right) / np.where(bend < 0.0, bend, -1.0), 0.0)


def _fit_line(x: Array, y: Array, *, consensus: bool) -> Array:
    """Offset and slope of the line through most of the points; consensus: of all lines through two of them."""
    if not consensus:
        return np.asarray(np.polynomial.polynomial.polyfit(x, y, 1), dtype=np.float64)
    few = np.unique(np.linspace(0, len(x) - 1, min(len(x), 40)).astype(int))
    i, j = np.triu_indices(len(few), 1)
    a, b = few[i], few[j]
    slope = (y[b] - y[a]) / np.where(x[b] != x[a], x[b] - x[a], 1.0)
    offset = y[a] - slope * x[a]
    agree = (np.abs(y[None] - offset[:, None] - slope[:, None] * x[None]) < OUTLIER).sum(axis=1)
    best = int(agree.argmax())
    return np.array([offset[best], slope[best]])


def _wrapped(angle: Array) -> Array:
    return np.asarray(np.angle(np.exp(1j * np.asarray(angle))), dtype=np.float64)
