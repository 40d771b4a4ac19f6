"""Rods whose rotation nobody measured turn as gears do."""

from __future__ import annotations

import numpy as np
import pytest

from solver.inferred.rolling import roll_unknown

pytestmark = pytest.mark.unit

R = 0.008


def between_plates(step: float) -> tuple[np.ndarray, np.ndarray]:
    """A rod between a floor at rest and a lid that moves by `step` a photograph: its centre, and the plates."""
    k = np.arange(3)
    centre = np.stack([0.5 * step * k, np.full(3, R)], axis=1)[:, None]
    floor = np.tile([[-0.1, 0.0], [0.1, 0.0]], (3, 1, 1))
    lid = np.array([[0.1, 2 * R], [-0.1, 2 * R]]) + (step * k)[:, None, None] * [1.0, 0.0]
    return centre, np.stack([floor, lid], axis=1)


def test_a_rod_between_two_plates_rolls_on_both() -> None:
    centre, plates = between_plates(1e-3)
    unknown = np.full((3, 1), np.nan)
    turned = roll_unknown(np.array([R]), centre, unknown, np.ones((3, 1), bool), plates)
    assert turned[:, 0] == pytest.approx([0.0, -0.5e-3 / R, -1e-3 / R], rel=2e-3)  # clockwise, as the lid goes right


def test_a_rod_of_a_pair_turns_against_the_one_that_was_measured() -> None:
    centre = np.tile([[0.0, 0.0], [2 * R, 0.0]], (2, 1, 1))
    rotation = np.array([[0.0, np.nan], [0.01, np.nan]])
    turned = roll_unknown(np.full(2, R), centre, rotation, np.ones((2, 2), bool), np.empty((2, 0, 2, 2)))
    assert turned[1] == pytest.approx([0.01, -0.01], rel=2e-3)


def test_what_was_measured_stays_and_what_is_lost_stays_lost() -> None:
    centre, plates = between_plates(1e-3)
    known = np.array([[0.1], [0.2], [0.3]])
    assert roll_unknown(np.array([R]), centre, known, np.ones((3, 1), bool), plates) is known
    lost = np.array([[True], [False], [True]])
    unknown = np.full((3, 1), np.nan)
    turned = roll_unknown(np.array([R]), centre, unknown, lost, plates)
    assert np.isnan(turned[1, 0])
    assert np.isfinite(turned[[0, 2], 0]).all()


def test_a_rod_that_touches_nothing_does_not_turn() -> None:
    centre = np.array([[[0.0, 0.0]], [[0.01, 0.0]]])
    turned = roll_unknown(np.array([R]), centre, np.full((2, 1), np.nan), np.ones((2, 1), bool), np.empty((2, 0, 2, 2)))
    assert np.array_equal(turned, np.zeros((2, 1)))
