from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.assessment.mixture_trust import compute_position_weight, expected_of_motion, reconcile_trusts
from rodsight.solver.contacts.contacts import Contacts
from rodsight.solver.mixture.field_mixing import ForceField, MixedField, mix_fields
from rodsight.solver.posterior.frame_posterior import FramePosterior

COUNT = 400
RNG_SEED = 2


def make_fields(motion_error: float, posterior_error: float) -> tuple[np.ndarray, ...]:
    """Make a truth and two fields with independent errors, in standard deviations of the truth."""
    rng = np.random.default_rng(RNG_SEED)
    truth = rng.exponential(1.0, COUNT)
    fields = [truth + error * rng.normal(size=COUNT) for error in (motion_error, posterior_error)]
    return truth, *(np.maximum(field, 0.0) for field in fields)


def make_posterior(
    fn: np.ndarray, trust: float, *, scale_known: bool = True, agreement: float = 0.99
) -> FramePosterior:
    c, none = len(fn), np.zeros(len(fn))
    contacts = Contacts(
        np.arange(c, dtype=np.int32), np.arange(1, c + 1, dtype=np.int32), none, np.tile([1.0, 0.0], (c, 1)),
        np.zeros((c, 2)), c + 1, 0,
    )  # fmt: skip
    return FramePosterior(
        contacts, fn, 0.1 * fn, none, none, np.ones(c), np.zeros((c + 1, 2)), np.zeros(c + 1), 0.0, 0.0, 0.0,
        trust, 0.99, np.ones(c + 1), np.zeros(c + 1),
    )  # fmt: skip


def mix(motion: np.ndarray, posterior: np.ndarray, motion_trust: float, posterior_trust: float) -> MixedField:
    other = make_posterior(posterior, posterior_trust)
    return mix_fields(ForceField(other.contacts.key, np.column_stack([motion, -0.2 * motion]), motion_trust), other)


def r(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.corrcoef(a, b)[0, 1])


def test_mixture_of_two_good_fields_is_better_than_either() -> None:
    truth, motion, posterior = make_fields(0.4, 0.4)
    found = mix(motion, posterior, r(motion, truth), r(posterior, truth) / 0.95)
    assert 0.3 < found.position_weight < 0.7
    assert r(found.force[:, 0], truth) > max(r(motion, truth), r(posterior, truth)) + 0.01
    assert found.trust == pytest.approx(r(found.force[:, 0], truth), abs=0.03)


def test_overconfident_posterior_gets_little_weight() -> None:
    truth, motion, posterior = make_fields(0.2, 0.9)  # as where radii are wrong
    found = mix(motion, posterior, 0.95, 0.98)
    assert found.position_weight < 0.25
    assert r(found.force[:, 0], truth) > r(motion, truth) - 0.01


def test_motion_of_low_trust_gets_little_weight() -> None:
    truth, motion, posterior = make_fields(0.9, 0.2)  # as where nothing slides
    found = mix(motion, posterior, 0.3, 0.97)
    assert found.position_weight > 0.6
    assert r(found.force[:, 0], truth) > r(posterior, truth) - 0.03


def test_motion_without_trust_has_no_weight() -> None:
    _, motion, posterior = make_fields(0.5, 0.2)
    found = mix(motion, posterior, np.nan, 0.97)
    assert found.position_weight == 1.0
    assert found.trust == pytest.approx(found.agreement, abs=1e-12)  # the agreement limits the trust


def test_trust_of_the_posterior_is_limited_by_the_trust_of_motion() -> None:
    truth, motion, posterior = make_fields(1.2, 0.8)  # as with wrong centres: the posterior's trust is too high
    found = mix(motion, posterior, 0.05, 0.97)
    assert found.agreement < 0.7
    assert found.trust < r(found.force[:, 0], truth) + 0.03


def test_no_trust_is_below_the_agreement() -> None:
    assert reconcile_trusts(0.2, 0.95, 0.8)[0] == pytest.approx(0.8)
    assert reconcile_trusts(0.9, 0.95, np.nan) == pytest.approx((0.9, 0.9025))
    assert compute_position_weight(0.0, 0.0) == 0.5
    assert compute_position_weight(0.8, 0.8) == pytest.approx(0.5)


def test_expected_correlation_sets_the_weight_but_not_the_trust() -> None:
    truth, motion, posterior = make_fields(0.2, 0.4)
    other = make_posterior(posterior, 0.97)
    bound = ForceField(other.contacts.key, np.column_stack([motion, motion]), 0.91)
    expected = replace(bound, expected=expected_of_motion(0.91, scale_known=True))
    by_bounds, found = mix_fields(bound, other), mix_fields(expected, other)
    assert found.position_weight < by_bounds.position_weight - 0.05
    assert r(found.force[:, 0], truth) > r(by_bounds.force[:, 0], truth)
    assert found.trust < r(found.force[:, 0], truth)


def test_only_high_bounds_are_raised() -> None:
    assert expected_of_motion(0.9, scale_known=True) == pytest.approx(0.955)
    assert expected_of_motion(0.6, scale_known=True) == pytest.approx(0.6)
    assert expected_of_motion(0.2, scale_known=True) == pytest.approx(0.2)
    assert np.isnan(expected_of_motion(np.nan, scale_known=True))
    bounds = np.linspace(0.0, 1.0, 101)
    assert (np.diff([expected_of_motion(each, scale_known=True) for each in bounds]) > 0.0).all()


def test_disagreeing_chains_lower_the_position_weight() -> None:
    _, motion, posterior = make_fields(0.4, 0.4)
    certain = make_posterior(posterior, 0.97)
    field = ForceField(certain.contacts.key, np.column_stack([motion, motion]), 0.7)
    assert (
        mix_fields(field, replace(certain, agreement=0.5)).position_weight < mix_fields(field, certain).position_weight
    )


def test_the_sum_of_the_forces_is_that_of_the_motion() -> None:
    _, motion, posterior = make_fields(0.4, 0.4)
    other = make_posterior(10.0 * posterior, 0.9)
    field = ForceField(other.contacts.key, np.column_stack([motion, motion]), 0.9)
    assert mix_fields(field, other).force[:, 0].sum() == pytest.approx(motion.sum())


def test_mixture_has_the_pairs_of_both_fields_inside_the_cone() -> None:
    other = make_posterior(np.arange(1.0, 6.0), 0.9)
    motion = ForceField(other.contacts.key[1:3], np.array([[2.0, 0.5], [1.0, -0.25]]), 0.9)
    found = mix_fields(motion, other)
    np.testing.assert_array_equal(found.key, other.contacts.key)
    assert (np.abs(found.force[:, 1]) <= 0.25 * found.force[:, 0] + 1e-12).all()


def test_field_without_forces_raises() -> None:
    other = make_posterior(np.ones(5), 0.9)
    with pytest.raises(ValueError, match="without forces"):
        mix_fields(ForceField(other.contacts.key, np.zeros((5, 2)), 0.9), other)
