"""Compiled loops over grains and walls. The functions of `bodies.wall_shapes` give the same bits and explain them."""

from __future__ import annotations

import math

from numba import njit

from ..bodies.wall_shapes import ACROSS, DEEPEST, NEAR_END, STRAIGHT


@njit(cache=True, nogil=True, error_model="numpy")
def measure_at_wall(ends, side, x, y, radius):  # type: ignore[no-untyped-def]
    """Return the distance of a grain at (x, y) from a wall (2, 2) or from the end that it touches, and the normal."""
    start_x, start_y = ends[0, 0], ends[0, 1]
    u, v = ends[1, 0] - start_x, ends[1, 1] - start_y
    length = math.sqrt(u * u + v * v)
    if side != STRAIGHT:
        u, v = x - (start_x + ends[1, 0]) / 2.0, y - (start_y + ends[1, 1]) / 2.0
        apart = math.sqrt(u * u + v * v)
        sign = float(side) if apart > 0.0 else math.nan
        return side * (0.5 * length - apart), sign * u / apart, sign * v / apart
    u, v = u / length, v / length
    distance = (start_x - x) * v + (start_y - y) * -u
    along = (x - start_x) * u + (y - start_y) * v
    overlap = radius - distance
    if not (0.0 < along < length) and overlap > NEAR_END * radius:
        away_x, away_y = start_x - x, start_y - y
        apart = math.sqrt(away_x * away_x + away_y * away_y)
        far_x, far_y = ends[1, 0] - x, ends[1, 1] - y
        far = math.sqrt(far_x * far_x + far_y * far_y)
        if far < apart:
            apart, away_x, away_y = far, far_x, far_y
        if apart > 0.0 and (overlap > ACROSS * radius or abs(apart - radius) < overlap):
            return apart, away_x / apart, away_y / apart
    return distance, v, -u


@njit(cache=True, nogil=True, error_model="numpy")
def find_near_walls(position, radius, present, endpoints, side, threshold, near):  # type: ignore[no-untyped-def]
    """Set which grains are nearer to walls than a threshold (n, w); return whether all of them are beside theirs."""
    beside = True
    for w in range(len(endpoints)):
        start_x, start_y = endpoints[w, 0, 0], endpoints[w, 0, 1]
        u, v = endpoints[w, 1, 0] - start_x, endpoints[w, 1, 1] - start_y
        length = math.sqrt(u * u + v * v)
        middle_x, middle_y = (start_x + endpoints[w, 1, 0]) / 2.0, (start_y + endpoints[w, 1, 1]) / 2.0
        u, v = u / length, v / length
        for a in range(len(position)):
            x, y = position[a, 0], position[a, 1]
            if side[w] == STRAIGHT:
                distance = (start_x - x) * v + (start_y - y) * -u
            else:
                apart = math.sqrt((x - middle_x) * (x - middle_x) + (y - middle_y) * (y - middle_y))
                distance = side[w] * (0.5 * length - apart)
            gap = distance - radius[a]
            near[a, w] = present[a] and gap < threshold and gap > -DEEPEST * radius[a]
            if near[a, w] and side[w] == STRAIGHT:
                along = (x - start_x) * u + (y - start_y) * v
                beside = beside and 0.0 < along < length
    return beside
