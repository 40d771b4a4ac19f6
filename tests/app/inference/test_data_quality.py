"""Quality of the data by the first photographs, in words."""

import math
from dataclasses import replace

import pytest
from rodsight.inference.diagnosis.data_quality import DataQuality
from rodsight.solver.part_settings import REFERENCE_STEP

GOOD = DataQuality(3, 1e-5, 1e-5, 1.2e-4, REFERENCE_STEP, 0.2, 0.1, -5e-6, 1.4e-5, 0.016)


def test_low_noise_and_sliding_are_described_without_an_obstacle():
    (line,) = GOOD.describe()
    assert "a noise of 10 µm, as given, and neighbours move by 120 µm in a step of 0.25° of shear" in line
    assert GOOD.obstacle == ""


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"noise": 1.2e-4}, "noise is 1.0 of the motion between neighbours; use a step 4 times as large"),
        ({"sliding": 0.001}, "almost nothing slides; use a step with more shear"),
        ({"gap_sd": 0.0125 * 0.016}, "gaps of touching grains have a standard deviation of 1.2 % of a diameter"),
    ],
)
def test_what_hides_the_forces_is_named_with_a_cure(change, reason):
    assert reason in replace(GOOD, **change).obstacle


def test_unknown_sliding_coarse_steps_and_a_wrong_stated_noise_are_reported():
    assert "an unknown fraction of the contacts" in replace(GOOD, sliding=math.nan).describe()[0]
    assert "(stated: 50 µm)" in replace(GOOD, stated_noise=5e-5).describe()[0]
    assert replace(GOOD, sliding=0.1).describe()[1].startswith("Too few slide to test the friction")
    assert len(replace(GOOD, sliding=0.11).describe()) == 1
    assert "steps of 0.25°" in replace(GOOD, shear=4 * REFERENCE_STEP).describe()[1]


def test_noise_that_tracking_estimates_is_not_called_given():
    tracked = replace(GOOD, noise=2.7e-5, stated_noise=2.7e-5, tracked_noise=8.6e-7)
    assert (
        "a noise of 27 µm, nearly all of which is one error of each centre in all photographs: motions have 0.86 µm, "
        "and neighbours move by 120 µm"
    ) in tracked.describe()[0]
    assert "a noise of 27 µm, by the correlation, and" in replace(tracked, tracked_noise=2e-5).describe()[0]
    assert "a noise of 50 µm (expected: 27 µm), by" in replace(tracked, noise=5e-5, tracked_noise=2e-5).describe()[0]


def test_a_common_error_of_radii_is_reported():
    apart = replace(GOOD, gap_offset=0.1 * 0.016)
    assert "mean gap of 1.6e+03 µm, 10 % of a diameter: all radii are 800 µm too small" in apart.describe()[1]
    assert len(replace(GOOD, gap_offset=0.01 * 0.016).describe()) == 1
