"""The loops over grains and walls give the same bits as the functions of `wall_shapes`."""

import numpy as np
import pytest
from rodsight.solver.bodies.wall_shapes import (
    DEEPEST,
    IN,
    OUT,
    STRAIGHT,
    beside_wall,
    distance_from_walls,
    nearest_ends,
    wall_distance,
)
from rodsight.solver.contacts.wall_kernels import find_near_walls, measure_at_wall

ENDS = np.array([
    [[0.0, 0.0], [1.0, 0.1]], [[1.0, 0.0], [1.1, 1.0]], [[-0.2, 0.5], [1.2, 0.6]], [[0.3, 0.3], [0.6, 0.8]],
])  # fmt: skip
SIDE = np.array([STRAIGHT, STRAIGHT, IN, OUT], np.int8)


def around_walls() -> tuple[np.ndarray, np.ndarray]:
    """Places of grains on both sides of all walls and past their ends, and radii."""
    rng = np.random.default_rng(1)
    near_ends = ENDS[:2].reshape(-1, 2) + rng.normal(0.0, 0.03, (200, 4, 2))
    place = np.concatenate([rng.uniform(-0.3, 1.4, (500, 2)), near_ends.reshape(-1, 2), [[np.nan, np.nan]]])
    return place, rng.uniform(0.02, 0.05, len(place))


@pytest.mark.parametrize("w", range(len(ENDS)))
def test_a_grain_is_measured_at_the_face_or_at_the_end_that_it_touches(w):
    place, radius = around_walls()
    ends, side = np.repeat(ENDS[w : w + 1], len(place), axis=0), np.repeat(SIDE[w], len(place))
    distance, normal = wall_distance(ends, side, place)
    end = nearest_ends(ends, side, place, radius)
    assert end.touched.any() == (SIDE[w] == STRAIGHT)
    expected = np.column_stack([
        np.where(end.touched, end.distance, distance), np.where(end.touched[:, None], end.normal, normal)
    ])  # fmt: skip
    found = [measure_at_wall(ENDS[w], SIDE[w], x, y, r) for (x, y), r in zip(place, radius, strict=True)]
    assert np.array_equal(found, expected, equal_nan=True)


@pytest.mark.parametrize("threshold", [0.001, 0.03])
def test_grains_near_walls_are_found_with_whether_all_are_beside(threshold):
    place, radius = around_walls()
    present = np.arange(len(place)) % 5 > 0
    gap = distance_from_walls(ENDS[None], SIDE[None], place[:, None]) - radius[:, None]
    expected = (gap < threshold) & (gap > -DEEPEST * radius[:, None]) & present[:, None]
    beside = beside_wall(ENDS[None], SIDE[None], place[:, None], np.zeros(1))
    near = np.ones(expected.shape, np.bool_)
    assert not find_near_walls(place, radius, present, ENDS, SIDE, threshold, near)
    assert np.array_equal(near, expected)
    present &= (beside | ~expected).all(axis=1)
    assert find_near_walls(place, radius, present, ENDS, SIDE, threshold, near)
    assert near.any()
