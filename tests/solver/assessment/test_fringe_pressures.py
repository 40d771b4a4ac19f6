"""Pressures of discs by their fringes are those of the curve that the inferred forces of the run give."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.results.results import Results
from rodsight.solver.assessment.fringe_pressures import compare_with_fringes
from rodsight.solver.frame_forces import FrameStatus

from tests.app.recording.fake_results import make_results


def sums_of(results: Results) -> np.ndarray:
    """Sums of the normal forces on every disc (f, n) [N]."""
    total = np.zeros((results.tracks.frame_count, results.tracks.grain_count))
    for k, forces in enumerate(results.frames):
        for end in (forces.contacts.i, forces.contacts.j):
            total[k] += np.bincount(end, forces.fn, forces.contacts.body_count)[: results.tracks.grain_count]
    return total


@pytest.fixture(scope="module")
def results() -> Results:
    return make_results(3, 6, 5, sweeps=2)


def test_fringes_that_grow_with_the_forces_show_them(results) -> None:
    total = sums_of(results)
    fringes = total**0.5
    found = compare_with_fringes(fringes, np.ones(total.shape, np.bool_), results.frames)
    assert found is not None
    np.testing.assert_allclose(found.inferred, total)
    assert np.abs(found.residual).mean() < 0.05 * total.mean()  # the curve has 24 steps
    np.testing.assert_allclose(found.residual, np.interp(fringes, found.knot, found.level) - total)
    assert found.mean == pytest.approx(total.mean())
    assert (found.correlation > 0.95).all()


def test_failed_frames_and_discs_that_are_not_used_have_no_pressure(results) -> None:
    failed = [replace(results.frames[0], status=FrameStatus.FAILED), *results.frames[1:]]
    used = np.ones((3, results.tracks.grain_count), np.bool_)
    used[:, :4] = used[1, 9] = False
    fringes = sums_of(results) ** 0.5
    fringes[2, 12] = np.nan
    found = compare_with_fringes(fringes, used, failed)
    assert found is not None
    used[0] = False
    np.testing.assert_array_equal(np.isfinite(found.inferred), used)
    used[2, 12] = False
    np.testing.assert_array_equal(np.isfinite(found.measured), used)
    assert np.isfinite(found.correlation).tolist() == [False, True, True]
    assert found.mean == pytest.approx(np.nanmean(found.inferred))


def test_a_few_readings_give_no_curve_and_two_no_correlation(results) -> None:
    total = sums_of(results)
    used = np.ones(total.shape, np.bool_)
    fringes = np.full(total.shape, np.nan)
    fringes[1, :19] = total[1, :19]
    assert compare_with_fringes(fringes, used, results.frames) is None
    fringes[2, :2] = total[2, :2]
    found = compare_with_fringes(fringes, used, results.frames)
    assert found is not None
    assert np.isfinite(found.measured).sum() == 21
    assert np.isfinite(found.correlation).tolist() == [False, True, False]
