"""Penalties on the trust of a frame: size, words, and the friction check."""

import math
from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.assessment.expected_correlation import contradict
from rodsight.solver.assessment.intervals.force_intervals import FRICTION_ERROR
from rodsight.solver.assessment.motion_information import MotionInformation
from rodsight.solver.assessment.penalties import (
    BEYOND_WALL_LOSS,
    INNER_BOUNDARY_LOSS,
    SOFT_CHAIN_LOSS,
    assess,
    describe_penalties,
    find_penalties,
    limit_by_intervals,
    limit_for_few_photographs,
    most_by_intervals,
    penalise_contradiction,
    penalise_friction,
)
from rodsight.solver.assessment.trust import motion_assessment
from rodsight.solver.contacts.contacts import ContactState
from rodsight.solver.convex.friction_check import FrictionCheck
from rodsight.solver.frame_forces import FrameStatus
from rodsight.solver.part_settings import REFERENCE_STEP
from rodsight.solver.sequence.failure import failed_frame

from tests.app.recording.fake_results import make_results
from tests.solver.assessment.test_status import SOUND

CLEAR = MotionInformation(
    noise=1e-5, motion=1e-4, sliding=0.25, slide_signal=4.0, gap_error=0.0, diameter=0.016, beyond=0, soft=False
)
ASSESSED = replace(SOUND, information=CLEAR, grains=400)


def with_information(**changes):
    return replace(ASSESSED, information=replace(CLEAR, **changes))


def test_without_further_penalties_the_assessment_is_that_of_the_evidence():
    assert assess(ASSESSED) == motion_assessment(ASSESSED)
    assert describe_penalties(find_penalties(replace(ASSESSED, correction=0.01, disagreement=0.05))) == ""


@pytest.mark.parametrize(
    ("evidence", "word"),
    [
        (replace(ASSESSED, agreement=0.3, disagreement=0.3), "agree by 0.30 only"),
        (replace(ASSESSED, correction=0.8), "ε = 0.8"),
        (replace(ASSESSED, disagreement=0.6), "disagree by 60 %"),
        (with_information(beyond=9), "9 grains are beyond a wall"),
        (replace(with_information(soft=True), disagreement=math.nan), "soft"),
    ],
)
def test_every_penalty_lowers_the_trust_and_states_cause_and_cure(evidence, word):
    if evidence.agreement > 0:
        sound = assess(replace(ASSESSED, agreement=0.95, position_agreement=0.95))
    elif math.isnan(evidence.disagreement):  # a single chain
        sound = motion_assessment(evidence)
    else:
        sound = assess(ASSESSED)
    assert assess(evidence).trust < sound.trust - 0.01
    words = describe_penalties(find_penalties(evidence))
    assert word in words
    assert ":" in words or "(" in words  # the cure


def test_a_wide_step_is_named_where_the_force_pattern_is_new():
    wide = replace(ASSESSED, shear=4 * REFERENCE_STEP, force_change=0.5, correction=0.4)
    assert describe_penalties(find_penalties(wide)).count("moved as by 1° of shear since the photograph before") == 1
    assert "of shear since" not in describe_penalties(find_penalties(replace(wide, shear=REFERENCE_STEP)))


def test_penalties_beside_the_evidence_have_their_size():
    kept = 1.0 - BEYOND_WALL_LOSS * 4 / 400
    usual = motion_assessment(ASSESSED)
    found = assess(with_information(beyond=4))
    assert found == pytest.approx((kept * usual.expected_correlation, kept * usual.trust))
    chain = replace(with_information(soft=True), disagreement=math.nan)
    assert assess(chain).trust == pytest.approx(motion_assessment(chain).trust * (1.0 - SOFT_CHAIN_LOSS))


def test_forces_that_balance_lacks_are_missing_in_the_correlation():
    unheld = replace(ASSESSED, missing_force=3.0)
    assert assess(unheld) == pytest.approx([0.5 * each for each in assess(ASSESSED)])
    assert "lack forces of 173 % of all others" in describe_penalties(find_penalties(unheld))
    slightly = find_penalties(replace(ASSESSED, missing_force=1e-4))
    assert describe_penalties(slightly) == describe_penalties(find_penalties(ASSESSED))


def test_a_load_that_boundary_grains_inside_the_packing_bear_lowers_the_trust():
    pinned = replace(ASSESSED, boundary_reaction=0.015)
    assert assess(pinned) == pytest.approx([(1.0 - INNER_BOUNDARY_LOSS) * each for each in assess(ASSESSED)])
    assert "inside the packing bear 1.5 % of all forces" in describe_penalties(find_penalties(pinned))
    assert assess(replace(ASSESSED, boundary_reaction=1e-4)) == assess(ASSESSED)


def test_no_constant_caps_the_trust_of_a_suspect_frame():
    suspect = replace(ASSESSED, pressure_jump=0.9)
    assert assess(suspect) == assess(ASSESSED)
    assert assess(replace(suspect, agreement=0.2)).trust < assess(replace(suspect, agreement=0.9)).trust


def test_an_unassessed_frame_stays_unassessed():
    assert math.isnan(assess(replace(ASSESSED, assessed=False)).trust)


def test_the_largest_penalty_comes_first():
    evidence = replace(with_information(beyond=9, noise=1e-4), correction=0.2, inferred=2)
    fractions = [each.fraction for each in find_penalties(evidence)]
    assert fractions == sorted(fractions, reverse=True)
    assert len(fractions) >= 3


def check(measured, low, high, *, enclosed=True):
    return FrictionCheck(0.25, measured, low, high, 1, 3, enclosed, np.ones(1), np.ones(1))


