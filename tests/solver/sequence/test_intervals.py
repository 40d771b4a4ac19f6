"""Deviations that cover: which group a contact is in, what trust and a wrong friction make of its interval."""

from dataclasses import replace

import numpy as np
import pytest

from solver.sequence.judging.intervals import (
    FIRST_SCALE,
    FLOOR,
    NO_FRICTION,
    SLOPE,
    TOLD_HIGH,
    USUAL_CHANGE,
    Group,
    Term,
    Witness,
    calibrate_deviations,
    formula_deviations,
    friction_share,
    groups_of,
    interval_factors,
    terms_of,
    widen_for_friction,
    witness_behind,
    witness_of,
)
from tests.app.recording.fake_results import make_results


@pytest.fixture(scope="module")
def frame():
    one = make_results(1, 8, 7, sweeps=2).frames[0]
    c = one.contacts.count
    fn = np.linspace(0.0, 2.0, c) * 30.0
    return replace(
        one, frame=3, fn=fn, fn_sd=0.1 * fn, ft_sd=0.03 * fn, trust=0.9, positions_share=0.0,
        bearing_probability=np.where(np.arange(c) % 7 == 0, 0.5, 1.0), sliding_probability=np.zeros(c),
    )  # fmt: skip


def test_groups_name_what_matters_most_of_a_contact(frame):
    group = groups_of(frame)
    wall, doubtful = frame.contacts.with_wall, frame.bearing_probability < 0.9
    mean = frame.fn[frame.fn > 0].mean()
    assert (group[doubtful] == Group.DOUBTFUL).all()
    assert (group[wall & ~doubtful] == Group.WALL).all()
    plain = ~wall & ~doubtful
    assert (group[plain & (frame.fn < 0.49 * mean)] == Group.WEAK).all()
    assert (group[plain & (frame.fn > 1.51 * mean)] == Group.STRONG).all()
    assert {Group.WEAK, Group.MEAN, Group.STRONG, Group.WALL, Group.DOUBTFUL} == set(group.tolist())
    slides = replace(frame, sliding_probability=np.ones(len(frame.fn)))
    assert (groups_of(slides)[plain] == Group.SLIDING).all()


def test_witness_follows_the_share_of_positions():
    assert [witness_of(share) for share in (0.0, 0.5, 1.0)] == [Witness.MOTION, Witness.BOTH, Witness.POSITIONS]


def test_soft_grains_are_a_witness_of_their_own_and_doubt_of_them_widens(frame):
    soft = replace(frame, soft=1, positions_share=0.7)
    assert witness_behind(soft) == Witness.SOFT
    assert witness_behind(replace(soft, frame=0)) == Witness.SOFT_FIRST
    sure, doubted = (interval_factors(replace(soft, trust=trust)) for trust in (0.98, 0.93))
    assert (doubted > 1.2 * sure).all()


def test_calibrated_deviations_tell_what_they_were_made_of(frame):
    told = calibrate_deviations(frame)
    made_of = formula_deviations(told)
    mean = frame.fn[frame.fn > 0].mean()
    known = frame.fn_sd > 0
    formula, force = (np.column_stack(each) / mean for each in ((frame.fn_sd, frame.ft_sd), (frame.fn, frame.ft)))
    nothing = 1.0 - frame.bearing_probability[:, None]
    expected = np.sqrt(formula**2 + FLOOR**2 + nothing * force**2)
    assert made_of[known] == pytest.approx(expected[known])
    assert (told.fn_sd[~known] == 0).all()


def test_doubt_widens_where_motion_speaks(frame):
    sure, doubted = (calibrate_deviations(replace(frame, trust=trust)).fn_sd[-1] for trust in (0.95, 0.7))
    assert doubted > 1.1 * sure


def test_new_forces_widen_where_both_witnesses_speak_and_say_nothing_where_motion_does(frame):
    for share, grows in ((0.5, True), (0.0, False)):
        same, new = (
            calibrate_deviations(replace(frame, positions_share=share, force_change=change)).fn_sd[-1]
            for change in (0.02, 0.3)
        )
        assert (new > 1.1 * same) == grows
    unknown, usual = (interval_factors(replace(frame, positions_share=0.5, force_change=change))
                      for change in (np.nan, USUAL_CHANGE))  # fmt: skip
    assert unknown == pytest.approx(usual)


