"""Trust in mixtures of estimates, beside the correlations of simulated ones."""

import math
from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.assessment.mixture_trust import (
    MAX_TRUST,
    compute_position_weight,
    confirmed_trust,
    evident_position_weight,
    expected_of_motion,
    fused_trust,
    mixture_trust,
    motion_reliability,
    position_weight_terms,
    reconcile_trusts,
    soft_mixture_trust,
    weight_coefficients,
)

from tests.solver.assessment.test_status import SOUND

COUNT = 200_000


def correlation(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.corrcoef(a, b)[0, 1])


def test_the_weight_follows_the_signal_to_noise_ratios():
    # T²/(1 − T²): 0.36/0.64 = 0.5625 and 0.64/0.36 = 16/9
    assert compute_position_weight(0.6, 0.8) == pytest.approx((16 / 9) / (16 / 9 + 0.5625))
    assert compute_position_weight(0.6, 0.8, 0.5) == pytest.approx((16 / 9) / (16 / 9 + 0.28125))
    assert compute_position_weight(0.6, 0.8, 0.0) == 1.0


def test_a_mixture_correlates_as_its_trust_states():
    rng = np.random.default_rng(2)
    truth = rng.normal(size=COUNT)
    one, two = (truth + error * rng.normal(size=COUNT) for error in (0.5, 0.8))
    for weight in (0.2, 0.5, 0.8):
        mixed = (1.0 - weight) * one + weight * two
        expected = mixture_trust(
            correlation(one, truth), correlation(two, truth), correlation(one, two), weight, (one.std(), two.std())
        )
        assert correlation(mixed, truth) == pytest.approx(expected, abs=0.003)
    assert mixture_trust(1.0, 1.0, 1.0, 0.5, (np.float64(1.0), np.float64(1.0))) == MAX_TRUST


def test_both_trusts_are_consistent_with_the_agreement():
    # c = 0.45 with T_m = 0.9: the posterior's trust is 0.5
    assert reconcile_trusts(0.9, 0.95, 0.45) == pytest.approx((0.9, 0.5))
    # both agree by more than the motion's bound: so does the motion with the truth
    assert reconcile_trusts(0.5, 1.0, 0.7)[0] == pytest.approx(0.7)
    assert reconcile_trusts(np.nan, 1.0, 0.7) == pytest.approx((0.0, 0.95))


def test_the_posterior_is_trusted_beyond_the_agreement_as_far_as_the_motion_is():
    assert confirmed_trust(0.0, 0.9, 0.4) == pytest.approx(0.4)
    assert confirmed_trust(0.5, 0.9, 0.4) == pytest.approx(0.65)
    assert confirmed_trust(0.5, 0.9, np.nan) == pytest.approx(0.45)
    assert confirmed_trust(0.5, 0.6, 0.8) == pytest.approx(0.6)


def test_independent_errors_average_in_the_square_of_the_weights():
    assert fused_trust(0.9, 0.8, 0.99, 0.25) == pytest.approx(1.0 - 0.5625 * 0.1 - 0.0625 * 0.2)
    assert fused_trust(0.9, np.nan, 0.63, 0.5) == pytest.approx(1.0 - 0.25 * 0.1 - 0.25 * 0.37)
    assert fused_trust(0.9, 0.95, 0.45, 0.5) == pytest.approx(1.0 - 0.25 * 0.1 - 0.25 * 0.5)


def test_trust_in_overlaps_is_limited():
    assert soft_mixture_trust(0.9, 0.98, 0.6, 0.0) == pytest.approx(0.6)
    assert soft_mixture_trust(0.9, 0.5, 0.6, 0.25) == pytest.approx(0.25 * 0.9 + 0.75 * 0.5)


def test_without_a_load_the_bound_is_the_expectation():
    assert expected_of_motion(0.9, scale_known=False) == 0.9
    assert expected_of_motion(0.9, scale_known=True) == pytest.approx(1.0 - 0.1 * 0.45)
    assert expected_of_motion(0.725, scale_known=True) == pytest.approx(1.0 - 0.275 * (1.0 - 0.5 * 0.55))


def test_the_reliability_of_motion_has_its_fitted_values():
    evidence = replace(SOUND, correction=0.1, disagreement=0.2)
    assert motion_reliability(evidence) == pytest.approx(1.0 - 0.83 * 0.2**2.65 - 0.42 * 0.1**0.73)
    for unknown in ({"assessed": False}, {"correction": math.nan}, {"disagreement": math.nan}):
        assert math.isnan(motion_reliability(replace(evidence, **unknown)))


