"""Rules by which fits are accepted, replaced and flagged."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.tracking.correlation import kernels
from rodsight.tracks import TrackStatus

from tests.app.tracking.registration.registered import CONTRAST, PIXELS, fits_of, grid, patches_at, results_at

ROWS = np.arange(4)
POSE = np.column_stack([grid(2, 2) + 3.0, np.full(4, 0.1)])
NOISE = 1.0  # [grey]


def test_fits_are_accepted_above_every_accidental_zncc_and_when_converged() -> None:
    results = results_at(grid(2, 2), accidental_zncc=0.5)
    results.accept(ROWS, fits_of(POSE, [0.64, 0.66, 0.9, 0.9], code=kernels.CONVERGED), TrackStatus.OK)
    assert results.accepted.tolist() == [False, True, True, True]
    assert results.pose[1:] == pytest.approx(POSE[1:])
    diverged = results_at(grid(2, 2))
    diverged.accept(ROWS, fits_of(POSE, [0.9] * 4, code=kernels.DIVERGED), TrackStatus.OK)
    assert not diverged.accepted.any()


def test_only_a_better_fit_replaces_an_accepted_one() -> None:
    results = results_at(grid(2, 2))
    results.accept(ROWS, fits_of(POSE, [0.8] * 4), TrackStatus.OK)
    results.accept(ROWS, fits_of(POSE + 1.0, [0.7, 0.79, 0.81, 0.9]), TrackStatus.RESCUED)
    ok, rescued = TrackStatus.OK, TrackStatus.RESCUED
    assert results.status.tolist() == [ok, ok, rescued, rescued]
    assert results.pose[:, 0] == pytest.approx(POSE[:, 0] + [0.0, 0.0, 1.0, 1.0])
    results.accept_robust(patches_at(grid(2, 2)), ROWS, fits_of(POSE + 2.0, [0.96] * 4), NOISE)
    results.accept_robust(patches_at(grid(2, 2)), ROWS, fits_of(POSE + 3.0, [0.955] * 4), NOISE)
    assert results.pose[:, 0] == pytest.approx(POSE[:, 0] + 2.0)
    assert (results.status == TrackStatus.ROBUST).all()


@pytest.mark.parametrize(("kept", "zncc", "accepted"), [(0.39, 0.99, False), (0.41, 0.99, True), (0.41, 0.94, False)])
def test_a_robust_fit_needs_enough_of_the_patch_and_a_high_zncc(kept: float, zncc: float, accepted: bool) -> None:
    results = results_at(grid(2, 2))
    results.accept_robust(patches_at(grid(2, 2)), ROWS, fits_of(POSE, [zncc] * 4, kept=kept), NOISE)
    assert results.accepted.all() == accepted


def test_a_robust_fit_of_a_small_part_needs_a_higher_zncc() -> None:
    # The accepted ZNCC of 0.65, over the root of the fraction used, exceeds the floor of 0.8 at this noise.
    noisy = 10.0
    for kept, accepted in ((1.0, True), (0.5, False)):
        results = results_at(grid(2, 2), accidental_zncc=0.5)
        results.accept_robust(patches_at(grid(2, 2)), ROWS, fits_of(POSE, [0.85] * 4, kept=kept), noisy)
        assert results.accepted.all() == accepted


def test_residuals_are_poor_above_four_times_the_typical_one() -> None:
    results = results_at(grid(2, 2))
    fits = fits_of(POSE, [0.9] * 4, residual=4.0)
    fits.residual[:] = [4.0, 4.0, 15.0, 17.0]
    results.accept(ROWS, fits, TrackStatus.OK)
    # The median of 9.5 grey² is typical, so that 38 are explained.
    assert results.flag_poor(NOISE) == pytest.approx(np.sqrt(9.5))
    assert not results.poor.any()
    results.residual[3] = 39.0
    results.flag_poor(NOISE)
    assert results.poor.tolist() == [False, False, False, True]


def test_the_explained_residual_is_limited_by_the_contrast() -> None:
    results = results_at(grid(2, 2))
    limit = (0.15 * CONTRAST) ** 2  # [grey²]
    results.accept(ROWS, fits_of(POSE, [0.9] * 4, residual=4.1 * limit), TrackStatus.OK)
    assert results.flag_poor(NOISE) == pytest.approx(np.sqrt(limit))
    assert results.poor.all()


def test_without_fits_a_clean_residual_is_the_noise_of_two_photographs() -> None:
    assert results_at(grid(2, 2)).flag_poor(3.0) == pytest.approx(3.0 * np.sqrt(2.0))


def test_given_poses_are_kept_and_never_suspect() -> None:
    results = results_at(grid(2, 2))
    results.accept(ROWS, fits_of(POSE, [0.9] * 4), TrackStatus.OK)
    results.set_given(ROWS[:1], POSE[:1] + 5.0, 1.0)
    results.mark_suspect(ROWS[:2])
    suspect = TrackStatus.SUSPECT
    assert results.status.tolist() == [TrackStatus.GIVEN, suspect, TrackStatus.OK, TrackStatus.OK]
    assert results.pose[0] == pytest.approx(POSE[0] + 5.0)
    assert results.sigma[0] == 1.0
    assert np.isnan(results.zncc[0])


def test_missing_grains_are_predicted_by_the_others() -> None:
    last = np.column_stack([grid(5, 5), np.linspace(0.0, 1.0, 25)])
    results = results_at(grid(5, 5))
    found = np.delete(np.arange(25), [12, 20])
    moved = last[found] + [6.0, -2.0, 0.3]
    results.accept(found, fits_of(moved, [0.9] * 23), TrackStatus.OK)
    results.exclude(np.array([20]))
    assert results.predict_from_neighbours(last).tolist() == [12]
    assert results.predicted[12] == pytest.approx([last[12, 0] + 6.0, last[12, 1] - 2.0, last[12, 2]])


def test_light_is_that_of_the_clean_grains_nearby() -> None:
    patches, results = patches_at(grid(2, 2)), results_at(grid(2, 2))
    gain, offset = results.local_light(patches, ROWS, POSE)
    assert (gain[0], offset[0]) == (CONTRAST * np.sqrt(PIXELS), 100.0)
    results.accept(ROWS[:3], fits_of(POSE[:3], [0.9] * 3), TrackStatus.OK)
    results.gain[1:3], results.poor[1:3] = 1.0, True
    gain, offset = results.local_light(patches, ROWS[3:], POSE[3:])
    # The gain of the clean ones is twice the reference's, their offset 150 at a mean of 100.
    assert gain[0] == pytest.approx(2.0 * CONTRAST * np.sqrt(PIXELS))
    assert offset[0] == pytest.approx(150.0)


def test_a_given_pose_without_light_does_not_enter_the_light_of_others() -> None:
    patches, results = patches_at(grid(2, 2)), results_at(grid(2, 2))
    results.accept(ROWS[:3], fits_of(POSE[:3], [0.9] * 3), TrackStatus.OK)
    expected = results.local_light(patches, ROWS[3:], POSE[3:])
    results.status[0] = TrackStatus.GIVEN
    results.gain[0] = results.offset[0] = np.nan
    np.testing.assert_array_equal(results.local_light(patches, ROWS[3:], POSE[3:]), expected)
