"""Pairs that may touch: all near ones but two grains of the boundary."""

import numpy as np
from rodsight.solver.boundary.touching_pairs import find_near_pairs

R = 0.01


def test_two_grains_of_the_boundary_are_no_pair():
    position = np.column_stack([2.02 * R * np.arange(5), np.zeros(5)])
    radius = np.full(5, R)
    boundary = np.array([True, True, True, False, False])
    every, moving = find_near_pairs(position, radius), find_near_pairs(position, radius, boundary)
    assert sorted(zip(every.i.tolist(), every.j.tolist(), strict=True)) == [(0, 1), (1, 2), (2, 3), (3, 4)]
    assert sorted(zip(moving.i.tolist(), moving.j.tolist(), strict=True)) == [(2, 3), (3, 4)]
    np.testing.assert_allclose(moving.gap, 0.02 * R, rtol=1e-9)