def test_a_contradicted_friction_is_reported_with_what_else_looks_like_it():
    frame = replace(failed_frame(3, "", 4, 4), status=FrameStatus.SETTLED, trust=0.9, trust_penalties="noise")
    low = penalise_friction(frame, check(0.40, 0.34, 0.46))
    assert low.trust == 0.9  # the evidence of each frame counts, not the suspected cause
    # friction is not blamed before the evidence of the frame
    assert low.trust_penalties.startswith(
        "noise · the motion fits a friction of 0.40 (0.34 to 0.46) better than the given 0.25"
    )
    assert "smooth walls" in low.trust_penalties
    for agrees in (None, check(0.26, 0.22, 0.30), check(0.40, 0.34, 0.46, enclosed=False)):
        assert penalise_friction(frame, agrees) is frame
    failed = replace(frame, status=FrameStatus.FAILED)
    assert penalise_friction(failed, check(0.40, 0.34, 0.46)) is failed


def test_sliding_follows_the_measured_friction():
    frame = make_results(1, 8, 7, sweeps=2).frames[0]
    c = len(frame.fn)
    before = np.linspace(0.0, 1.0, c)
    frame = replace(frame, fn=np.ones(c), sliding_probability=before)
    for mu, more in ((0.40, False), (0.16, True)):
        penalised = penalise_friction(frame, check(mu, mu - 0.02, mu + 0.02))
        slides = penalised.sliding_probability
        assert slides is not None
        assert ((slides > before)[1:-1] == more).all()
        assert slides[[0, -1]] == pytest.approx([0.0, 1.0], abs=1e-6)
        assert ((penalised.state == ContactState.SLIDING) == (slides > 0.5)).all()


def test_the_interval_of_a_measured_friction_enters_the_standard_deviations():
    frame = make_results(1, 8, 7, sweeps=2).frames[0]
    penalised = penalise_friction(frame, check(0.26, 0.22, 0.30), measured=True)
    of_force, of_mean = FRICTION_ERROR[0]
    mean = np.where(frame.fn_sd > 0, frame.fn[frame.fn > 0].mean(), 0.0)
    expected = 0.5 * math.log(0.26 / 0.22) * np.hypot(of_force * np.maximum(frame.fn, 0.0), of_mean * mean)
    assert np.sqrt(penalised.fn_sd**2 - frame.fn_sd**2) == pytest.approx(expected, rel=1e-3, abs=1e-4)
    assert penalised.trust == frame.trust


def test_positions_do_not_depend_on_a_friction_that_the_motion_contradicts():
    frame = replace(make_results(1, 8, 7, sweeps=2).frames[0], trust=0.9, status=FrameStatus.SETTLED)
    half = replace(frame, sliding_probability=np.full(len(frame.fn), 0.4))
    odds = []
    for weight in (0.0, 0.5, 1.0):
        penalised = penalise_friction(replace(half, position_weight=weight), check(0.40, 0.34, 0.46))
        assert penalised.sliding_probability is not None
        odds.append(np.log(penalised.sliding_probability[0] / (1.0 - penalised.sliding_probability[0]) / (0.4 / 0.6)))
    assert odds == pytest.approx([odds[0], 0.5 * odds[0], 0.0], abs=1e-9)
    assert odds[0] < -0.1


def test_a_frame_of_contradictory_input_is_trusted_less_for_a_reason_that_comes_first():
    frame = replace(
        make_results(1, 8, 7, sweeps=2).frames[0], trust=0.9, expected_correlation=0.97, trust_penalties="noise"
    )
    penalised = penalise_contradiction(frame, "photographs reversed")
    assert penalised.trust == contradict(0.9) < 0.9
    assert penalised.expected_correlation == contradict(0.97) < 0.97
    assert penalised.trust_penalties == "photographs reversed · noise"
    failed = failed_frame(3, "no contacts", 4, 2)
    assert penalise_contradiction(failed, "photographs reversed") is failed


def test_two_photographs_alone_are_not_trusted():
    frame = replace(
        make_results(1, 8, 7, sweeps=2).frames[0], trust=0.9, expected_correlation=0.97, trust_penalties="noise"
    )
    limited = limit_for_few_photographs(frame, 2)
    assert limited.trust < 0.3
    assert limited.trust_penalties.startswith("the test has only 2 photographs")
    assert limited.expected_correlation == limited.trust
    assert "only 1 photograph: no motion" in limit_for_few_photographs(frame, 1).trust_penalties
    assert limit_for_few_photographs(frame, 3) is frame
    low = replace(frame, trust=0.1)
    assert limit_for_few_photographs(low, 2) is low


@pytest.mark.parametrize(
    ("by_intervals", "most"), [(0.95, 1.0), (0.57, 1.0), (0.5, 0.85), (0.4, 0.6), (0.2, 0.1), (0.15, 0.0)]
)
def test_nothing_is_trusted_beyond_the_error_bars(by_intervals, most):
    frame = replace(make_results(1, 8, 7, sweeps=2).frames[0], trust=0.9, expected_correlation=0.97, soft=0)
    fn = np.linspace(1.0, 3.0, len(frame.fn))
    sd = np.std(fn) * np.sqrt(by_intervals**-2 - 1.0)
    wide = replace(frame, fn=fn, fn_sd=np.full_like(fn, sd), scale_sd=np.nan)
    assert most_by_intervals(wide) == pytest.approx(most)
    limited = limit_by_intervals(wide)
    assert limited.trust == pytest.approx(min(0.9, most))
    assert limited.trust_penalties.startswith("the error bars") == (most < 0.9)
    assert limited.expected_correlation == pytest.approx(min(0.97, most) if most < 0.9 else 0.97)
    assert limit_by_intervals(replace(wide, soft=1)).trust == 0.9
    assert limit_by_intervals(replace(wide, fn=np.ones_like(fn))).trust == 0.9
