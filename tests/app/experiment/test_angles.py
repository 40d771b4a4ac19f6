"""Angles given within one turn, as by atan2, are continued past its ends."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.experiment.experiment import unwrap_angles

TURN = 2.0 * np.pi


@pytest.fixture
def rotation():
    """Rotations (f, n) of rods that turn by up to 20° a photograph, with a rod that is not seen for some."""
    rng = np.random.default_rng(0)
    found = rng.uniform(0.0, TURN, 50) + np.cumsum(rng.uniform(-0.35, 0.35, (40, 50)), axis=0)
    found[5:9, 3] = np.nan
    found[:2, 7] = np.nan
    return found


@pytest.mark.parametrize("low", [0.0, -np.pi])
def test_a_jump_at_the_end_of_a_turn_is_removed(rotation, low):
    wrapped = (rotation - low) % TURN + low
    assert np.nanmax(np.abs(np.diff(wrapped, axis=0))) > 6.0  # there are such jumps
    found = unwrap_angles(wrapped)
    whole = (found - rotation) / TURN
    beside = whole - np.nanmedian(whole, axis=0)
    np.testing.assert_allclose(beside[np.isfinite(rotation)], 0.0, atol=1e-9)
    np.testing.assert_array_equal(np.isnan(found), np.isnan(rotation))


def test_continuous_angles_and_those_over_more_than_a_turn_stay(rotation):
    degrees = np.degrees(rotation)
    assert unwrap_angles(degrees) is degrees
    small = 0.05 * rotation
    np.testing.assert_array_equal(unwrap_angles(small), small)
    np.testing.assert_array_equal(unwrap_angles(np.full((3, 2), np.nan)), np.full((3, 2), np.nan))
