"""Forces on photoelastic discs beside their fringes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from rodsight.solver.assessment.fringe_pressures import compare_with_fringes
from rodsight.solver.frame_forces import FrameStatus
from rodsight.solver.statistics.balance import sum_on_grains

from tests.app.recording.fake_results import make_results, with_fringes


def test_fringes_that_follow_the_forces_leave_no_residual():
    found = with_fringes(make_results(4, 8, 7, sweeps=2)).fringes
    known = np.isfinite(found.measured)
    assert found.correlation[2] > 0.95
    assert np.abs(found.residual)[known].mean() < 0.15 * found.mean
    assert (np.diff(found.level) >= 0.0).all()


def test_fringes_of_other_discs_do_not_correlate_with_the_forces():
    results = with_fringes(make_results(4, 8, 7, sweeps=2))
    other = np.random.default_rng(1).permuted(results.tracks.fringes, axis=1)
    assert compare_with_fringes(other, results.tracks.present, results.frames).correlation[2] < 0.6


def test_a_frame_without_forces_and_discs_without_fringes_or_equilibrium_are_unknown():
    results = with_fringes(make_results(4, 8, 7, sweeps=2))
    frames = [replace(each, status=FrameStatus.FAILED) if each.frame == 1 else each for each in results.frames]
    fringes, used = results.tracks.fringes.copy(), results.tracks.present.copy()
    fringes[0, 3], used[:, 5] = np.nan, False
    found = compare_with_fringes(fringes, used, frames)
    assert np.isnan(found.inferred[1]).all()
    assert np.isnan(found.correlation[1])
    assert np.isnan(found.measured[0, 3])
    assert np.isnan(found.inferred[:, 5]).all()
    total = sum_on_grains(frames[0].contacts, frames[0].fn)
    assert found.inferred[0, 3] == total[3]
    assert compare_with_fringes(fringes[:1, :19], used[:1, :19], frames[:1]) is None
