"""Standard deviation of the scale of all forces."""

import math
from dataclasses import replace

import pytest
from rodsight.solver.assessment.expected_correlation import expect_correlation
from rodsight.solver.assessment.intervals.force_intervals import FIRST_SCALE
from rodsight.solver.assessment.intervals.scale_sd import TABLE, scale_sd

from ..test_penalties import ASSESSED

CARRIED = replace(ASSESSED, load_fraction=1.0)


@pytest.mark.parametrize(("load_fraction", "mismatch"), [(1.0, 0.0), (0.5, math.log(2.0)), (math.nan, 0.0)])
def test_the_terms_add_in_squares(load_fraction, mismatch):
    evidence = replace(ASSESSED, correction=0.3, power_gap=0.5, inertial_number=0.01, load_fraction=load_fraction)
    evidence = replace(evidence, boundary_reaction=0.02)
    r = expect_correlation(evidence)
    expected = math.hypot(
        TABLE["least"], TABLE["per_load"] * mismatch, 0.3 * TABLE["per_correction"], 0.5 * TABLE["per_power_gap"],
        TABLE["per_error"] * (1.0 - r) / (1.0 + r), 0.01 * TABLE["per_inertia"], 0.02 * TABLE["per_reaction"],
    )  # fmt: skip
    assert scale_sd(evidence) == pytest.approx(expected)


def test_a_field_that_does_not_carry_the_load_has_an_uncertain_scale():
    carried, half, twice = (scale_sd(replace(ASSESSED, load_fraction=q)) for q in (1.0, 0.5, 2.0))
    assert half == twice > 1.1 * carried


@pytest.mark.parametrize(
    "worse", [{"correction": 1.0}, {"power_gap": 0.8}, {"disagreement": 0.9}, {"inertial_number": 0.02}]
)
def test_what_contradicts_the_forces_makes_their_scale_uncertain(worse):
    assert scale_sd(replace(CARRIED, **worse)) > scale_sd(replace(CARRIED, correction=0.05, power_gap=0.02))


def test_members_that_disagree_on_the_scale_make_it_uncertain():
    """Known only where the weight sets the scale, to which a wall may add any force."""
    known = scale_sd(ASSESSED)
    assert scale_sd(replace(ASSESSED, scale_disagreement=1.2)) == pytest.approx(math.hypot(known, 1.2))
    assert scale_sd(replace(ASSESSED, scale_disagreement=0.0)) == known


def test_the_scale_of_the_first_frame_has_the_error_that_its_forces_share():
    first = replace(ASSESSED, assessed=False)
    assert math.isnan(scale_sd(first))
    assert scale_sd(replace(first, mixed_trust=0.9)) == FIRST_SCALE > scale_sd(ASSESSED)
    disputed = replace(first, mixed_trust=0.9, scale_disagreement=2.0 * FIRST_SCALE)
    assert scale_sd(disputed) == pytest.approx(5.0**0.5 * FIRST_SCALE)