def test_the_more_contacts_there_are_the_less_walls_tell_of_them(frame):
    half = np.arange(len(frame.fn)) % 2 == 0
    fewer = replace(frame, fn=np.where(half, 0.0, frame.fn))
    grown = terms_of(frame)[Term.SIZE] - terms_of(fewer)[Term.SIZE]
    assert grown == pytest.approx(np.log((frame.fn > 0).sum() / (fewer.fn > 0).sum()))
    assert SLOPE[Witness.MOTION, Term.SIZE, 0] > 0.05
    assert np.isfinite(terms_of(replace(frame, fn=0.0 * frame.fn))[Term.SIZE])


def test_rods_that_nobody_saw_take_trust_away_but_no_exactness_where_forces_are_shown(frame):
    whole = replace(frame, trust=0.96)
    hidden = replace(frame, trust=0.96 * 0.9, unseen_doubt=0.1)
    assert interval_factors(hidden) == pytest.approx(interval_factors(whole))
    assert (interval_factors(replace(frame, trust=0.96 * 0.9)) > 1.2 * interval_factors(whole)).all()
    assert terms_of(replace(hidden, unseen_doubt=1.0))[Term.DOUBT] == 0.0  # all of it: no division by nothing


def test_no_doubt_beyond_what_truths_told_widens_what_the_motion_says(frame):
    trusts = (0.9, 0.6)  # rods that no photograph shows take trust away, not exactness where forces are shown
    one, other = (calibrate_deviations(replace(frame, trust=trust)) for trust in trusts)
    assert other.fn_sd == pytest.approx(one.fn_sd)


def test_what_may_bear_nothing_errs_by_all_it_bears_and_the_first_frame_by_a_share_of_it(frame):
    sure = replace(frame, bearing_probability=np.ones(len(frame.fn)))
    doubtful = replace(frame, bearing_probability=np.full(len(frame.fn), 0.95))  # the same group
    mean = frame.fn[frame.fn > 0].mean()
    before, after = (formula_deviations(calibrate_deviations(each))[-1, 0] for each in (sure, doubtful))
    assert after**2 - before**2 == pytest.approx(0.05 * (frame.fn[-1] / mean) ** 2)
    first = formula_deviations(calibrate_deviations(replace(sure, frame=0)))[-1, 0]
    assert first**2 - before**2 == pytest.approx((FIRST_SCALE * frame.fn[-1] / mean) ** 2)


def test_the_first_frame_is_the_less_exact_the_more_friction_it_bears(frame):
    first = replace(frame, frame=0)
    assert (witness_behind(first), witness_behind(frame)) == (Witness.FIRST, Witness.MOTION)
    little, much = (interval_factors(replace(first, ft=share * first.fn))[-1] for share in (0.02, 0.1))
    ratio = (0.1 + NO_FRICTION) / (0.02 + NO_FRICTION)
    assert much / little == pytest.approx(ratio ** SLOPE[Witness.FIRST, Term.FRICTION])
    assert friction_share(frame) == 1.0


def test_a_wrong_friction_widens_strong_contacts_most_and_weak_ones_by_a_share_of_the_mean(frame):
    told = widen_for_friction(frame, 0.2, 0.26)
    mean = frame.fn[frame.fn > 0].mean()
    added = np.sqrt(told.fn_sd**2 - frame.fn_sd**2) / np.log(1.3)
    assert added[-1] == pytest.approx(np.hypot(0.5 * frame.fn[-1], 0.4 * mean))
    assert added[1] > 0.4 * mean
    assert added[0] == 0.0  # it has no deviation to widen
    sideways = np.sqrt(told.ft_sd**2 - frame.ft_sd**2) / np.log(1.3)
    assert sideways[-1] == pytest.approx(0.26 * np.hypot(0.6 * frame.fn[-1], 0.4 * mean))
    assert (widen_for_friction(frame, 0.25, 0.25).ft_sd == frame.ft_sd).all()
    high = widen_for_friction(frame, 0.26, 0.2)
    assert np.hypot(frame.fn_sd[1:], TOLD_HIGH * np.log(1.3) * added[1:]) == pytest.approx(high.fn_sd[1:])
    alone = replace(frame, positions_share=1.0)  # positions know nothing of sliding
    assert (widen_for_friction(alone, 0.2, 0.26).fn_sd == alone.fn_sd).all()
