"""Geometry of constant errors, and statistics of gaps."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from rodsight.solver.calibration.calibrate import Calibration
from rodsight.solver.calibration.equations import move_walls, radial_distortion, rotate_offsets
from rodsight.solver.calibration.gap_statistics import gap_statistics, width_gain
from rodsight.solver.calibration.gaps import MeasuredSequence


def sequence(position, rotation=None, present=None):
    """Two frames of grains between two walls whose ends are the corners of a square of side 0.2 m."""
    position = np.asarray(position, float)
    f, n = position.shape[:2]
    ends = np.array([[[-0.1, -0.1], [0.1, -0.1]], [[0.1, 0.1], [-0.1, 0.1]]])
    return MeasuredSequence(
        np.full(n, 0.01), position, np.zeros((f, n)) if rotation is None else rotation,
        np.ones((f, n), bool) if present is None else present, np.repeat(ends[None], f, axis=0), np.full((f, n), 1e-5),
    )  # fmt: skip


def test_radial_distortion_is_cubic_and_one_at_the_corner():
    place = np.array([[[0.1, 0.1], [0.05, 0.05], [0.0, 0.0], [-0.05, 0.0], [-0.1, -0.1]]])
    found = radial_distortion(sequence(place))[0]
    out = np.full(2, np.sqrt(0.5))
    assert found == pytest.approx(np.array([out, out / 8.0, [0.0, 0.0], [-(0.05**3) / 0.02**1.5, 0.0], -out]))


def test_walls_far_longer_than_the_packing_do_not_move_the_middle_of_the_lens():
    place = np.array([[[0.1, 0.1], [0.05, 0.05], [-0.1, -0.1]]])
    given = sequence(place)
    longer = replace(given, endpoints=given.endpoints + np.array([0.0, 3.0]) * (given.endpoints[..., 1:] > 0.0))
    assert radial_distortion(longer) == pytest.approx(radial_distortion(given))


def test_offsets_rotate_with_their_grains_from_their_first_frame():
    rotation = np.array([[0.3, 9.0], [0.3 + np.pi / 2, 0.2], [0.3 + np.pi, 0.2 + np.pi / 2]])
    present = np.array([[True, False], [True, True], [True, True]])
    found = rotate_offsets(sequence(np.zeros((3, 2, 2)), rotation, present), np.array([[1.0, 2.0], [0.0, 1.0]]))
    assert found[:, 0] == pytest.approx(np.array([[1.0, 2.0], [-2.0, 1.0], [-1.0, -2.0]]))
    assert found[:, 1] == pytest.approx(np.array([[0.0, 0.0], [0.0, 1.0], [-1.0, 0.0]]))


def test_walls_move_outward_and_rotate_counter_clockwise_about_their_middles():
    floor = np.array([[[[0.0, 0.0], [2.0, 0.0]]]])  # the packing lies above
    assert move_walls(floor, np.array([0.1]), np.zeros(1))[0, 0] == pytest.approx(np.array([[0.0, -0.1], [2.0, -0.1]]))
    rotated = move_walls(floor, np.zeros(1), np.array([0.01]))[0, 0]
    assert rotated == pytest.approx(np.array([[0.0, -0.01], [2.0, 0.01]]))


def fit(gap_before, gap_after, noise=1e-5):
    count = len(gap_before)
    candidates = SimpleNamespace(between_grains=np.ones(count, bool), overlap=0.0, noise=np.full(count, noise))
    return SimpleNamespace(
        candidates=candidates, touching=np.ones(count, bool), gap_before=gap_before, gap_after=gap_after
    )


def test_only_overlaps_deeper_than_four_standard_deviations_are_impossible():
    gap = np.array([-1e-6, -2e-5, -3.9e-5, -4.1e-5, 5e-5])
    assert gap_statistics(gap, fit(gap, gap)).impossible == pytest.approx(1 / 4)


def test_gain_is_the_relative_narrowing_of_the_gaps():
    before = np.linspace(-3e-5, 3e-5, 99)
    assert width_gain(fit(before, 0.25 * before)) == pytest.approx(0.75)


def test_position_sd_combines_noise_and_remaining_errors():
    known = SimpleNamespace(noise_factor=1.5, gap_sd=4e-6)
    assert Calibration.position_sd(known, 1e-5) == pytest.approx(np.hypot(1.5e-5, 4e-6 / np.sqrt(2.0)))
