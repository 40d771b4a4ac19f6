import math
from dataclasses import replace

import numpy as np
import pytest

from solver.sequence.frame_forces import FrameStatus
from solver.sequence.judging.judgement import (
    CHAIN_UNBALANCED,
    LOAD_SHARES,
    MOST_UNSEEN,
    NEW_FORCES,
    SETTLED_CORRECTION,
    SETTLED_DIFFERENCE,
    SETTLING_FRAMES,
    SUSPECT_CORRECTION,
    SUSPECT_PRESSURE_JUMP,
    UNBALANCED,
    Evidence,
    free_standard_deviation,
    is_suspect,
    judge,
    rearranging_level,
    tangential_standard_deviation,
    trust,
)

SHEAR = math.radians(0.25)
SOUND = Evidence(
    reset=False, correction=0.03, disagreement=0.12, old_unbalance=0.02, pressure_jump=0.03, load_share=1.2,
    unbalance=1e-3, shear=SHEAR, frames_since_event=10, start_difference=0.01,
)  # fmt: skip


def test_sound_evidence_is_settled_and_trusted():
    assert judge(SOUND)[0] is FrameStatus.SETTLED
    assert not is_suspect(SOUND)
    assert 0.9 < trust(SOUND) < 1.0


@pytest.mark.parametrize(
    ("fault", "word"),
    [
        ({"unbalance": 1.01 * UNBALANCED}, "out of balance"),
        ({"unbalance": 1.01 * CHAIN_UNBALANCED, "disagreement": math.nan}, "out of balance"),
        ({"load_share": 0.99 * LOAD_SHARES[0]}, "load"),
        ({"load_share": 1.01 * LOAD_SHARES[1]}, "load"),
        ({"correction": 1.01 * SUSPECT_CORRECTION}, "ε"),
        ({"pressure_jump": 1.01 * SUSPECT_PRESSURE_JUMP}, "jumped"),
        ({"unseen_share": 1.01 * MOST_UNSEEN}, "not readable"),
    ],
)
def test_each_fault_makes_a_frame_suspect_and_is_named(fault, word):
    faulty = replace(SOUND, **fault)
    status, why = judge(faulty)
    assert status is FrameStatus.SUSPECT
    assert is_suspect(faulty)
    assert word in why


def test_all_faults_are_named_at_once():
    _, why = judge(replace(SOUND, unbalance=2.0, load_share=0.1, correction=3.0))
    assert why.count("pathological") == 2
    assert "ε = 3.00" in why


def test_a_first_guess_that_is_pathological_is_named_as_such():
    status, why = judge(replace(SOUND, reset=True, load_share=0.1))
    assert status is FrameStatus.RESET
    assert "pathological" in why


def test_without_a_load_the_mean_stress_is_no_evidence():
    assert judge(replace(SOUND, load_share=math.nan))[0] is FrameStatus.SETTLED


def test_old_forces_that_no_longer_fit_tell_a_rearrangement():
    level = rearranging_level(SHEAR)
    assert judge(replace(SOUND, old_unbalance=1.01 * level))[0] is FrameStatus.REARRANGING
    assert judge(replace(SOUND, old_unbalance=0.99 * level))[0] is FrameStatus.SETTLED
    assert rearranging_level(0.5 * SHEAR) < level < rearranging_level(2.0 * SHEAR)


def test_forces_that_are_new_in_every_photograph_are_not_settled_and_the_spacing_is_named():
    sparse = replace(SOUND, shear=4.0 * SHEAR, force_change=0.2)
    status, why = judge(sparse)
    assert status is FrameStatus.SETTLING
    assert "1° of shear" in why
    assert "every 0.3°" in why
    assert judge(replace(sparse, force_change=0.99 * NEW_FORCES))[0] is FrameStatus.SETTLED
    assert "too far apart" not in judge(replace(sparse, shear=SHEAR))[1]


def test_a_frame_settles_some_frames_after_an_event_and_when_motion_and_forces_agree():
    assert judge(replace(SOUND, frames_since_event=SETTLING_FRAMES - 1))[0] is FrameStatus.SETTLING
    assert judge(replace(SOUND, frames_since_event=SETTLING_FRAMES))[0] is FrameStatus.SETTLED
    assert judge(replace(SOUND, correction=1.01 * SETTLED_CORRECTION))[0] is FrameStatus.SETTLING


def test_trust_falls_with_disagreement_and_with_correction_within_its_bounds():
    assert trust(replace(SOUND, disagreement=0.3)) < trust(SOUND)
    assert trust(replace(SOUND, correction=0.3)) < trust(SOUND)
    assert trust(replace(SOUND, correction=1e6)) == 0.0
    assert trust(replace(SOUND, correction=0.0, disagreement=0.0)) == 1.0


def test_a_single_chain_is_trusted_by_its_correction_alone():
    chain = replace(SOUND, disagreement=math.nan)
    assert 0.0 < trust(replace(chain, correction=0.2)) < trust(chain) < 1.0


