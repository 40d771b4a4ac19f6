"""The standard deviation of the scale is fitted on errors, and covers those of kinds that the fit has not read."""

import numpy as np
import pytest
from rodsight.study.fitting.scale_fit import MOST, ScaleSample, describe_scale, fit_first, fit_scale, scale_sd_of

LEAST = 0.01


def sample(kinds=12, frames=200, factors=(0.5, 0.0, 2.0)):
    """Frames whose errors have a standard deviation by known factors of random terms."""
    rng = np.random.default_rng(3)
    terms = rng.uniform(0.0, 0.2, (kinds * frames, 3))
    sd = scale_sd_of(terms, np.array(factors), LEAST)
    return ScaleSample(np.repeat([f"kind {k}" for k in range(kinds)], frames), terms, np.abs(rng.normal(0.0, sd)))


def test_factors_are_recovered_and_two_standard_deviations_cover_what_is_aimed_at():
    made = sample()
    found = fit_scale(made, LEAST, np.full(3, 0.3))
    wider = 2.17 / 2.0  # two standard deviations of a Gaussian that contain 97 %
    assert found == pytest.approx([0.5 * wider, 0.0, 2.0 * wider], abs=0.15)
    one, two = made.coverage(scale_sd_of(made.terms, found, LEAST))
    assert two == pytest.approx(0.97, abs=0.005)
    assert 0.68 < one < 0.76


def test_every_kind_counts_the_same():
    made = sample(kinds=2)
    one_kind = made.kind == "kind 0"
    uneven = ScaleSample(made.kind, made.terms, np.where(one_kind, 0.0, 1.0)).select(
        one_kind | (np.arange(len(one_kind)) % 10 == 0)
    )
    assert uneven.coverage(np.full(len(uneven.error), 0.1)) == pytest.approx((0.5, 0.5))


def test_first_frames_get_the_least_factor_that_covers_them():
    rng = np.random.default_rng(4)
    own, second = np.full(4000, 0.15), rng.uniform(0.05, 0.4, 4000)
    error = np.abs(rng.normal(0.0, np.hypot(own, 1.8 * second)))
    made = ScaleSample(np.repeat("kind", 4000), np.stack([own, second], axis=1), error)
    assert fit_first(made) == 2.0
    assert fit_first(ScaleSample(made.kind, made.terms, 100.0 * error)) == MOST
    assert fit_first(ScaleSample(made.kind, made.terms, 0.0 * error)) == 0.0


@pytest.mark.thorough
def test_the_table_names_factors_and_the_coverage_of_kinds_left_out():
    lines = describe_scale(sample(), dict.fromkeys(("per_load", "per_correction", "per_error"), 0.3), LEAST)
    assert lines[0] == "[scale_sd]"
    assert [line.split(" = ")[0] for line in lines[2:]] == ["least", "per_load", "per_correction", "per_error"]
    assert "% lie within one and two standard deviations" in lines[1]
