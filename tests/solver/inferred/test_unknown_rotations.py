"""Rotations of rods without measured rotation."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.solver.inferred.unknown_rotations import fill_unknown_rotations

pytestmark = pytest.mark.unit

R = 0.008


def between_plates(step: float) -> tuple[np.ndarray, np.ndarray]:
    """Make a rod between a floor at rest and a lid that moves by `step` per photograph: its centre, and the plates."""
    k = np.arange(3)
    centre = np.stack([0.5 * step * k, np.full(3, R)], axis=1)[:, None]
    floor = np.tile([[-0.1, 0.0], [0.1, 0.0]], (3, 1, 1))
    lid = np.array([[0.1, 2 * R], [-0.1, 2 * R]]) + (step * k)[:, None, None] * [1.0, 0.0]
    return centre, np.stack([floor, lid], axis=1)


def test_rod_between_two_plates_rolls_on_both() -> None:
    centre, plates = between_plates(1e-3)
    unknown = np.full((3, 1), np.nan)
    rotated = fill_unknown_rotations(np.array([R]), centre, unknown, np.ones((3, 1), bool), plates)
    assert rotated[:, 0] == pytest.approx([0.0, -0.5e-3 / R, -1e-3 / R], rel=2e-3)  # clockwise, as the lid goes right


def test_rod_of_a_pair_rotates_opposite_to_the_measured_one() -> None:
    centre = np.tile([[0.0, 0.0], [2 * R, 0.0]], (2, 1, 1))
    rotation = np.array([[0.0, np.nan], [0.01, np.nan]])
    rotated = fill_unknown_rotations(np.full(2, R), centre, rotation, np.ones((2, 2), bool), np.empty((2, 0, 2, 2)))
    assert rotated[1] == pytest.approx([0.01, -0.01], rel=2e-3)


def test_measured_rotations_stay_and_lost_rods_stay_lost() -> None:
    centre, plates = between_plates(1e-3)
    known = np.array([[0.1], [0.2], [0.3]])
    assert fill_unknown_rotations(np.array([R]), centre, known, np.ones((3, 1), bool), plates) is known
    lost = np.array([[True], [False], [True]])
    unknown = np.full((3, 1), np.nan)
    rotated = fill_unknown_rotations(np.array([R]), centre, unknown, lost, plates)
    assert np.isnan(rotated[1, 0])
    assert np.isfinite(rotated[[0, 2], 0]).all()


def test_rod_without_contacts_does_not_rotate() -> None:
    centre = np.array([[[0.0, 0.0]], [[0.01, 0.0]]])
    rotated = fill_unknown_rotations(
        np.array([R]), centre, np.full((2, 1), np.nan), np.ones((2, 1), bool), np.empty((2, 0, 2, 2))
    )
    assert np.array_equal(rotated, np.zeros((2, 1)))


def test_rod_rolls_on_the_plates_that_are_known() -> None:
    centre, plates = between_plates(1e-3)
    plates[1, 1] = np.nan  # the lid is not found in the second photograph
    rotated = fill_unknown_rotations(np.array([R]), centre, np.full((3, 1), np.nan), np.ones((3, 1), bool), plates)
    assert rotated[:, 0] == pytest.approx([0.0, -0.5e-3 / R, -1e-3 / R], rel=2e-3)  # the floor alone shows it
