"""Probability of sliding: properties that hold for any constants."""

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.contacts.contacts import ContactState
from rodsight.solver.statistics.sliding import (
    SlidingEvidence,
    cone_fraction,
    contact_state,
    sliding_probability,
    sliding_probability_at,
)


def _evidence(count: int, **changes) -> SlidingEvidence:
    """Evidence of hard, weightless, moving grains without measured sliding and with no member on the cone."""
    none = np.zeros(count)
    return replace(SlidingEvidence(np.zeros((count, 2)), none, none, none, 0.0, soft=False), **changes)


def test_members_on_the_cone_increase_the_probability():
    mobilised = np.array([0.2, 0.95, 0.95, 0.95])
    fraction = np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    measured = np.full(4, 20.0)
    found = sliding_probability(mobilised, _evidence(4, cone_fraction=fraction))
    assert found[0] < 0.05
    assert np.all(np.diff(found) > 0)
    evidence = _evidence(4, cone_fraction=fraction, slip=measured, relative_slip=0.1 * measured)
    assert sliding_probability(mobilised, evidence)[3] > 0.7
    beyond, at_limit = sliding_probability(np.array([1.6, 1.0]), _evidence(2))
    assert beyond == at_limit


def test_sliding_against_the_force_is_stronger_evidence_than_along_it():
    slip = np.array([0.0, 1.0, 8.0, -8.0])
    none, noise, against, along = sliding_probability(
        np.full(4, 0.9), _evidence(4, slip=slip, relative_slip=np.abs(slip) / 8)
    )
    assert along > 1.5 * none
    assert against > 1.3 * along
    assert noise < 1.2 * none


def test_large_sliding_in_the_interval_is_weaker_evidence():
    slip = np.array([8.0, 60.0])
    measured, jumped = sliding_probability(np.full(2, 0.9), _evidence(2, slip=slip, relative_slip=np.ones(2)))
    assert 0.3 * measured < jumped < 0.8 * measured


def test_weight_decreases_the_probability():
    mobilised = np.full(2, 0.9)
    for mobilised_friction in (None, 0.4):
        light, heavy = sliding_probability(
            mobilised, _evidence(2, weight=np.array([0.0, 0.3]), mobilised_friction=mobilised_friction)
        )
        assert heavy < 0.4 * light


def test_position_weight_increases_the_probability_most_for_soft_grains():
    mobilised = np.array([0.6])
    motion, hard, soft = (
        sliding_probability(mobilised, _evidence(1, position_weight=fraction, soft=soft))[0]
        for fraction, soft in ((0.0, False), (1.0, False), (1.0, True))
    )
    assert motion < hard < soft


def test_fresh_packing_does_not_slide_in_the_first_frame():
    slip, mobilised = np.full(1, 30.0), np.array([0.9])
    fraction = np.ones((1, 2))
    later, fresh, sheared = (
        sliding_probability(
            mobilised,
            _evidence(
                1, cone_fraction=fraction, slip=slip, relative_slip=slip / 10, mobilised_friction=mobilised_friction
            ),
        )[0]
        for mobilised_friction in (None, 0.14, 0.4)
    )
    assert fresh < 0.1 < 0.3 < sheared < later


def test_probability_without_members_follows_the_mobilisation():
    found = sliding_probability(np.array([0.1, 0.8, 1.0, 1.3]), None)
    assert found[0] < 0.05
    assert found[2] > 0.5 > found[1]
    assert found[3] == found[2]


def test_contact_state_follows_probability_and_force():
    state = contact_state(np.array([1.0, 1.0, 0.0]), np.array([0.4, 0.6, 0.9]))
    assert state.tolist() == [ContactState.STICKING, ContactState.SLIDING, ContactState.OPEN]


def test_friction_given_too_high_increases_the_corrected_probability():
    found = np.array([0.0, 0.2, 0.8, 1.0])
    assert (sliding_probability_at(found, 0.4, 0.25) > found).tolist() == [False, True, True, False]
    assert sliding_probability_at(found, 0.25, 0.25) == pytest.approx(found)
    assert sliding_probability_at(found, 0.4, 0.25, 0.0) == pytest.approx(found)  # position-only estimate


def test_cone_fractions_are_by_kind_of_member():
    convex = np.array([False, True, True])
    fn = np.array([[1.0, 1.0], [1.0, 0.0], [2.0, 1.0]])
    ft = np.array([[0.25, 0.1], [-0.25, 0.0], [0.1, 0.25]])
    assert cone_fraction(fn, ft, np.array([0.25, 0.25]), convex) == pytest.approx(np.array([[0.5, 1.0], [0.5, 0.0]]))
    assert not cone_fraction(fn[:1], ft[:1], np.array([0.25, 0.25]), convex[:1])[:, 0].any()
