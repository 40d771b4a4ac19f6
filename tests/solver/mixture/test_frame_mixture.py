"""Mixture of the motion estimate and the position-only estimate: weights, contacts, standard deviations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.contacts.contacts import Contacts
from rodsight.solver.mixture.frame_mixture import (
    HALF_WEIGHT_OVERLAP,
    MIN_OFFERED_PROBABILITY,
    ForceEstimate,
    Softness,
    mix_on_contacts,
    motion_weight,
    offered_pairs,
    overlap_scale,
)
from rodsight.solver.posterior.frame_posterior import FramePosterior

C = 300


def some_contacts(count: int = C) -> Contacts:
    i = np.arange(count, dtype=np.int32)
    return Contacts(
        i, i + np.int32(1), np.zeros(count), np.tile([1.0, 0.0], (count, 1)), np.zeros((count, 2)), count + 1, 0
    )


def make_posterior(
    fn: np.ndarray, bearing_probability: np.ndarray | None = None, trust: float = 0.97
) -> FramePosterior:
    c = len(fn)
    return FramePosterior(
        some_contacts(c), fn, 0.1 * fn, np.full(c, 0.3), np.full(c, 0.1),
        np.ones(c) if bearing_probability is None else bearing_probability,
        np.zeros((c + 1, 2)), np.zeros(c + 1), 2e-6, 0.0, 0.0, trust, 0.99, np.ones(c + 1), np.zeros(c + 1),
    )  # fmt: skip


def make_motion(fn: np.ndarray) -> ForceEstimate:
    return ForceEstimate(fn, -0.2 * fn, np.full(len(fn), 0.2), np.full(len(fn), 0.05))


@pytest.fixture
def fields() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A truth, and two fields with independent errors."""
    rng = np.random.default_rng(5)
    truth = rng.exponential(1.0, C)
    noisy = [np.maximum(truth + 0.4 * rng.normal(size=C), 0.01) for _ in range(2)]
    return truth, *noisy


def r(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.corrcoef(a, b)[0, 1])


@pytest.mark.unit
def test_mixture_is_better_than_either_and_has_the_sum_of_the_motion(fields) -> None:
    truth, one, two = fields
    positions = make_posterior(5.0 * two)
    found = mix_on_contacts(some_contacts(), make_motion(one), positions, 0.9, scale_known=True)
    assert r(found.fn, truth) > max(r(one, truth), r(two, truth)) + 0.01
    assert found.fn.sum() == pytest.approx(one.sum())
    assert found.trust < r(found.fn, truth) + 0.03


@pytest.mark.unit
def test_without_load_the_weight_follows_from_the_bound(fields) -> None:
    _, one, two = fields
    given = some_contacts(), make_motion(one), make_posterior(two), 0.9
    confirmed, alone = (mix_on_contacts(*given, scale_known=each).position_weight for each in (True, False))
    assert alone > confirmed + 0.05


@pytest.mark.unit
def test_standard_deviation_contains_the_difference_of_both(fields) -> None:
    _, one, two = fields
    found = mix_on_contacts(some_contacts(), make_motion(one), make_posterior(two), 0.9, scale_known=True)
    apart = np.abs(one - one.sum() / two.sum() * two)
    far, near = apart > np.quantile(apart, 0.9), apart < np.quantile(apart, 0.1)
    assert found.fn_sd[far].min() > found.fn_sd[near].max()
    assert found.fn_sd[near] == pytest.approx(0.25, abs=0.08)  # between those of both estimates, .2 and .3


@pytest.mark.unit
def test_variances_are_those_of_a_mixture_of_two_distributions(fields) -> None:
    _, one, two = fields
    motion, positions = make_motion(one), make_posterior(5.0 * two)
    found = mix_on_contacts(some_contacts(), motion, positions, 0.9, scale_known=True)
    u, q = found.position_weight, one.sum() / (5.0 * two.sum())
    assert 0.1 < u < 0.9
    for sd, m, p, m_sd, p_sd in (
        (found.fn_sd, motion.fn, positions.fn, 0.2, 0.3),
        (found.ft_sd, motion.ft, positions.ft, 0.05, 0.1),
    ):
        variance = (1 - u) * m_sd**2 + u * (q * p_sd) ** 2 + u * (1 - u) * (m - q * p) ** 2
        np.testing.assert_allclose(sd, np.sqrt(variance))


@pytest.mark.unit
def test_overlaps_of_soft_grains_have_all_the_weight_and_their_own_scale(fields) -> None:
    _, one, two = fields
    positions = make_posterior(3.0 * two)
    found = mix_on_contacts(
        some_contacts(), make_motion(one), positions, 0.9, scale_known=True, softness=Softness(0.6, 0.0)
    )
    assert found.fn == pytest.approx(3.0 * two)
    assert found.position_weight == 1.0
    assert found.trust == 0.6
    scaled = mix_on_contacts(
        some_contacts(), make_motion(one), positions, 0.9, scale_known=False, softness=Softness(0.6, 0.0)
    )
    assert scaled.fn.sum() == pytest.approx(one.sum())


