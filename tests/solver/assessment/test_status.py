"""Status of a frame, its trust by motion, and the formula of its standard deviations."""

import math
from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.assessment.evidence import Evidence
from rodsight.solver.assessment.intervals.formula_sd import normal_sd, tangential_sd
from rodsight.solver.assessment.motion_information import NO_INFORMATION
from rodsight.solver.assessment.penalties import describe_penalties, find_penalties
from rodsight.solver.assessment.status import (
    CHAIN_UNBALANCED,
    LOAD_FRACTIONS,
    NEW_FORCES,
    RELIABLE,
    SETTLED_CORRECTION,
    SETTLED_DIFFERENCE,
    SETTLING_FRAMES,
    SUSPECT_CORRECTION,
    SUSPECT_PRESSURE_JUMP,
    UNBALANCED,
    decide_status,
    is_suspect,
    rearranging_level,
)
from rodsight.solver.assessment.trust import MAX_UNSEEN_FRACTION, motion_assessment
from rodsight.solver.frame_forces import FrameStatus

SHEAR = math.radians(0.25)
SOUND = Evidence(
    reset=False, correction=0.03, disagreement=0.12, old_unbalance=0.02, pressure_jump=0.03, load_fraction=1.2,
    unbalance=1e-3, shear=SHEAR, frames_since_event=10, start_difference=0.01,
)  # fmt: skip


def trust(evidence):
    return motion_assessment(evidence).trust


def test_sound_evidence_is_settled_and_trusted():
    assert decide_status(SOUND)[0] is FrameStatus.SETTLED
    assert not is_suspect(SOUND)
    assert 0.5 < trust(SOUND) < motion_assessment(SOUND).expected_correlation < 1.0
    compared = replace(SOUND, agreement=0.94, position_agreement=0.93, overlap_agreement=0.9)
    contradicted = replace(compared, agreement=0.4, overlap_agreement=0.4)
    assert 1.0 - trust(contradicted) > 1.5 * (1.0 - trust(compared))  # two estimates that agree are evidence


@pytest.mark.parametrize(
    ("fault", "word"),
    [
        ({"unbalance": 1.01 * UNBALANCED}, "out of balance"),
        ({"unbalance": 1.01 * CHAIN_UNBALANCED, "disagreement": math.nan}, "out of balance"),
        ({"load_fraction": 0.99 * LOAD_FRACTIONS[0]}, "load"),
        ({"load_fraction": 1.01 * LOAD_FRACTIONS[1]}, "load"),
        ({"correction": 1.01 * SUSPECT_CORRECTION, "agreement": 0.4}, "ε"),
        ({"pressure_jump": 1.01 * SUSPECT_PRESSURE_JUMP, "agreement": 0.4, "disagreement": 0.5}, "jumped"),
        ({"unseen_fraction": 1.01 * MAX_UNSEEN_FRACTION}, "unreadable"),
    ],
)
def test_each_fault_makes_a_frame_suspect_and_is_reported(fault, word):
    faulty = replace(SOUND, **fault)
    status, why = decide_status(faulty)
    assert status is FrameStatus.SUSPECT
    assert is_suspect(faulty)
    assert word in why


@pytest.mark.parametrize("sudden", [{"correction": 1.01 * SUSPECT_CORRECTION}, {"pressure_jump": 0.5}])
def test_sudden_motion_or_stress_is_no_contradiction_where_the_forces_are_reliable(sudden):
    evident = replace(SOUND, **sudden, disagreement=0.05, agreement=0.97, position_agreement=0.97)
    assert trust(evident) > RELIABLE
    assert not is_suspect(evident)
    assert is_suspect(replace(evident, unbalance=0.02))  # no forces in balance are near what is measured
    disagreeing = replace(evident, disagreement=0.4, agreement=0.4, overlap_agreement=0.4)
    assert trust(disagreeing) < RELIABLE
    assert is_suspect(disagreeing)


def test_a_correction_of_noise_contradicts_nothing():
    moving = replace(SOUND, correction=2.0, agreement=0.4)
    assert is_suspect(moving)
    resting = replace(moving, information=replace(NO_INFORMATION, slide_signal=0.05))
    assert not is_suspect(resting)


def test_all_faults_are_reported_together():
    _, why = decide_status(replace(SOUND, unbalance=2.0, load_fraction=0.1, correction=3.0))
    assert "the worst grain is out of balance by" in why
    assert "the mean stress is" in why
    assert "ε = 3.00" in why


def test_faults_of_a_reset_frame_are_reported():
    status, why = decide_status(replace(SOUND, reset=True, load_fraction=0.1))
    assert status is FrameStatus.RESET
    assert "the mean stress is 0.10 of the load" in why


