"""Trust, status and error bars of the default estimator on packings that their constants have not seen."""

from __future__ import annotations

import numpy as np
import pytest
from rich.console import Console
from rodsight.study.report.status import WINDOW, StatusSample, observe_status, refit_status
from rodsight.study.truths import simulate

from solver.sequence.frame_forces import FrameStatus
from solver.sequence.judging.judgement import trust

GRAINS, SEEDS = 250, (31, 32)
NOISES = (0.0, 1e-5, 4e-5)
OVERTRUSTED, GROSSLY = 0.12, 0.03  # share of sound frames with r < T, r < T − .03; fitted for .06 and less than .01
COVERED_ONCE, COVERED_TWICE = (0.6, 0.8), (0.9, 0.985)  # of one and two standard deviations
WRONG = 0.85  # r below which a frame should not pass as settled
UNNOTICED = 0.05  # share of such frames that may

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def sample(tmp_path_factory) -> StatusSample:
    folder = tmp_path_factory.mktemp("truths")
    return observe_status([simulate(seed, grains=GRAINS, folder=folder) for seed in SEEDS], NOISES)


def sound(sample: StatusSample) -> np.ndarray:
    return np.array([not fault for fault in sample.fault])


def test_trust_is_a_conservative_estimate_of_the_correlation(sample):
    t = np.array([trust(each) for each in sample.evidence])[sound(sample)]
    r = sample.r[sound(sample)]
    assert np.mean(r < t) <= OVERTRUSTED
    assert np.mean(r < t - 0.03) <= GROSSLY
    assert t.mean() > r.mean() - 0.06  # conservative, not useless


def test_standard_deviations_cover_what_they_promise(sample):
    for k in range(2):
        ratio = np.abs(sample.error[:, k]) / sample.stated[:, k]
        assert COVERED_ONCE[0] <= np.mean(ratio < 1.0) <= COVERED_ONCE[1]
        assert COVERED_TWICE[0] <= np.mean(ratio < 2.0) <= COVERED_TWICE[1]


def test_sound_frames_are_mostly_settled_and_wrong_ones_are_not(sample):
    settled = np.array([each is FrameStatus.SETTLED for each in sample.status])
    late = sound(sample)
    assert settled[late].mean() > 0.5 * (WINDOW - 4) / (WINDOW - 1)
    assert settled[sample.r < WRONG].mean() <= UNNOTICED


def test_the_constants_can_be_fitted_anew_by_one_call(tmp_path):
    console = Console(record=True, width=160)
    fit = refit_status((33,), (34,), grains=(GRAINS,), folder=tmp_path, console=console, noises=(1e-5,))
    text = console.export_text()
    assert "TRUST_DISAGREEMENT" in text
    assert "packings held out" in text
    assert all(value >= 0.0 for value in (*fit.disagreement, *fit.correction, *fit.normal, *fit.tangent))
