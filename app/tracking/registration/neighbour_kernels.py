"""Nearest grains by cells, and the motion that they share, in compiled loops."""

from __future__ import annotations

import numpy as np
from numba import njit

from ..short_sort import median

# Grains of a cell, on average.
OF_A_CELL = 2.0


@njit(cache=True, nogil=True)
def find_nearest(known, query, index, distance):
    """Find the nearest of the known positions, in ascending order of their distance.

    Parameters
    ----------
    known : (k, 2) array
        Known positions [px], finite.
    query : (m, 2) array
        Places [px], finite.
    index : (m, c) array
        Receives the rows of the c nearest, c ≤ k.
    distance : (m, c) array
        Receives their distances [px].
    """
    count, wanted = len(known), index.shape[1]
    left, top, right, bottom = known[0, 0], known[0, 1], known[0, 0], known[0, 1]
    for i in range(count):
        left, right = min(left, known[i, 0]), max(right, known[i, 0])
        top, bottom = min(top, known[i, 1]), max(bottom, known[i, 1])
    # A cell is never so small that a row of grains takes more cells than there are grains.
    area = np.sqrt((right - left) * (bottom - top) * OF_A_CELL / count)
    side = max(area, OF_A_CELL * max(right - left, bottom - top) / count, 1e-9)
    columns, rows = int((right - left) / side) + 1, int((bottom - top) / side) + 1
    start, cell = np.zeros(columns * rows + 1, np.int64), np.empty(count, np.int64)
    for i in range(count):
        cell[i] = int((known[i, 1] - top) / side) * columns + int((known[i, 0] - left) / side)
        start[cell[i] + 1] += 1
    for c in range(columns * rows):
        start[c + 1] += start[c]
    place, order = start.copy(), np.empty(count, np.int64)
    for i in range(count):
        order[place[cell[i]]] = i
        place[cell[i]] += 1
    for q in range(len(query)):
        x, y = query[q, 0], query[q, 1]
        column = int(min(max((x - left) / side, 0.0), columns - 1.0))
        row = int(min(max((y - top) / side, 0.0), rows - 1.0))
        found, ring = 0, 0
        # Grains beyond a ring of cells are no nearer than the ring's distance from the middle cell.
        while ring <= max(columns, rows) and not (found == wanted and distance[q, wanted - 1] <= (ring - 1) * side):
            for r in range(max(row - ring, 0), min(row + ring, rows - 1) + 1):
                step = 1 if abs(r - row) == ring else max(2 * ring, 1)
                for c in range(column - ring, column + ring + 1, step):
                    if c < 0 or c >= columns:
                        continue
                    for n in range(start[r * columns + c], start[r * columns + c + 1]):
                        i = order[n]
                        apart = np.sqrt((known[i, 0] - x) ** 2 + (known[i, 1] - y) ** 2)
                        if found == wanted and not apart < distance[q, wanted - 1]:
                            continue
                        k = found if found < wanted else wanted - 1
                        while k > 0 and distance[q, k - 1] > apart:
                            distance[q, k], index[q, k] = distance[q, k - 1], index[q, k - 1]
                            k -= 1
                        distance[q, k], index[q, k] = apart, i
                        found = min(found + 1, wanted)
            ring += 1


@njit(cache=True, nogil=True)
def fit_motion(known, displacement, query, index, affine_count, prediction, median_deviation):
    """Fit the displacements of the neighbours of every place, see `neighbours.local_motion`.

    Parameters
    ----------
    known, displacement, query
        As of `local_motion`.
    index : (m, c) array
        Rows of the neighbours of each place.
    affine_count : int
        Number of neighbours below which the prediction is their median.
    prediction : (m, 2) array
        Receives the displacements [px].
    median_deviation : (m,) array
        Receives the neighbours' median deviation [px].
    """
    count = index.shape[1]
    moved, distance, deviation = np.empty((2, count)), np.empty(count), np.empty(count)
    design, normal, right = np.empty(3), np.empty((3, 3)), np.empty((3, 2))
    for q in range(len(query)):
        for k in range(count):
            i = index[q, k]
            moved[0, k], moved[1, k] = displacement[i, 0], displacement[i, 1]
            distance[k] = np.sqrt((known[i, 0] - query[q, 0]) ** 2 + (known[i, 1] - query[q, 1]) ** 2)
        common_x, common_y = median(moved[0]), median(moved[1])
        farthest = 1e-9
        for k in range(count):
            moved[0, k] -= common_x
            moved[1, k] -= common_y
            deviation[k] = np.sqrt(moved[0, k] ** 2 + moved[1, k] ** 2)
            farthest = max(farthest, distance[k])
        prediction[q, 0], prediction[q, 1] = common_x, common_y
        median_deviation[q] = median(deviation)
        if count < affine_count:
            continue
        # The quarter of a pixel keeps all neighbours where the motion is perfectly uniform.
        limit = 4.0 * median_deviation[q] + 0.25
        for a in range(3):
            for b in range(3):
                normal[a, b] = 0.0
            right[a, 0] = right[a, 1] = 0.0
        for k in range(count):
            if not deviation[k] < limit:
                continue
            weight = np.exp(-2.0 * (distance[k] / farthest) ** 2)
            _fill_design(known, query, q, index[q, k], farthest, design)
            for a in range(3):
                for b in range(3):
                    normal[a, b] += weight * design[a] * design[b]
                right[a, 0] += weight * design[a] * moved[0, k]
                right[a, 1] += weight * design[a] * moved[1, k]
        # Neighbours on one line do not determine the gradient across it, which is regularised to zero.
        normal[1, 1] += 1e-2
        normal[2, 2] += 1e-2
        normal[0, 0] += 1e-9
        _solve(normal, right)
        for k in range(count):
            _fill_design(known, query, q, index[q, k], farthest, design)
            miss_x, miss_y = moved[0, k], moved[1, k]
            for a in range(3):
                miss_x -= design[a] * right[a, 0]
                miss_y -= design[a] * right[a, 1]
            deviation[k] = np.sqrt(miss_x**2 + miss_y**2)
        prediction[q, 0] += right[0, 0]
        prediction[q, 1] += right[0, 1]
        median_deviation[q] = median(deviation)


@njit(cache=True, nogil=True)
def _fill_design(known, query, q, i, farthest, design):
    """Write 1 and the offset of a neighbour from a place, in units of the farthest one's."""
    design[0] = 1.0
    design[1] = (known[i, 0] - query[q, 0]) / farthest
    design[2] = (known[i, 1] - query[q, 1]) / farthest


@njit(cache=True, nogil=True)
def _solve(matrix, right):
    """Solve a positive definite system (3, 3) for two right-hand sides (3, 2) in place, by elimination."""
    for k in range(3):
        for i in range(k + 1, 3):
            factor = matrix[i, k] / matrix[k, k]
            for j in range(k, 3):
                matrix[i, j] -= factor * matrix[k, j]
            for j in range(2):
                right[i, j] -= factor * right[k, j]
    for k in (2, 1, 0):
        for j in range(2):
            for i in range(k + 1, 3):
                right[k, j] -= matrix[k, i] * right[i, j]
            right[k, j] /= matrix[k, k]