def test_without_a_load_the_mean_stress_is_no_evidence():
    assert decide_status(replace(SOUND, load_fraction=math.nan))[0] is FrameStatus.SETTLED


def test_a_large_residual_of_previous_forces_indicates_a_rearrangement():
    level = rearranging_level(SHEAR)
    assert decide_status(replace(SOUND, old_unbalance=1.01 * level))[0] is FrameStatus.REARRANGING
    assert decide_status(replace(SOUND, old_unbalance=0.99 * level))[0] is FrameStatus.SETTLED
    assert rearranging_level(0.5 * SHEAR) < level < rearranging_level(2.0 * SHEAR)


def test_new_forces_in_every_photograph_prevent_settling_and_a_spacing_is_recommended():
    sparse = replace(SOUND, shear=4.0 * SHEAR, force_change=0.2)
    status, why = decide_status(sparse)
    assert status is FrameStatus.SETTLING
    assert "1° of shear" in why
    assert "every 0.3°" in why
    assert decide_status(replace(sparse, force_change=0.99 * NEW_FORCES))[0] is FrameStatus.SETTLED
    assert "too far apart" not in decide_status(replace(sparse, shear=SHEAR))[1]


def test_a_frame_is_settled_some_frames_after_an_event_if_motion_and_forces_agree():
    assert decide_status(replace(SOUND, frames_since_event=SETTLING_FRAMES - 1))[0] is FrameStatus.SETTLING
    assert decide_status(replace(SOUND, frames_since_event=SETTLING_FRAMES))[0] is FrameStatus.SETTLED
    assert decide_status(replace(SOUND, correction=1.01 * SETTLED_CORRECTION))[0] is FrameStatus.SETTLING


def test_trust_falls_with_disagreement_and_with_correction_within_its_bounds():
    assert trust(replace(SOUND, disagreement=0.3)) < trust(SOUND)
    assert trust(replace(SOUND, correction=0.3)) < trust(SOUND)
    assert trust(replace(SOUND, correction=1e6)) < trust(SOUND) - 0.2  # one contradiction among sound evidence
    assert 0.0 <= trust(replace(SOUND, correction=1e6, old_unbalance=1.0, disagreement=1.0)) < 0.3
    assert trust(SOUND) < trust(replace(SOUND, correction=0.0, disagreement=0.0)) < 1.0


def test_a_single_chain_is_trusted_by_its_correction_alone():
    chain = replace(SOUND, disagreement=math.nan)
    assert 0.0 < trust(replace(chain, correction=0.2)) < trust(chain) < 1.0


def test_standard_deviations_increase_with_force_and_ensemble_sd_and_scale_with_the_load():
    fn, ensemble_sd = np.array([0.0, 10.0, 50.0]), np.array([0.0, 2.0, 2.0])
    for sd in (
        lambda f, s: normal_sd(f, s),
        lambda f, s: tangential_sd(f, 0.25, s),
    ):
        assert np.all(np.diff(sd(fn, ensemble_sd)) > 0)
        assert np.all(sd(fn, 2.0 * ensemble_sd)[1:] > sd(fn, ensemble_sd)[1:])
        np.testing.assert_allclose(sd(3.0 * fn, 3.0 * ensemble_sd), 3.0 * sd(fn, ensemble_sd))
        np.testing.assert_array_equal(sd(np.zeros(3), ensemble_sd), 0.0)


def test_a_single_chain_has_standard_deviations():
    fn = np.array([5.0, 20.0])
    assert np.all(normal_sd(fn) > 0)
    np.testing.assert_allclose(tangential_sd(fn, 0.25), 0.25 * normal_sd(fn))


def test_a_frame_is_settling_until_the_influence_of_the_start_has_vanished():
    status, why = decide_status(replace(SOUND, start_difference=1.01 * SETTLED_DIFFERENCE))
    assert status is FrameStatus.SETTLING
    assert "H = " in why
    assert decide_status(replace(SOUND, start_difference=0.99 * SETTLED_DIFFERENCE))[0] is FrameStatus.SETTLED


def test_holes_are_reported_and_only_inferred_rods_lower_the_trust():
    holed = replace(SOUND, holes=3, grains=600)
    assert trust(holed) == trust(SOUND)  # pores of loose packings look the same
    assert trust(replace(SOUND, inferred=3, grains=600)) < trust(SOUND)
    assert "3 holes" in decide_status(holed)[1]
    assert "hole" not in decide_status(SOUND)[1]
    assert "hole" not in decide_status(replace(holed, sought=True))[1]  # no neighbour demands a rod there


