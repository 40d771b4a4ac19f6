"""Standard deviation of the scale of all forces."""

import math
from dataclasses import replace

import pytest
from rodsight.solver.assessment.intervals.scale_sd import LEAST, PER_LOAD, scale_sd

from ..test_penalties import ASSESSED


def test_a_field_that_does_not_carry_the_load_has_an_uncertain_scale():
    carried, half, twice = (scale_sd(replace(ASSESSED, load_fraction=q)) for q in (1.0, 0.5, 2.0))
    assert carried == pytest.approx(LEAST)
    assert half == twice == pytest.approx(math.hypot(LEAST, PER_LOAD * math.log(2.0)))


def test_without_a_stated_load_the_least_uncertainty_remains():
    assert scale_sd(replace(ASSESSED, load_fraction=math.nan)) == pytest.approx(LEAST)


def test_a_frame_that_is_not_assessed_has_no_scale():
    assert math.isnan(scale_sd(replace(ASSESSED, assessed=False)))
