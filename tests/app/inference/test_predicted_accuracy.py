"""Accuracy predicted from the first photographs."""

import math
from dataclasses import replace

import pytest
from rodsight.inference.predicted_accuracy import REFERENCE_STEP, DataQuality

GOOD = DataQuality(3, 1e-5, 1e-5, 1.2e-4, REFERENCE_STEP, 0.2, 0.1, -5e-6, 1.4e-5, 0.016)


def test_low_noise_and_sliding_predict_accurate_forces_with_an_interval():
    r, low, high = GOOD.expected
    assert 0.95 < low < r < high < 1.0
    assert GOOD.suffices
    first, verdict = GOOD.describe()
    assert "a noise of 10 µm, and neighbours move by 120 µm in a step of 0.25° of shear" in first
    assert verdict == f"The motion determines the forces: expected r(f_n) {r:.2f} ({low:.2f} to {high:.2f})."


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"noise": 1.2e-4}, "noise is 1.0 of the motion between neighbours; use a step 4 times as large"),
        ({"sliding": 0.001}, "almost nothing slides; use a step with more shear"),
    ],
)
def test_insufficient_motion_is_reported_with_reason_and_cure(change, reason):
    poor = replace(GOOD, **change)
    assert not poor.suffices
    assert "does not determine the forces" in poor.describe()[1]
    assert reason in poor.describe()[1]


def test_expected_correlation_falls_with_noise_and_step():
    assert replace(GOOD, noise=4e-5).expected[0] < GOOD.expected[0]
    coarse = replace(GOOD, shear=4 * REFERENCE_STEP)
    assert coarse.expected[0] < GOOD.expected[0]
    assert "steps of 0.25°" in coarse.describe()[1]
    assert "radii or centres are wrong" in replace(GOOD, ambiguous=0.7).describe()[1]


def test_unknown_sliding_and_a_wrong_stated_noise_are_reported():
    assert "an unknown fraction of the contacts" in replace(GOOD, sliding=math.nan).describe()[0]
    assert "(stated: 50 µm)" in replace(GOOD, stated_noise=5e-5).describe()[0]


def test_a_large_standard_deviation_of_gaps_lowers_the_expected_correlation_whatever_the_motion():
    unclear = replace(GOOD, gap_sd=0.0125 * 0.016)
    assert not unclear.suffices
    assert unclear.expected[0] == pytest.approx(0.74, abs=0.01)
    assert "gaps of touching grains have a standard deviation of 1.2 % of a diameter" in unclear.describe()[1]
    assert replace(GOOD, gap_sd=0.05 * 0.016).expected[0] < 0.2


def test_a_common_error_of_radii_is_reported():
    apart = replace(GOOD, gap_offset=0.1 * 0.016)
    assert "mean gap of 1.6e+03 µm, 10 % of a diameter: all radii are 800 µm too small" in apart.describe()[1]
    assert len(replace(GOOD, gap_offset=0.01 * 0.016).describe()) == 2