def test_the_trust_of_a_single_chain_falls_with_its_gap_threshold():
    chain = replace(SOUND, disagreement=math.nan)
    assert trust(replace(chain, reach=0.015)) < trust(replace(chain, reach=0.004)) < trust(chain)


@pytest.mark.parametrize(
    ("evidence", "factor"),
    [
        ({"inferred": 6, "grains": 600}, 0.99),
        ({"inferred": 600, "grains": 600}, 0.0),
        ({"unseen_fraction": 0.19}, 1.0),
        ({"unseen_fraction": 0.25}, 0.75),
        ({"hidden_fraction": 0.2}, 0.8),
    ],
)
def test_grains_that_no_photograph_shows_reduce_both_measures_by_a_factor(evidence, factor):
    found, sound = motion_assessment(replace(SOUND, **evidence)), motion_assessment(SOUND)
    assert found == pytest.approx(tuple(factor * each for each in sound))


def test_a_single_chain_has_its_fitted_trust():
    chain = replace(SOUND, disagreement=math.nan, correction=0.2, reach=0.01)
    assert trust(chain) == pytest.approx(1.0 - 0.95 * 0.2**0.8 - 4.45 * 0.01)


def test_standard_deviations_have_their_fitted_values():
    fn, ensemble_sd = np.array([1.0, 3.0]), np.array([0.4, 0.0])  # mean f_n: 2
    # ⟨f⟩ √(a² + b² f/⟨f⟩ + (c s/⟨f⟩)²)
    normal = 2.0 * np.sqrt([9e-6 + 0.5 * 0.088**2 + (0.985 * 0.2) ** 2, 9e-6 + 1.5 * 0.088**2])
    tangential = 2.0 * np.sqrt([1e-6 + 0.5 * 0.008**2 + (1.206 * 0.2) ** 2, 1e-6 + 1.5 * 0.008**2])
    chain = 2.0 * np.sqrt([0.071**2 + 0.5 * 0.239**2, 0.071**2 + 1.5 * 0.239**2])
    assert normal_sd(fn, ensemble_sd) == pytest.approx(normal)
    assert tangential_sd(fn, 0.25, ensemble_sd) == pytest.approx(tangential)
    assert normal_sd(fn) == pytest.approx(chain)


def test_levels_have_their_fitted_values():
    assert (SUSPECT_CORRECTION, SUSPECT_PRESSURE_JUMP, UNBALANCED, CHAIN_UNBALANCED) == (0.25, 0.15, 0.05, 0.15)
    assert (LOAD_FRACTIONS, SETTLED_CORRECTION, SETTLED_DIFFERENCE, SETTLING_FRAMES) == ((0.62, 2.5), 0.15, 0.04, 2)
    # ū scales with the power 3/2 of the shear between photographs, within bounds
    assert rearranging_level(SHEAR) == pytest.approx(0.037)
    assert rearranging_level(2.0 * SHEAR) == pytest.approx(0.037 * 2.0**1.5)
    assert rearranging_level(0.01 * SHEAR) == pytest.approx(0.4 * 0.037)
    assert rearranging_level(100.0 * SHEAR) == pytest.approx(4.0 * 0.037)


@pytest.mark.parametrize("unknown", ["unbalance", "correction", "start_difference"])
def test_a_frame_with_unknown_evidence_is_not_settled(unknown):
    assert decide_status(replace(SOUND, **{unknown: math.nan}))[0] is not FrameStatus.SETTLED


def test_a_frame_can_be_settled_without_comparing_starts_once_the_start_is_forgotten():
    forgotten = replace(SOUND, start_difference=math.nan, start_forgotten=True)
    assert decide_status(forgotten)[0] is FrameStatus.SETTLED


def test_a_chain_without_correction_has_no_trust():
    assert math.isnan(trust(replace(SOUND, disagreement=math.nan, correction=math.nan)))
    assert not trust(replace(SOUND, hidden_fraction=math.nan)) > 0.0


def test_without_a_motion_nothing_is_assessed():
    assert math.isnan(trust(replace(SOUND, assessed=False)))
    assert trust(replace(SOUND, assessed=False, mixed_trust=0.8)) == 0.8


@pytest.mark.parametrize(("interior", "most"), [(1, 0.05), (5, 0.25), (10, 0.5)])
def test_few_interior_grains_limit_the_trust_and_are_reported(interior, most):
    few = replace(SOUND, interior=interior)
    assert trust(few) <= most < trust(SOUND)
    assert f"only {interior} grain" in describe_penalties(find_penalties(few))