def test_positions_weigh_more_where_forces_correct_the_motion_and_overlaps_are_clear():

    def weight(correction, agreement, gap):
        given = replace(SOUND, correction=correction, position_agreement=agreement, power_gap=gap)
        return evident_position_weight(given)

    middle = weight(0.1, 0.9, 0.2)
    assert 0.0 < middle < 1.0
    assert weight(0.4, 0.9, 0.2) > middle > weight(0.1, 0.6, 0.2)
    assert weight(0.1, 0.9, 0.5) > middle > weight(0.1, 0.9, 0.05)
    assert weight(9.0, 0.9, 9.0) == weight(2.0, 0.9, 1.5)  # the range of the fit
    assert weight(math.nan, math.nan, math.nan) == weight(0.1, 0.5, 0.1)


def test_positions_weigh_more_where_members_disagree_and_the_estimates_agree_less():
    given = replace(SOUND, correction=0.1, position_agreement=0.9, agreement=0.8, power_gap=0.2)
    weight = evident_position_weight(given)
    assert evident_position_weight(replace(given, agreement=0.95)) < weight
    assert evident_position_weight(replace(given, agreement=0.4)) > weight
    assert evident_position_weight(replace(given, disagreement=2.0 * given.disagreement)) > weight
    unknown, equal = (replace(given, overlap_agreement=each) for each in (math.nan, 0.9))
    assert evident_position_weight(unknown) == evident_position_weight(equal)
    unknown, none = (replace(given, agreement=each) for each in (math.nan, 0.0))
    assert evident_position_weight(unknown) == evident_position_weight(none)


def test_positions_weigh_more_where_sliding_is_hidden_or_no_forces_of_the_motion_balance():
    given = replace(SOUND, correction=0.1, position_agreement=0.9, power_gap=0.2, unbalance=1e-3)
    weight = evident_position_weight(given)
    still, sliding = (
        replace(given, information=replace(given.information, slide_signal=signal)) for signal in (0.05, 8.0)
    )
    assert evident_position_weight(still) > evident_position_weight(sliding)
    assert evident_position_weight(replace(given, unbalance=0.1)) > weight
    assert evident_position_weight(replace(given, unbalance=math.nan)) == weight  # not known


def test_positions_weigh_less_where_overlaps_are_far_below_their_noise():
    given = replace(SOUND, correction=0.1, position_agreement=0.9, agreement=0.6, power_gap=0.2, shown_overlap=0.3)
    for each in (given, replace(given, loaded=False)):
        assert evident_position_weight(replace(each, shown_overlap=0.03)) < evident_position_weight(each)
        assert evident_position_weight(replace(each, shown_overlap=math.nan)) == evident_position_weight(each)


def test_positions_have_a_limited_weight_where_overlaps_are_far_below_their_noise():
    strong = replace(SOUND, correction=2.0, position_agreement=0.9, agreement=0.1, power_gap=1.0, disagreement=0.9)
    least, middle, most = (
        evident_position_weight(replace(strong, shown_overlap=each)) for each in (0.02, math.sqrt(0.06 * 0.12), 0.3)
    )
    assert (least, middle) == (pytest.approx(0.6), pytest.approx(0.8))
    assert most > 0.9
    assert evident_position_weight(replace(strong, shown_overlap=math.nan)) > 0.9
    assert evident_position_weight(replace(strong, shown_overlap=0.02, corrected_gap=1e-5)) > 0.7


def test_without_a_load_positions_have_a_weight_of_their_own():
    given = replace(SOUND, correction=0.1, position_agreement=0.9, agreement=0.6, overlap_agreement=0.5, power_gap=0.2)
    without = replace(given, loaded=False)
    for each in (given, without):
        score = position_weight_terms(each) @ weight_coefficients(loaded=each.loaded)
        assert evident_position_weight(each) == pytest.approx(1.0 / (1.0 + math.exp(-score)))
    assert evident_position_weight(without) != pytest.approx(evident_position_weight(given), abs=0.01)


def test_without_a_load_corrected_errors_of_grains_make_both_estimates_count_alike():
    given = replace(SOUND, correction=0.1, position_agreement=0.9, agreement=0.3, overlap_agreement=0.2, power_gap=0.2)
    corrected = replace(given, loaded=False, corrected_gap=5e-5)
    assert evident_position_weight(corrected) == 0.5
    assert evident_position_weight(replace(corrected, corrected_gap=0.0)) > 0.6
    loaded = replace(corrected, loaded=True)
    assert evident_position_weight(loaded) == evident_position_weight(replace(loaded, corrected_gap=0.0)) != 0.5
