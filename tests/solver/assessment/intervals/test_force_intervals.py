"""Calibrated standard deviations of forces: groups of contacts, terms of the frame, wrong friction."""

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.assessment.intervals.force_intervals import (
    FIRST_SCALE,
    FLOOR,
    HIGH_FRICTION,
    MIN_FRICTION,
    SLOPE,
    USUAL_CHANGE,
    EvidenceSource,
    Group,
    Term,
    calibrate_sd,
    correlation_by_intervals,
    evidence_source_of,
    formula_sd_of,
    groups_of,
    interval_factors,
    relative_friction,
    source_of_frame,
    terms_of,
    usual_trust,
    widen_for_friction,
    widen_scale,
)

from tests.app.recording.fake_results import make_results


@pytest.fixture(scope="module")
def frame():
    one = make_results(1, 8, 7, sweeps=2).frames[0]
    c = one.contacts.count
    fn = np.linspace(0.0, 2.0, c) * 30.0
    return replace(
        one, frame=3, fn=fn, fn_sd=0.1 * fn, ft_sd=0.03 * fn, trust=0.9, position_weight=0.0,
        expected_correlation=np.nan,
        bearing_probability=np.where(np.arange(c) % 7 == 0, 0.5, 1.0), sliding_probability=np.zeros(c),
    )  # fmt: skip


def test_the_last_group_that_applies_is_assigned(frame):
    group = groups_of(frame)
    wall, uncertain = frame.contacts.with_wall, frame.bearing_probability < 0.9
    mean = frame.fn[frame.fn > 0].mean()
    assert (group[uncertain] == Group.UNCERTAIN).all()
    assert (group[wall & ~uncertain] == Group.WALL).all()
    plain = ~wall & ~uncertain
    assert (group[plain & (frame.fn < 0.49 * mean)] == Group.WEAK).all()
    assert (group[plain & (frame.fn > 1.51 * mean)] == Group.STRONG).all()
    assert {Group.WEAK, Group.MEAN, Group.STRONG, Group.WALL, Group.UNCERTAIN} == set(group.tolist())
    slides = replace(frame, sliding_probability=np.ones(len(frame.fn)))
    assert (groups_of(slides)[plain] == Group.SLIDING).all()


def test_the_evidence_source_follows_the_position_weight():
    assert [evidence_source_of(weight) for weight in (0.0, 0.5, 1.0)] == [
        EvidenceSource.MOTION,
        EvidenceSource.BOTH,
        EvidenceSource.POSITIONS,
    ]


def test_soft_grains_are_a_separate_source_whose_intervals_widen_with_the_penalty(frame):
    soft = replace(frame, soft=1, position_weight=0.7)
    assert source_of_frame(soft) == EvidenceSource.SOFT
    assert source_of_frame(replace(soft, frame=0)) == EvidenceSource.SOFT_FIRST
    sure, penalised = (interval_factors(replace(soft, trust=trust)) for trust in (0.98, 0.93))
    assert (penalised[:, 0] > 1.2 * sure[:, 0]).all()  # of f_t the fit found no effect
    assert (penalised >= sure).all()


def test_the_formula_sd_is_recovered_from_the_calibrated_one(frame):
    calibrated = calibrate_sd(frame)
    recovered = formula_sd_of(calibrated)
    mean = frame.fn[frame.fn > 0].mean()
    known = frame.fn_sd > 0
    formula, force = (np.column_stack(each) / mean for each in ((frame.fn_sd, frame.ft_sd), (frame.fn, frame.ft)))
    unloaded = 1.0 - frame.bearing_probability[:, None]
    expected = np.sqrt(formula**2 + FLOOR**2 + unloaded * force**2)
    assert recovered[known] == pytest.approx(expected[known])
    assert (calibrated.fn_sd[~known] == 0).all()


def test_a_penalty_widens_the_intervals_of_motion(frame):
    sure, penalised = (calibrate_sd(replace(frame, trust=trust)).fn_sd[-1] for trust in (0.95, 0.7))
    assert penalised > 1.1 * sure


def test_new_forces_widen_intervals_of_mixtures_slightly_beyond_what_the_trust_does(frame):
    for weight, most in ((0.5, 1.25), (0.0, 1.0)):
        same, new = (
            calibrate_sd(replace(frame, position_weight=weight, force_change=change)).fn_sd[-1]
            for change in (0.02, 0.3)
        )
        assert same <= new <= most * same
    unknown, usual = (interval_factors(replace(frame, position_weight=0.5, force_change=change))
                      for change in (np.nan, USUAL_CHANGE))  # fmt: skip
    assert unknown == pytest.approx(usual)


