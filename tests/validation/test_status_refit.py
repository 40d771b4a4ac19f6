"""Trust, status and error bars of the default estimator on packings that were not used in their fits."""

from __future__ import annotations

import numpy as np
import pytest
from rich.console import Console
from rodsight.solver.assessment.trust import motion_assessment
from rodsight.solver.frame_forces import FrameStatus
from rodsight.study.report.status import refit_status
from rodsight.study.report.status_sample import StatusSample, observe_status
from rodsight.study.truths import WINDOW, simulate

GRAINS, SEEDS = 250, (31, 32)
NOISES = (0.0, 1e-5, 4e-5)
FAR_BELOW = 0.03  # fraction of valid frames with r < T − .03, as the trust claims
COVERED_ONCE, COVERED_TWICE = (0.6, 0.8), (0.9, 0.985)  # of one and two standard deviations
WRONG = 0.85  # r below which a frame should not have the status settled
UNDETECTED = 0.05  # greatest fraction of such frames with that status

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def sample(tmp_path_factory) -> StatusSample:
    folder = tmp_path_factory.mktemp("truths")
    return observe_status([simulate(seed, grains=GRAINS, folder=folder) for seed in SEEDS], NOISES)


def valid(sample: StatusSample) -> np.ndarray:
    return np.array([not fault for fault in sample.fault])


def test_trust_is_a_conservative_estimate_of_the_correlation(sample):
    t = np.array([motion_assessment(each).trust for each in sample.evidence])[valid(sample)]
    r = sample.r[valid(sample)]
    assert np.mean(r < t - 0.03) <= FAR_BELOW
    assert t.mean() > r.mean() - 0.1  # conservative, not useless


def test_standard_deviations_have_their_coverage(sample):
    for k in range(2):
        ratio = np.abs(sample.error[:, k]) / sample.stated[:, k]
        assert COVERED_ONCE[0] <= np.mean(ratio < 1.0) <= COVERED_ONCE[1]
        assert COVERED_TWICE[0] <= np.mean(ratio < 2.0) <= COVERED_TWICE[1]


def test_accurate_frames_are_mostly_settled_and_wrong_ones_are_not(sample):
    settled = np.array([each is FrameStatus.SETTLED for each in sample.status])
    late = valid(sample)
    assert settled[late].mean() > 0.5 * (WINDOW - 4) / (WINDOW - 1)
    wrong = sample.r < WRONG
    assert settled[wrong].sum() <= UNDETECTED * wrong.sum()


def test_constants_can_be_refitted_by_one_call(tmp_path):
    console = Console(record=True, width=160)
    fit = refit_status((33,), (34,), grains=(GRAINS,), folder=tmp_path, console=console, noises=(1e-5,))
    text = console.export_text()
    assert "motion_reliability.disagreement" in text
    assert "packings held out" in text
    assert all(value >= 0.0 for value in (*fit.disagreement, *fit.correction, *fit.normal, *fit.tangent))
