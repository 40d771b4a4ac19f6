"""Fitted intervals cover the errors, whatever the formula's standard deviation."""

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.assessment.intervals.force_intervals import Group, Term
from rodsight.study.fitting.coverage import COVERED
from rodsight.study.scenarios.contact_errors import ContactErrors, measure_errors
from rodsight.study.scenarios.interval_coverage import TOLERANCE, covered, describe_violations, interval_score
from rodsight.study.scenarios.interval_fit import fit_intervals
from rodsight.study.scenarios.scenario_score import StudyPlan
from rodsight.study.scenarios.solved_scenario import solve_one

COUNT = 12_000


def _errors(rng: np.random.Generator) -> ContactErrors:
    """Make errors of twice the formula's sd in one group and half of it in others, growing with the penalty."""
    group = rng.integers(0, len(Group), COUNT).astype(np.uint8)
    penalty = rng.uniform(0.0, 0.4, COUNT)
    formula = rng.uniform(0.05, 0.5, (COUNT, 2))
    size = np.where(group == Group.WEAK, 2.0, 0.5) * np.exp(penalty)
    none = np.zeros(COUNT, np.bool_)
    return ContactErrors(
        scenario=np.where(np.arange(COUNT) % 2 == 0, "shear", "biaxial"), seed=np.zeros(COUNT, np.int64),
        frame=np.ones(COUNT, np.int64), group=group, wall=none, sliding=none, ambiguous=none,
        evidence_source=np.zeros(COUNT, np.uint8), terms=np.column_stack([penalty, *np.zeros((len(Term) - 1, COUNT))]),
        force=np.ones((COUNT, 2)),
        error=size[:, None] * formula * rng.standard_normal((COUNT, 2)), sd=formula, formula_sd=formula,
    )  # fmt: skip


@pytest.mark.thorough
def test_fitted_intervals_cover_in_every_group_on_errors_that_were_not_fitted():
    fit = fit_intervals(_errors(np.random.default_rng(1)))
    others = _errors(np.random.default_rng(2))
    fitted = replace(others, sd=fit.interval_sd(others))
    for group in (Group.WEAK, Group.MEAN):
        part = fitted.select(fitted.group == group)
        for one, two in (covered(part)[:2], covered(part)[2:]):
            assert one == pytest.approx(0.683, abs=0.04)
            assert two == pytest.approx(0.954, abs=0.02)
    assert covered(others.select(others.group == Group.WEAK))[0] < 0.4


@pytest.mark.thorough
def test_both_coverages_are_near_for_errors_with_heavy_tails():
    rng = np.random.default_rng(4)
    plain = _errors(rng)
    errors = replace(plain, error=0.3 * plain.formula_sd * rng.standard_t(3.5, (COUNT, 2)))
    fractions = covered(replace(errors, sd=fit_intervals(errors).interval_sd(errors)))
    for fraction, aimed, tolerance in zip(fractions, COVERED * 2, TOLERANCE * 2, strict=True):
        assert abs(fraction - aimed) < 1.1 * tolerance  # quantiles alone leave a larger error of the first


def test_the_score_is_least_for_the_narrowest_intervals_that_cover():
    error = np.random.default_rng(3).standard_normal(COUNT)
    scores = {width: interval_score(error, np.full(COUNT, width)) for width in (0.6, 0.98, 2.0)}
    assert min(scores, key=lambda width: scores[width]) == 0.98


def test_coverages_beyond_their_tolerance_are_named_with_their_sign():
    assert describe_violations((0.72, 0.94, 0.64, 0.97)) == ""
    assert describe_violations((0.74, 0.95, 0.68, 0.93)) == "f_n 68 +, f_t 95 −"


@pytest.mark.thorough  # a scenario solved twice
def test_ensemble_members_widen_intervals_and_never_narrow_them(tmp_path):
    solved = solve_one(StudyPlan(40, tmp_path), "shear", 1, members=1)
    alone, together = (measure_errors(solved, widened=widened) for widened in (False, True))
    assert (together.error == alone.error).all()
    assert (together.sd >= alone.sd).all()
    assert together.sd.mean() > 1.005 * alone.sd.mean()
