"""The geometry of constant errors, and how gaps are judged by it."""

from types import SimpleNamespace

import numpy as np
import pytest

from solver.calibration.calibrate import Calibration
from solver.calibration.equations import bulge, move_walls, rotate_offsets
from solver.calibration.gaps import MeasuredSequence
from solver.calibration.statistics import gap_statistics, width_gain


def sequence(position, rotation=None, present=None):
    """Two frames of grains between two walls whose ends are the corners of a square of side 0.2 m."""
    position = np.asarray(position, float)
    f, n = position.shape[:2]
    ends = np.array([[[-0.1, -0.1], [0.1, -0.1]], [[0.1, 0.1], [-0.1, 0.1]]])
    return MeasuredSequence(
        np.full(n, 0.01), position, np.zeros((f, n)) if rotation is None else rotation,
        np.ones((f, n), bool) if present is None else present, np.repeat(ends[None], f, axis=0), np.full((f, n), 1e-5),
    )  # fmt: skip


def test_distortion_grows_with_the_third_power_and_is_one_at_the_corner():
    place = np.array([[[0.1, 0.1], [0.05, 0.05], [0.0, 0.0], [-0.05, 0.0]]])
    found = bulge(sequence(place))[0]
    out = np.full(2, np.sqrt(0.5))
    assert found == pytest.approx(np.array([out, out / 8.0, [0.0, 0.0], [-(0.05**3) / 0.02**1.5, 0.0]]))


def test_offsets_turn_with_their_grains_from_where_they_were_first_seen():
    rotation = np.array([[0.3, 9.0], [0.3 + np.pi / 2, 0.2], [0.3 + np.pi, 0.2 + np.pi / 2]])
    present = np.array([[True, False], [True, True], [True, True]])
    found = rotate_offsets(sequence(np.zeros((3, 2, 2)), rotation, present), np.array([[1.0, 2.0], [0.0, 1.0]]))
    assert found[:, 0] == pytest.approx(np.array([[1.0, 2.0], [-2.0, 1.0], [-1.0, -2.0]]))
    assert found[:, 1] == pytest.approx(np.array([[0.0, 0.0], [0.0, 1.0], [-1.0, 0.0]]))


def test_walls_move_outward_and_turn_counter_clockwise_about_their_middles():
    floor = np.array([[[[0.0, 0.0], [2.0, 0.0]]]])  # the packing lies above
    assert move_walls(floor, np.array([0.1]), np.zeros(1))[0, 0] == pytest.approx(np.array([[0.0, -0.1], [2.0, -0.1]]))
    turned = move_walls(floor, np.zeros(1), np.array([0.01]))[0, 0]
    assert turned == pytest.approx(np.array([[0.0, -0.01], [2.0, 0.01]]))


def fit(gap_before, gap_after, noise=1e-5):
    count = len(gap_before)
    candidates = SimpleNamespace(between_grains=np.ones(count, bool), overlap=0.0, noise=np.full(count, noise))
    return SimpleNamespace(
        candidates=candidates, touching=np.ones(count, bool), gap_before=gap_before, gap_after=gap_after
    )


def test_only_overlaps_deeper_than_four_deviations_of_noise_are_impossible():
    gap = np.array([-1e-6, -2e-5, -3.9e-5, -4.1e-5, 5e-5])
    assert gap_statistics(gap, fit(gap, gap)).impossible == pytest.approx(1 / 4)


def test_the_gain_is_the_share_by_which_gaps_got_narrower():
    before = np.linspace(-3e-5, 3e-5, 99)
    assert width_gain(fit(before, 0.25 * before)) == pytest.approx(0.75)


def test_a_position_is_as_uncertain_as_its_noise_and_what_calibration_left():
    known = SimpleNamespace(noise_factor=1.5, gap_sd=4e-6)
    assert Calibration.position_sd(known, 1e-5) == pytest.approx(np.hypot(1.5e-5, 4e-6 / np.sqrt(2.0)))
