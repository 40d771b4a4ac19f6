"""Motion and positions as two witnesses: who is heard, on which contacts, with which deviations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver.contacts.contacts import Contacts
from solver.mixture.mixing import OFFERED, PRESSED, Field, mix_on, offered_pairs, worth_of_motion
from solver.posterior.frame_posterior import FramePosterior

C = 300


def some_contacts(count: int = C) -> Contacts:
    i = np.arange(count, dtype=np.int32)
    return Contacts(
        i, i + np.int32(1), np.zeros(count), np.tile([1.0, 0.0], (count, 1)), np.zeros((count, 2)), count + 1, 0
    )


def told_by_positions(fn: np.ndarray, bears: np.ndarray | None = None, trust: float = 0.97) -> FramePosterior:
    c = len(fn)
    return FramePosterior(
        some_contacts(c), fn, 0.1 * fn, np.full(c, 0.3), np.full(c, 0.1), np.ones(c) if bears is None else bears,
        np.zeros((c + 1, 2)), np.zeros(c + 1), 2e-6, 1e-6, 0.0, 0.0, trust, 0.99,
    )  # fmt: skip


def told_by_motion(fn: np.ndarray) -> Field:
    return Field(fn, -0.2 * fn, np.full(len(fn), 0.2), np.full(len(fn), 0.05))


@pytest.fixture
def fields() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A truth, and two fields that are wrong in ways of their own."""
    rng = np.random.default_rng(5)
    truth = rng.exponential(1.0, C)
    noisy = [np.maximum(truth + 0.4 * rng.normal(size=C), 0.01) for _ in range(2)]
    return truth, *noisy


def r(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.corrcoef(a, b)[0, 1])


@pytest.mark.unit
def test_the_mixture_is_nearer_to_the_truth_than_either_and_has_the_sum_of_the_motion(fields) -> None:
    truth, one, two = fields
    told = told_by_positions(5.0 * two)
    found = mix_on(some_contacts(), told_by_motion(one), told, 0.9, own_scale=True, soft_trust=None)
    assert r(found.fn, truth) > max(r(one, truth), r(two, truth)) + 0.01
    assert found.fn.sum() == pytest.approx(one.sum())
    assert found.trust < r(found.fn, truth) + 0.03


@pytest.mark.unit
def test_motion_counts_by_its_bound_alone_where_no_load_confirms_it(fields) -> None:
    _, one, two = fields
    given = some_contacts(), told_by_motion(one), told_by_positions(two), 0.9
    confirmed, alone = (mix_on(*given, own_scale=each, soft_trust=None).share for each in (True, False))
    assert alone > confirmed + 0.05


@pytest.mark.unit
def test_the_deviation_holds_what_the_two_differ_by(fields) -> None:
    _, one, two = fields
    found = mix_on(some_contacts(), told_by_motion(one), told_by_positions(two), 0.9, own_scale=True, soft_trust=None)
    apart = np.abs(one - one.sum() / two.sum() * two)
    far, near = apart > np.quantile(apart, 0.9), apart < np.quantile(apart, 0.1)
    assert found.spread_fn[far].min() > found.spread_fn[near].max()
    assert found.spread_fn[near] == pytest.approx(0.25, abs=0.08)  # between those of the witnesses, .2 and .3


@pytest.mark.unit
def test_overlaps_of_soft_grains_speak_alone_and_in_their_own_unit(fields) -> None:
    _, one, two = fields
    positions = told_by_positions(3.0 * two)
    found = mix_on(some_contacts(), told_by_motion(one), positions, 0.9, own_scale=True, soft_trust=0.6, worth=0.0)
    assert found.fn == pytest.approx(3.0 * two)
    assert found.share == 1.0
    assert found.trust == 0.6
    scaled = mix_on(some_contacts(), told_by_motion(one), positions, 0.9, own_scale=False, soft_trust=0.6, worth=0.0)
    assert scaled.fn.sum() == pytest.approx(one.sum())


@pytest.mark.unit
def test_motion_of_grains_that_are_hardly_pressed_counts_as_of_hard_ones(fields) -> None:
    _, one, two = fields
    given = some_contacts(), told_by_motion(one), told_by_positions(3.0 * two), 0.9
    hard = mix_on(*given, own_scale=True, soft_trust=None)
    found = mix_on(*given, own_scale=True, soft_trust=0.6, worth=1.0)
    np.testing.assert_allclose(found.fn, hard.fn)
    np.testing.assert_allclose(found.spread_fn, hard.spread_fn)
    assert found.trust == pytest.approx(hard.trust)


@pytest.mark.unit
def test_between_soft_and_hard_shares_and_scale_lie_between(fields) -> None:
    _, one, two = fields
    given = some_contacts(), told_by_motion(one), told_by_positions(3.0 * two), 0.9
    found = [mix_on(*given, own_scale=True, soft_trust=0.6, worth=worth) for worth in (1.0, 0.5, 0.1, 0.0)]
    assert np.all(np.diff([each.share for each in found]) > 0.0)
    assert np.all(
        np.diff([each.fn.sum() for each in found]) > 0.0
    )  # from the motion's to the positions', three times it
    guess = mix_on(*given[:3], np.nan, own_scale=True, soft_trust=0.6, worth=1.0)
    np.testing.assert_allclose(guess.fn, 3.0 * two)  # no motion led there


@pytest.mark.unit
def test_motion_is_worth_half_where_overlap_hides_it() -> None:
    assert worth_of_motion(PRESSED * 1e-4, 1e-4) == pytest.approx(0.5)
    assert worth_of_motion(0.0, 1e-4) == 1.0
    assert worth_of_motion(1e-6, 0.0) == worth_of_motion(1e-6, np.nan) == 0.0


@pytest.mark.unit
def test_pairs_that_bear_are_offered_and_others_are_not() -> None:
    bears = np.array([0.0, OFFERED - 0.01, OFFERED + 0.01, 1.0])
    assert offered_pairs(told_by_positions(np.ones(4), bears)).i.tolist() == [2, 3]


@pytest.mark.unit
def test_what_bears_is_said_on_the_contacts_of_the_frame(fields) -> None:
    _, one, two = fields
    positions = told_by_positions(two[:-1], bears=np.linspace(0.0, 1.0, C - 1))
    found = mix_on(some_contacts(), told_by_motion(one), positions, 0.8, own_scale=True, soft_trust=None)
    # The keys of a packing with one grain less are others: only what has the same key counts.
    assert found.bears.shape == (C,)
    same = replace(positions, contacts=some_contacts().select(np.arange(C - 1)))
    again = mix_on(some_contacts(), told_by_motion(one), same, 0.8, own_scale=True, soft_trust=None)
    assert again.bears[:-1] == pytest.approx(np.linspace(0.0, 1.0, C - 1))
    assert again.bears[-1] == 0.0


@pytest.mark.unit
def test_without_motion_that_leads_to_a_frame_loads_give_the_scale(fields) -> None:
    _, one, two = fields
    guess, told = told_by_motion(3.0 * one), told_by_positions(two)
    found = mix_on(some_contacts(), guess, told, np.nan, own_scale=True, soft_trust=None)
    np.testing.assert_allclose(found.fn, two)
    np.testing.assert_allclose(found.spread_fn, 0.3)
    unknown = mix_on(some_contacts(), guess, told, np.nan, own_scale=False, soft_trust=None)
    assert unknown.fn.sum() == pytest.approx(guess.fn.sum())
