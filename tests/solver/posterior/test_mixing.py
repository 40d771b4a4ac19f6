from dataclasses import replace

import numpy as np
import pytest

from solver.contacts.contacts import Contacts
from solver.posterior.frame_posterior import FramePosterior
from solver.posterior.mixing import (
    ForceField,
    MixedField,
    believe,
    expected_correlation,
    mix_fields,
    share_of_posterior,
)

COUNT = 400
RNG_SEED = 2


def make_fields(motion_error: float, posterior_error: float) -> tuple[np.ndarray, ...]:
    """A truth and two fields with errors [of its deviation] of their own."""
    rng = np.random.default_rng(RNG_SEED)
    truth = rng.exponential(1.0, COUNT)
    fields = [truth + error * rng.normal(size=COUNT) for error in (motion_error, posterior_error)]
    return truth, *(np.maximum(field, 0.0) for field in fields)


def posterior_with(
    fn: np.ndarray, trust: float, *, scale_known: bool = True, agreement: float = 0.99
) -> FramePosterior:
    c, none = len(fn), np.zeros(len(fn))
    contacts = Contacts(
        np.arange(c, dtype=np.int32), np.arange(1, c + 1, dtype=np.int32), none, np.tile([1.0, 0.0], (c, 1)),
        np.zeros((c, 2)), c + 1, 0,
    )  # fmt: skip
    return FramePosterior(
        contacts, fn, 0.1 * fn, none, none, np.ones(c), np.zeros((c + 1, 2)), np.zeros(c + 1), 0.0, 0.0, 0.0, 0.0,
        trust, 0.99,
    )  # fmt: skip


def mix(motion: np.ndarray, posterior: np.ndarray, motion_trust: float, posterior_trust: float) -> MixedField:
    other = posterior_with(posterior, posterior_trust)
    return mix_fields(ForceField(other.contacts.key, np.column_stack([motion, -0.2 * motion]), motion_trust), other)


def r(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.corrcoef(a, b)[0, 1])


def test_two_good_fields_mixed_are_better_than_either() -> None:
    truth, motion, posterior = make_fields(0.4, 0.4)
    found = mix(motion, posterior, r(motion, truth), r(posterior, truth) / 0.95)
    assert 0.3 < found.share < 0.7
    assert r(found.force[:, 0], truth) > max(r(motion, truth), r(posterior, truth)) + 0.01
    assert found.trust == pytest.approx(r(found.force[:, 0], truth), abs=0.03)


def test_a_posterior_that_claims_too_much_gives_way_to_motion() -> None:
    truth, motion, posterior = make_fields(0.2, 0.9)  # as where radii are wrong
    found = mix(motion, posterior, 0.95, 0.98)
    assert found.share < 0.25
    assert r(found.force[:, 0], truth) > r(motion, truth) - 0.01


def test_motion_that_does_not_believe_itself_gives_way_to_the_posterior() -> None:
    truth, motion, posterior = make_fields(0.9, 0.2)  # as where nothing slides
    found = mix(motion, posterior, 0.3, 0.97)
    assert found.share > 0.6
    assert r(found.force[:, 0], truth) > r(posterior, truth) - 0.03


def test_a_field_without_a_trust_does_not_count() -> None:
    _, motion, posterior = make_fields(0.5, 0.2)
    found = mix(motion, posterior, np.nan, 0.97)
    assert found.share == 1.0
    assert found.trust == pytest.approx(found.agreement, abs=1e-12)  # no more is confirmed


def test_a_claim_of_the_posterior_counts_as_far_as_motion_is_there_to_confirm_it() -> None:
    truth, motion, posterior = make_fields(1.2, 0.8)  # as with wrong centres: both are poor, the posterior is sure
    found = mix(motion, posterior, 0.05, 0.97)
    assert found.agreement < 0.7
    assert found.trust < r(found.force[:, 0], truth) + 0.03


def test_neither_field_is_believed_worse_than_they_agree() -> None:
    assert believe(0.2, 0.95, 0.8)[0] == pytest.approx(0.8)
    assert believe(0.9, 0.95, np.nan) == pytest.approx((0.9, 0.9025))
    assert share_of_posterior(0.0, 0.0) == 0.5
    assert share_of_posterior(0.8, 0.8) == pytest.approx(0.5)


def test_what_is_expected_of_motion_sets_its_share_and_no_trust() -> None:
    truth, motion, posterior = make_fields(0.2, 0.4)
    other = posterior_with(posterior, 0.97)
    bound = ForceField(other.contacts.key, np.column_stack([motion, motion]), 0.91)
    expected = replace(bound, expected=expected_correlation(0.91))
    by_bounds, found = mix_fields(bound, other), mix_fields(expected, other)
    assert found.share < by_bounds.share - 0.05
    assert r(found.force[:, 0], truth) > r(by_bounds.force[:, 0], truth)
    assert found.trust < r(found.force[:, 0], truth)


def test_a_bound_is_exceeded_by_sound_motion_alone() -> None:
    assert expected_correlation(0.9) == pytest.approx(0.955)
    assert expected_correlation(0.6) == pytest.approx(0.6)
    assert expected_correlation(0.2) == pytest.approx(0.2)
    assert np.isnan(expected_correlation(np.nan))
    bounds = np.linspace(0.0, 1.0, 101)
    assert (np.diff([expected_correlation(each) for each in bounds]) > 0.0).all()


def test_chains_that_disagree_lower_the_share_of_the_posterior() -> None:
    _, motion, posterior = make_fields(0.4, 0.4)
    sure = posterior_with(posterior, 0.97)
    field = ForceField(sure.contacts.key, np.column_stack([motion, motion]), 0.7)
    assert mix_fields(field, replace(sure, agreement=0.5)).share < mix_fields(field, sure).share


def test_the_sum_of_the_forces_is_motions() -> None:
    _, motion, posterior = make_fields(0.4, 0.4)
    other = posterior_with(10.0 * posterior, 0.9)
    field = ForceField(other.contacts.key, np.column_stack([motion, motion]), 0.9)
    assert mix_fields(field, other).force[:, 0].sum() == pytest.approx(motion.sum())


def test_pairs_of_either_field_are_in_the_mixture_and_the_cone_is_kept() -> None:
    other = posterior_with(np.arange(1.0, 6.0), 0.9)
    motion = ForceField(other.contacts.key[1:3], np.array([[2.0, 0.5], [1.0, -0.25]]), 0.9)
    found = mix_fields(motion, other)
    np.testing.assert_array_equal(found.key, other.contacts.key)
    assert (np.abs(found.force[:, 1]) <= 0.25 * found.force[:, 0] + 1e-12).all()


def test_a_field_without_forces_is_an_error() -> None:
    other = posterior_with(np.ones(5), 0.9)
    with pytest.raises(ValueError, match="without forces"):
        mix_fields(ForceField(other.contacts.key, np.zeros((5, 2)), 0.9), other)
