import math
from dataclasses import replace

import pytest
from rodsight.inference.data_budget import REFERENCE_STEP, DataBudget

GOOD = DataBudget(3, 1e-5, 1e-5, 1.2e-4, REFERENCE_STEP, 0.2, 0.1, -5e-6, 1.4e-5, 0.016)


def test_little_noise_and_sliding_promise_forces_with_an_interval():
    r, low, high = GOOD.expected
    assert 0.95 < low < r < high < 1.0
    assert GOOD.suffices
    first, verdict = GOOD.describe()
    assert "noise 10 µm against 120 µm that neighbours move in a step of 0.25° of shear" in first
    assert verdict == f"These data can carry forces from motion: expected r(f_n) {r:.2f} ({low:.2f} to {high:.2f})."


@pytest.mark.parametrize(
    ("change", "because"),
    [
        ({"noise": 1.2e-4}, "noise is 1.0 of what neighbours move; a step 4 times as large would"),
        ({"sliding": 0.001}, "next to nothing slides; a step with more shear would"),
    ],
)
def test_data_that_cannot_carry_forces_are_told_why_and_what_would(change, because):
    poor = replace(GOOD, **change)
    assert not poor.suffices
    assert "cannot carry forces" in poor.describe()[1]
    assert because in poor.describe()[1]


def test_more_noise_and_coarser_steps_promise_less():
    assert replace(GOOD, noise=4e-5).expected[0] < GOOD.expected[0]
    coarse = replace(GOOD, shear=4 * REFERENCE_STEP)
    assert coarse.expected[0] < GOOD.expected[0]
    assert "steps of 0.25°" in coarse.describe()[1]
    assert "radii or centres are wrong" in replace(GOOD, ambiguous=0.7).describe()[1]


def test_what_is_not_known_is_said_so_and_a_noise_that_was_told_wrong_is_named():
    assert "an unknown share of the contacts" in replace(GOOD, sliding=math.nan).describe()[0]
    assert "(told 50)" in replace(GOOD, noise_told=5e-5).describe()[0]


def test_gaps_that_scatter_by_a_per_cent_promise_little_whatever_the_motion():
    coarse = replace(GOOD, scatter=0.0125 * 0.016)
    assert not coarse.suffices
    assert coarse.expected[0] == pytest.approx(0.74, abs=0.01)
    assert "gaps of touching grains scatter by 1.2 % of a diameter" in coarse.describe()[1]
    assert replace(GOOD, scatter=0.05 * 0.016).expected[0] < 0.2


def test_radii_that_are_all_too_small_are_named():
    apart = replace(GOOD, apart=0.1 * 0.016)
    assert "stand 1.6e+03 µm apart, 10 % of a diameter: all radii look 800 µm too small" in apart.describe()[1]
    assert len(replace(GOOD, apart=0.01 * 0.016).describe()) == 2