def test_standard_deviations_grow_with_force_and_spread_and_scale_with_the_load():
    fn, spread = np.array([0.0, 10.0, 50.0]), np.array([0.0, 2.0, 2.0])
    for deviation in (
        lambda f, s: free_standard_deviation(f, s),
        lambda f, s: tangential_standard_deviation(f, 0.25, s),
    ):
        assert np.all(np.diff(deviation(fn, spread)) > 0)
        assert np.all(deviation(fn, 2.0 * spread)[1:] > deviation(fn, spread)[1:])
        np.testing.assert_allclose(deviation(3.0 * fn, 3.0 * spread), 3.0 * deviation(fn, spread))
        np.testing.assert_array_equal(deviation(np.zeros(3), spread), 0.0)


def test_a_single_chain_has_error_bars_too():
    fn = np.array([5.0, 20.0])
    assert np.all(free_standard_deviation(fn) > 0)
    np.testing.assert_allclose(tangential_standard_deviation(fn, 0.25), 0.25 * free_standard_deviation(fn))


def test_a_frame_whose_start_is_not_forgotten_is_still_settling():
    status, why = judge(replace(SOUND, start_difference=1.01 * SETTLED_DIFFERENCE))
    assert status is FrameStatus.SETTLING
    assert "H = " in why
    assert judge(replace(SOUND, start_difference=0.99 * SETTLED_DIFFERENCE))[0] is FrameStatus.SETTLED


def test_holes_lower_the_trust_and_are_named():
    holed = replace(SOUND, holes=3, grains=600)
    assert trust(holed) < trust(SOUND)
    assert "3 holes" in judge(holed)[1]
    assert "hole" not in judge(SOUND)[1]


def test_a_single_chain_is_trusted_less_the_farther_its_threshold_reaches():
    chain = replace(SOUND, disagreement=math.nan)
    assert trust(replace(chain, reach=0.015)) < trust(replace(chain, reach=0.004)) < trust(chain)


@pytest.mark.parametrize(
    ("evidence", "expected"),
    [
        # 1 − .83 D^2.65 − .42 ε^.73, powers from a table
        ({"correction": 0.1, "disagreement": 0.2}, 1.0 - 0.83 * 0.014052 - 0.42 * 0.186209),
        ({"correction": 0.02, "disagreement": 0.5}, 1.0 - 0.83 * 0.159320 - 0.42 * 0.057511),
        # of a single chain: 1 − .95 ε^.8 − 4.45 reach
        ({"correction": 0.1, "disagreement": math.nan, "reach": 0.01}, 1.0 - 0.95 * 0.158489 - 0.0445),
        # one hole among 60 grains takes a tenth
        ({"correction": 0.0, "disagreement": 0.0, "holes": 1, "grains": 60}, 0.9),
        ({"correction": 0.0, "disagreement": 0.0, "holes": 60, "grains": 60}, 0.0),
    ],
)
def test_trust_is_what_was_fitted(evidence, expected):
    assert trust(replace(SOUND, **evidence)) == pytest.approx(expected, abs=2e-6)


def test_standard_deviations_are_what_was_fitted():
    fn, spread = np.array([1.0, 3.0]), np.array([0.4, 0.0])  # mean f_n: 2
    # ⟨f⟩ √(a² + b² f/⟨f⟩ + (c s/⟨f⟩)²)
    normal = 2.0 * np.sqrt([9e-6 + 0.5 * 0.088**2 + (0.985 * 0.2) ** 2, 9e-6 + 1.5 * 0.088**2])
    tangential = 2.0 * np.sqrt([1e-6 + 0.5 * 0.008**2 + (1.206 * 0.2) ** 2, 1e-6 + 1.5 * 0.008**2])
    chain = 2.0 * np.sqrt([0.071**2 + 0.5 * 0.239**2, 0.071**2 + 1.5 * 0.239**2])
    assert free_standard_deviation(fn, spread) == pytest.approx(normal)
    assert tangential_standard_deviation(fn, 0.25, spread) == pytest.approx(tangential)
    assert free_standard_deviation(fn) == pytest.approx(chain)


def test_levels_are_what_was_fitted():
    assert (SUSPECT_CORRECTION, SUSPECT_PRESSURE_JUMP, UNBALANCED, CHAIN_UNBALANCED) == (0.25, 0.15, 0.05, 0.15)
    assert (LOAD_SHARES, SETTLED_CORRECTION, SETTLED_DIFFERENCE, SETTLING_FRAMES) == ((0.62, 2.5), 0.15, 0.04, 2)
    # ū scales with the power 3/2 of the shear between photographs, within bounds
    assert rearranging_level(SHEAR) == pytest.approx(0.037)
    assert rearranging_level(2.0 * SHEAR) == pytest.approx(0.037 * 2.0**1.5)
    assert rearranging_level(0.01 * SHEAR) == pytest.approx(0.4 * 0.037)
    assert rearranging_level(100.0 * SHEAR) == pytest.approx(4.0 * 0.037)


@pytest.mark.parametrize("unknown", ["unbalance", "correction", "start_difference"])
def test_what_is_not_known_settles_nothing(unknown):
    assert judge(replace(SOUND, **{unknown: math.nan}))[0] is not FrameStatus.SETTLED


def test_a_start_that_is_forgotten_need_not_be_known():
    forgotten = replace(SOUND, start_difference=math.nan, start_forgotten=True)
    assert judge(forgotten)[0] is FrameStatus.SETTLED


@pytest.mark.parametrize("unknown", ["correction", "hidden_share"])
def test_what_is_not_known_earns_no_trust(unknown):
    assert not trust(replace(SOUND, **{unknown: math.nan})) > 0.0
