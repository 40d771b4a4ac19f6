"""Intervals are fitted so that they cover, whatever the formula said."""

from dataclasses import replace

import numpy as np
import pytest
from rodsight.study.worlds.contact_errors import ContactErrors, measure_errors
from rodsight.study.worlds.interval_fit import fit_intervals
from rodsight.study.worlds.intervals import COVERED, TOLERANCE, covered, interval_score, tell_misses
from rodsight.study.worlds.solved_world import solve_one
from rodsight.study.worlds.world_score import WorldPlan

from solver.sequence.judging.intervals import Group, Term

COUNT = 12_000


def _errors(rng: np.random.Generator) -> ContactErrors:
    """Errors that are twice the formula's deviation in one group and half of it in the others, more in doubt."""
    group = rng.integers(0, len(Group), COUNT).astype(np.uint8)
    doubt = rng.uniform(0.0, 0.4, COUNT)
    formula = rng.uniform(0.05, 0.5, (COUNT, 2))
    size = np.where(group == Group.WEAK, 2.0, 0.5) * np.exp(doubt)
    no = np.zeros(COUNT, np.bool_)
    return ContactErrors(
        world=np.where(np.arange(COUNT) % 2 == 0, "shear", "biaxial"), seed=np.zeros(COUNT, np.int64),
        frame=np.ones(COUNT, np.int64), group=group, wall=no, sliding=no, doubtful=no,
        witness=np.zeros(COUNT, np.uint8), terms=np.column_stack([doubt, *np.zeros((len(Term) - 1, COUNT))]),
        force=np.ones((COUNT, 2)),
        error=size[:, None] * formula * rng.standard_normal((COUNT, 2)), deviation=formula, formula=formula,
    )  # fmt: skip


def test_fitted_intervals_cover_in_every_group_on_errors_that_were_not_fitted():
    fit = fit_intervals(_errors(np.random.default_rng(1)))
    others = _errors(np.random.default_rng(2))
    told = replace(others, deviation=fit.deviations(others))
    for group in (Group.WEAK, Group.MEAN):
        part = told.select(told.group == group)
        for one, two in (covered(part)[:2], covered(part)[2:]):
            assert one == pytest.approx(0.683, abs=0.04)
            assert two == pytest.approx(0.954, abs=0.02)
    assert covered(others.select(others.group == Group.WEAK))[0] < 0.4


def test_neither_share_is_far_off_where_errors_have_heavy_tails():
    rng = np.random.default_rng(4)
    plain = _errors(rng)
    errors = replace(plain, error=0.3 * plain.formula * rng.standard_t(3.5, (COUNT, 2)))
    shares = covered(replace(errors, deviation=fit_intervals(errors).deviations(errors)))
    for share, aimed, tolerance in zip(shares, COVERED * 2, TOLERANCE * 2, strict=True):
        assert abs(share - aimed) < 1.1 * tolerance  # quantiles alone leave the first off by more


def test_the_score_is_least_for_the_narrowest_intervals_that_cover():
    error = np.random.default_rng(3).standard_normal(COUNT)
    scores = {width: interval_score(error, np.full(COUNT, width)) for width in (0.6, 0.98, 2.0)}
    assert min(scores, key=lambda width: scores[width]) == 0.98


def test_what_is_beyond_its_tolerance_is_told_with_its_side():
    assert tell_misses((0.72, 0.94, 0.64, 0.97)) == ""
    assert tell_misses((0.74, 0.95, 0.68, 0.93)) == "f_n 68 +, f_t 95 −"


@pytest.mark.screen  # a world of its own, solved twice
def test_members_widen_what_is_stated_and_never_narrow_it(tmp_path):
    solved = solve_one(WorldPlan(40, tmp_path), "shear", 1, members=1)
    alone, together = (measure_errors(solved, widened=widened) for widened in (False, True))
    assert (together.error == alone.error).all()
    assert (together.deviation >= alone.deviation).all()
    assert together.deviation.mean() > 1.005 * alone.deviation.mean()
