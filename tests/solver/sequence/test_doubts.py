import math
from dataclasses import replace

import numpy as np
import pytest

from solver.contacts.contacts import ContactState
from solver.convex.friction_check import FrictionCheck
from solver.sequence.failure import failed_frame
from solver.sequence.frame_forces import FrameStatus
from solver.sequence.judging.doubts import (
    COARSE,
    COARSE_LOSS,
    FRICTION_LOSS,
    SOFT_CHAIN,
    STILL,
    SUSPECT_TRUST,
    doubt_friction,
    find_doubts,
    lower_bound,
    tell_doubts,
)
from solver.sequence.judging.information import Information
from solver.sequence.judging.intervals import FRICTION_ERROR
from solver.sequence.judging.judgement import trust
from tests.app.recording.fake_results import make_results
from tests.solver.sequence.test_judgement import SOUND

CLEAR = Information(
    noise=1e-5, motion=1e-4, sliding=0.25, slide_signal=4.0, gap_error=0.0, diameter=0.016, beyond=0, soft=False
)
TOLD = replace(SOUND, information=CLEAR, grains=400)


def told(**changes):
    return replace(TOLD, information=replace(CLEAR, **changes))


def test_where_the_motion_tells_everything_nothing_is_taken_off():
    assert lower_bound(TOLD) == trust(TOLD)
    assert tell_doubts(replace(TOLD, correction=0.01)) == ""


@pytest.mark.parametrize(
    ("doubtful", "word"),
    [
        (told(sliding=0.001, slide_signal=0.1), "nothing slides"),
        (told(sliding=0.04, slide_signal=0.3), "4 % of the contacts slide"),
        (told(noise=1e-4), "noise of 100 µm against 100 µm"),
        (told(gap_error=5e-5), "radii or centres are wrong"),
        (told(beyond=9), "9 grains are beyond a wall"),
        (replace(TOLD, shear=4 * COARSE), "1° of shear apart"),
        (replace(told(soft=True), disagreement=math.nan), "soft"),
    ],
)
def test_every_doubt_lowers_the_trust_and_says_why_and_what_to_do(doubtful, word):
    assert lower_bound(doubtful) < trust(doubtful) - 0.03
    words = tell_doubts(doubtful)
    assert word in words
    assert ":" in words or "(" in words  # what to do about it


def test_what_is_taken_is_what_was_fitted():
    """Half the sliding that is enough, three steps of shear too many, soft grains and a chain: 1.2 (1 - .06) …"""
    assert lower_bound(told(slide_signal=0.5 * STILL[0])) == pytest.approx(trust(TOLD) * (1.0 - 0.5 * STILL[1]))
    sparse = replace(TOLD, shear=4 * COARSE)
    assert lower_bound(sparse) == pytest.approx(trust(sparse) * (1.0 - 3 * COARSE_LOSS))
    chain = replace(told(soft=True), disagreement=math.nan)
    assert lower_bound(chain) == pytest.approx(trust(chain) * (1.0 - SOFT_CHAIN))
    # 0.25 for each unit of noise over motion beyond a half, of gross noise in full
    assert lower_bound(told(noise=1e-4, slide_signal=4.0)) == pytest.approx(trust(TOLD) * (1.0 - 0.125))


def test_positions_that_were_asked_make_up_for_motion_that_tells_nothing():
    still = told(sliding=0.0, slide_signal=0.0)
    asked = replace(still, mixed_trust=trust(still), positions_share=0.8)
    assert lower_bound(asked) > lower_bound(still)


def test_a_suspect_frame_is_not_trusted_beyond_a_cap():
    suspect = replace(TOLD, pressure_jump=0.9)
    assert trust(suspect) > SUSPECT_TRUST
    assert lower_bound(suspect) == SUSPECT_TRUST


def test_what_is_not_known_takes_nothing_off_and_what_is_not_assessed_stays_so():
    assert lower_bound(SOUND) == trust(SOUND)
    assert math.isnan(lower_bound(replace(TOLD, assessed=False)))


def test_doubts_are_told_the_worst_first():
    shares = [each.share for each in find_doubts(replace(told(beyond=9, noise=1e-4), correction=0.2, holes=2))]
    assert shares == sorted(shares, reverse=True)
    assert len(shares) >= 4


def check(measured, low, high, *, enclosed=True):
    return FrictionCheck(0.25, measured, low, high, 1, 3, enclosed, np.ones(1), np.ones(1))


def test_a_friction_that_the_motion_contradicts_lowers_the_trust_most_where_it_is_too_low():
    frame = replace(failed_frame(3, "", 4, 4), status=FrameStatus.SETTLED, trust=0.9, doubt="noise")
    low = doubt_friction(frame, check(0.40, 0.34, 0.46))
    assert low.trust == pytest.approx(0.9 * (1.0 - FRICTION_LOSS[0] * math.log(1.6)))
    assert low.doubt.startswith("the motion contradicts the friction: 0.40 (0.34 to 0.46) for 0.25")
    assert low.doubt.endswith("; noise")
    high = doubt_friction(frame, check(0.15625, 0.12, 0.19))
    assert low.trust < high.trust < 0.9
    for agrees in (None, check(0.26, 0.22, 0.30), check(0.40, 0.34, 0.46, enclosed=False)):
        assert doubt_friction(frame, agrees) is frame
    failed = replace(frame, status=FrameStatus.FAILED)
    assert doubt_friction(failed, check(0.40, 0.34, 0.46)) is failed


def test_what_slides_is_what_slides_at_the_friction_that_the_motion_shows():
    frame = make_results(1, 8, 7, sweeps=2).frames[0]
    c = len(frame.fn)
    before = np.linspace(0.0, 1.0, c)
    frame = replace(frame, fn=np.ones(c), sliding_probability=before)
    for mu, more in ((0.40, False), (0.16, True)):
        told = doubt_friction(frame, check(mu, mu - 0.02, mu + 0.02))
        slides = told.sliding_probability
        assert slides is not None
        assert ((slides > before)[1:-1] == more).all()
        assert slides[[0, -1]] == pytest.approx([0.0, 1.0], abs=1e-6)
        assert ((told.state == ContactState.SLIDING) == (slides > 0.5)).all()


def test_a_friction_that_was_measured_is_as_exact_as_its_interval():
    frame = make_results(1, 8, 7, sweeps=2).frames[0]
    told = doubt_friction(frame, check(0.26, 0.22, 0.30), measured=True)
    of_force, of_mean = FRICTION_ERROR[0]
    mean = np.where(frame.fn_sd > 0, frame.fn[frame.fn > 0].mean(), 0.0)
    expected = 0.5 * math.log(0.26 / 0.22) * np.hypot(of_force * np.maximum(frame.fn, 0.0), of_mean * mean)
    assert np.sqrt(told.fn_sd**2 - frame.fn_sd**2) == pytest.approx(expected, rel=1e-3, abs=1e-4)
    assert told.trust == frame.trust