@pytest.mark.unit
def test_motion_of_slightly_pressed_grains_has_the_weight_of_hard_ones(fields) -> None:
    _, one, two = fields
    given = some_contacts(), make_motion(one), make_posterior(3.0 * two), 0.9
    hard = mix_on_contacts(*given, scale_known=True)
    found = mix_on_contacts(*given, scale_known=True, softness=Softness(0.6))
    np.testing.assert_allclose(found.fn, hard.fn)
    np.testing.assert_allclose(found.fn_sd, hard.fn_sd)
    assert found.trust == pytest.approx(hard.trust)


@pytest.mark.unit
def test_weight_and_scale_lie_between_those_of_soft_and_hard_grains(fields) -> None:
    _, one, two = fields
    given = some_contacts(), make_motion(one), make_posterior(3.0 * two), 0.9
    found = [
        mix_on_contacts(*given, scale_known=True, softness=Softness(0.6, weight)) for weight in (1.0, 0.5, 0.1, 0.0)
    ]
    assert np.all(np.diff([each.position_weight for each in found]) > 0.0)
    assert np.all(
        np.diff([each.fn.sum() for each in found]) > 0.0
    )  # from the motion's sum to that of the positions, three times as large
    guess = mix_on_contacts(*given[:3], np.nan, scale_known=True, softness=Softness(0.6))
    np.testing.assert_allclose(guess.fn, 3.0 * two)  # no motion leads to the frame


@pytest.mark.unit
def test_motion_has_half_its_weight_at_the_limiting_overlap() -> None:
    assert motion_weight(HALF_WEIGHT_OVERLAP * 1e-4, 1e-4) == pytest.approx(0.5)
    assert motion_weight(2.0 * HALF_WEIGHT_OVERLAP * 1e-4, 1e-4) == pytest.approx(0.2)
    assert motion_weight(0.0, 1e-4) == 1.0
    assert motion_weight(1e-6, 0.0) == motion_weight(1e-6, np.nan) == 0.0


@pytest.mark.unit
def test_only_bearing_pairs_are_offered() -> None:
    bearing_probability = np.array([0.0, MIN_OFFERED_PROBABILITY - 0.01, MIN_OFFERED_PROBABILITY + 0.01, 1.0])
    assert offered_pairs(make_posterior(np.ones(4), bearing_probability)).i.tolist() == [2, 3]


@pytest.mark.unit
def test_bearing_probability_is_matched_to_the_contacts_of_the_frame(fields) -> None:
    _, one, two = fields
    positions = make_posterior(two[:-1], bearing_probability=np.linspace(0.0, 1.0, C - 1))
    found = mix_on_contacts(some_contacts(), make_motion(one), positions, 0.8, scale_known=True)
    # The keys of a packing with one grain less are others: only what has the same key counts.
    assert found.bearing_probability.shape == (C,)
    same = replace(positions, contacts=some_contacts().select(np.arange(C - 1)))
    again = mix_on_contacts(some_contacts(), make_motion(one), same, 0.8, scale_known=True)
    assert again.bearing_probability[:-1] == pytest.approx(np.linspace(0.0, 1.0, C - 1))
    assert again.bearing_probability[-1] == 0.0


@pytest.mark.unit
def test_without_motion_the_loads_give_the_scale(fields) -> None:
    _, one, two = fields
    guess, positions = make_motion(3.0 * one), make_posterior(two)
    found = mix_on_contacts(some_contacts(), guess, positions, np.nan, scale_known=True)
    np.testing.assert_allclose(found.fn, two)
    np.testing.assert_allclose(found.fn_sd, 0.3)
    unknown = mix_on_contacts(some_contacts(), guess, positions, np.nan, scale_known=False)
    assert unknown.fn.sum() == pytest.approx(guess.fn.sum())


@pytest.mark.unit
def test_unscaled_forces_of_soft_grains_follow_their_overlap(fields) -> None:
    positions = make_posterior(fields[2])  # its overlap is 2 µm
    total = float(positions.fn.sum())
    assert overlap_scale(positions, total, np.nan) == pytest.approx(1.0)
    assert overlap_scale(positions, 2.0 * total, 1e-6) == pytest.approx(1.0)
    assert overlap_scale(positions, total, 1e-6) == pytest.approx(2.0)
    assert overlap_scale(replace(positions, overlap=0.0), total, 1e-6) == 1.0
    assert overlap_scale(positions, 0.0, 1e-6) == 1.0