def test_intervals_of_motion_widen_with_the_number_of_contacts(frame):
    half = np.arange(len(frame.fn)) % 2 == 0
    fewer = replace(frame, fn=np.where(half, 0.0, frame.fn))
    difference = terms_of(frame)[Term.SIZE] - terms_of(fewer)[Term.SIZE]
    assert difference == pytest.approx(np.log((frame.fn > 0).sum() / (fewer.fn > 0).sum()))
    assert SLOPE[EvidenceSource.MOTION, Term.SIZE, 0] > 0.0
    assert np.isfinite(terms_of(replace(frame, fn=0.0 * frame.fn))[Term.SIZE])


def test_intervals_follow_the_expectation_by_the_usual_margin_not_the_bound(frame):
    expected = replace(frame, expected_correlation=0.98)
    assert usual_trust(expected) == pytest.approx(np.tanh(np.arctanh(0.98) - 0.677))
    assert usual_trust(replace(expected, soft=1)) < usual_trust(expected)
    humble = replace(expected, trust=0.5)
    assert interval_factors(humble) == pytest.approx(interval_factors(expected))
    worse = replace(expected, expected_correlation=0.97)
    assert (interval_factors(worse) > interval_factors(expected)).all()
    assert usual_trust(replace(frame, expected_correlation=0.9)) == 0.9  # one number for both: a single chain
    assert usual_trust(replace(frame, expected_correlation=1.0)) <= 1.0


def test_unseen_rods_lower_the_trust_but_do_not_widen_the_intervals_of_reported_forces(frame):
    whole = replace(frame, trust=0.96)
    hidden = replace(frame, trust=0.96 * 0.9, unseen_penalty=0.1)
    assert interval_factors(hidden) == pytest.approx(interval_factors(whole))
    assert (interval_factors(replace(frame, trust=0.96 * 0.9)) > 1.2 * interval_factors(whole)).all()
    assert terms_of(replace(hidden, unseen_penalty=1.0))[Term.PENALTY] == 0.0  # the whole trust: no division by zero


def test_penalties_beyond_the_range_of_the_fit_do_not_widen_the_intervals_of_motion(frame):
    trusts = (0.9, 0.6)
    one, other = (calibrate_sd(replace(frame, trust=trust)) for trust in trusts)
    assert other.fn_sd == pytest.approx(one.fn_sd)


def test_uncertain_contacts_and_the_first_frame_have_errors_proportional_to_the_force(frame):
    sure = replace(frame, bearing_probability=np.ones(len(frame.fn)))
    uncertain = replace(frame, bearing_probability=np.full(len(frame.fn), 0.95))  # the same group
    mean = frame.fn[frame.fn > 0].mean()
    before, after = (formula_sd_of(calibrate_sd(each))[-1, 0] for each in (sure, uncertain))
    assert after**2 - before**2 == pytest.approx(0.05 * (frame.fn[-1] / mean) ** 2)
    first = formula_sd_of(calibrate_sd(replace(sure, frame=0)))[-1, 0]
    assert first**2 - before**2 == pytest.approx((FIRST_SCALE * frame.fn[-1] / mean) ** 2)


def test_the_scale_of_the_first_frame_counts_once(frame):
    first = calibrate_sd(replace(frame, frame=0))
    same, twice = (
        calibrate_sd(replace(frame, frame=0, scale_sd=each)) for each in (FIRST_SCALE, 5.0**0.5 * FIRST_SCALE)
    )
    assert same.fn_sd == pytest.approx(first.fn_sd)
    assert twice.fn_sd**2 - first.fn_sd**2 == pytest.approx((2.0 * FIRST_SCALE * frame.fn) ** 2)


def test_a_further_error_of_the_scale_widens_the_intervals_as_if_it_had_been_known(frame):
    first = replace(frame, frame=0, scale_sd=2.0 * FIRST_SCALE)
    later = widen_scale(calibrate_sd(first), FIRST_SCALE)
    before = calibrate_sd(replace(first, scale_sd=5.0**0.5 * FIRST_SCALE))
    assert later.scale_sd == pytest.approx(before.scale_sd)
    assert later.fn_sd == pytest.approx(before.fn_sd)
    assert later.ft_sd == pytest.approx(before.ft_sd)
    certain = replace(first, fn_sd=np.zeros(len(first.fn)))
    assert not widen_scale(certain, 1.0).fn_sd.any()
    soft = replace(calibrate_sd(first), soft=True)
    assert widen_scale(soft, 1.0).fn_sd == pytest.approx(soft.fn_sd)  # fitted with their scale


