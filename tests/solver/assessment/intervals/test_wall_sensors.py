"""Forces that sensors record on walls are compared with the inferred ones."""

import numpy as np
import pytest
from rodsight.solver.assessment.intervals.wall_sensors import compare_wall_forces, contradicting, scale_error

NORMAL = np.tile([[0.0, -1.0], [1.0, 0.0], [0.0, 1.0]], (4, 1, 1))
ALONG = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 0.0]])
PUSH = np.array([100.0, 120.0, 90.0, 110.0])[:, None, None]  # [N] of four photographs


def test_normal_forces_are_compared_whatever_acts_along_the_wall():
    recorded = PUSH * (NORMAL + 0.2 * ALONG)
    ratio = compare_wall_forces(1.5 * PUSH * (NORMAL - 0.1 * ALONG), recorded, NORMAL)
    assert ratio == pytest.approx([1.5, 1.5, 1.5])


def test_large_forces_count_most_and_missing_ones_not():
    recorded = PUSH * NORMAL
    inferred = recorded.copy()
    inferred[1] *= 2.0
    assert compare_wall_forces(inferred, recorded, NORMAL) == pytest.approx(1.0 + 120.0**2 / np.sum(PUSH**2))
    recorded[1] = np.nan
    assert compare_wall_forces(inferred, recorded, NORMAL) == pytest.approx(1.0)
    inferred[2] = np.nan  # a failed photograph
    assert compare_wall_forces(inferred, recorded, NORMAL) == pytest.approx(1.0)


def test_walls_without_a_sensor_or_with_little_force_are_not_compared():
    recorded = PUSH * NORMAL
    recorded[:, 0] = np.nan
    recorded[:, 2] *= 0.05
    assert np.isnan(compare_wall_forces(PUSH * NORMAL, recorded, NORMAL)).tolist() == [True, False, True]
    assert np.isnan(compare_wall_forces(PUSH * NORMAL, np.full_like(recorded, np.nan), NORMAL)).all()
    assert np.isnan(compare_wall_forces(PUSH * NORMAL, 0.0 * NORMAL, NORMAL)).all()


@pytest.mark.parametrize(
    ("ratio", "contradicts"),
    [([1.0, 0.8, np.nan], False), ([1.0, 1.4, 1.0], True), ([-1.0, 1.0, 1.0], True), ([np.nan, np.nan], False)],
)
def test_one_wall_can_contradict(ratio, contradicts):
    assert contradicting(np.array(ratio)) == contradicts


def test_the_scale_is_contradicted_by_most_walls_beyond_its_own_error():
    walls = np.array([0.8, 0.82, 2.0, np.nan])
    assert scale_error(walls, 0.02) == pytest.approx(0.18)
    assert scale_error(walls, 0.1) == 0.0
    assert scale_error(np.array([1.06, 1.06, 1.0]), 0.01) == 0.0  # the error of a wall
    assert scale_error(np.array([np.nan]), 0.01) == 0.0


def test_forces_of_the_walls_on_the_packing_do_not_contradict_the_scale():
    assert scale_error(np.array([-1.0, -1.02, -0.98]), 0.02) == 0.0