def test_intervals_of_the_first_frame_widen_with_its_friction(frame):
    first = replace(frame, frame=0)
    assert (source_of_frame(first), source_of_frame(frame)) == (EvidenceSource.FIRST, EvidenceSource.MOTION)
    little, much = (interval_factors(replace(first, ft=ratio * first.fn))[-1] for ratio in (0.02, 0.1))
    ratio = (0.1 + MIN_FRICTION) / (0.02 + MIN_FRICTION)
    assert much / little == pytest.approx(ratio ** SLOPE[EvidenceSource.FIRST, Term.FRICTION])
    assert relative_friction(frame) == 1.0


def test_a_wrong_friction_widens_by_fractions_of_the_force_and_of_the_mean(frame):
    widened = widen_for_friction(frame, 0.2, 0.26)
    mean = frame.fn[frame.fn > 0].mean()
    added = np.sqrt(widened.fn_sd**2 - frame.fn_sd**2) / np.log(1.3)
    assert added[-1] == pytest.approx(np.hypot(0.5 * frame.fn[-1], 0.4 * mean))
    assert added[1] > 0.4 * mean
    assert added[0] == 0.0  # a zero standard deviation stays zero
    tangential = np.sqrt(widened.ft_sd**2 - frame.ft_sd**2) / np.log(1.3)
    assert tangential[-1] == pytest.approx(0.26 * np.hypot(0.6 * frame.fn[-1], 0.4 * mean))
    assert (widen_for_friction(frame, 0.25, 0.25).ft_sd == frame.ft_sd).all()
    high = widen_for_friction(frame, 0.26, 0.2)
    assert np.hypot(frame.fn_sd[1:], HIGH_FRICTION * np.log(1.3) * added[1:]) == pytest.approx(high.fn_sd[1:])
    alone = replace(frame, position_weight=1.0)  # forces from positions do not depend on sliding
    assert (widen_for_friction(alone, 0.2, 0.26).fn_sd == alone.fn_sd).all()


def test_standard_deviations_are_what_was_fitted(frame):
    """Of the motion, T = 0.9: factor of the group · exp(5.37 · 0.1 + 0.04 ln(c/500)) · 0.2 (s/0.2)^0.91, and of f_t.

    The error of the model, .06 and .02 of the force, from a tenth to 1.2 of the mean, is added in quadrature.
    """
    mean = frame.fn[frame.fn > 0].mean()
    size = np.log((frame.fn > 0).sum() / 500.0)
    plain = ~frame.contacts.with_wall & (frame.bearing_probability == 1.0)
    calibrated = calibrate_sd(frame)
    for group, fn_factor, ft_factor in ((Group.MEAN, 0.52, 0.62), (Group.STRONG, 0.48, 0.68)):
        row = np.flatnonzero(plain & (groups_of(frame) == group))[-1]
        of_model = mean * min(max(frame.fn[row] / mean, 0.1), 1.2)
        s = np.hypot(0.1 * frame.fn[row] / mean, 0.02)
        expected = mean * fn_factor * np.exp(5.37 * 0.1 + 0.04 * size) * 0.2 * (s / 0.2) ** 0.91
        assert calibrated.fn_sd[row] == pytest.approx(np.hypot(expected, 0.06 * of_model))
        s = np.hypot(0.03 * frame.fn[row] / mean, 0.006)
        expected = mean * ft_factor * np.exp(4.28 * 0.1 + 0.04 * size) * 0.06 * (s / 0.06) ** 0.82
        assert calibrated.ft_sd[row] == pytest.approx(np.hypot(expected, 0.02 * of_model))


def test_a_fraction_of_the_step_between_two_frictions_widens_by_that_fraction(frame):
    whole, half = (widen_for_friction(frame, 0.2, 0.26, fraction) for fraction in (1.0, 0.5))
    added = [np.sqrt(each.fn_sd[1:] ** 2 - frame.fn_sd[1:] ** 2) for each in (whole, half)]
    assert added[1] == pytest.approx(0.5 * added[0], rel=1e-5)


def test_the_intervals_state_the_correlation_of_a_posterior_mean(frame):
    """Truths are drawn around the forces; what all share, and a single value, correlate with nothing."""
    rng = np.random.default_rng(4)
    sd = np.full_like(frame.fn, 10.0)
    certain = replace(frame, fn_sd=sd, soft=0, scale_sd=np.nan)
    truths = frame.fn + sd * rng.standard_normal((2000, len(sd)))
    found = np.mean([np.corrcoef(frame.fn, each)[0, 1] for each in truths])
    assert correlation_by_intervals(certain) == pytest.approx(found, abs=0.01)
    of_scale = replace(frame, fn_sd=np.hypot(sd, 0.3 * frame.fn), soft=0, scale_sd=0.3)
    assert correlation_by_intervals(of_scale) == pytest.approx(correlation_by_intervals(certain))
    assert np.isnan(correlation_by_intervals(replace(certain, fn=np.full_like(sd, 5.0))))
