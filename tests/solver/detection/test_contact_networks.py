"""Contacts at an instant of an interval, and the distances they must close to bear force."""

import numpy as np
import pytest
from rodsight.solver.contacts.verdicts import Verdicts
from rodsight.solver.detection.contact_networks import LEAST, PairProbability, ProbabilityNetwork, ThresholdNetwork

from tests.packings import box, motion, rods

# A row of four rods with small gaps, the first on a wall.
GRAINS = rods(0.01, 0.01, 0.01, 0.01)
STATE = motion(np.array([[0.01, 0.02], [0.0301, 0.02], [0.0503, 0.02], [0.0706, 0.02]]))
WALLS = box(0.2, 0.1)
BODIES = 8
PAIRS = np.array([0 * BODIES + 1, 1 * BODIES + 2, 2 * BODIES + 3])
LEFT = 0 * BODIES + 4 + 3  # the first rod and the left wall


def at(network, fraction, state=STATE):
    contacts, closing_distance = network.at(fraction, GRAINS, state, WALLS)
    return contacts.key.tolist(), closing_distance


def test_pairs_below_the_threshold_have_no_closing_distance():
    key, closing_distance = at(ThresholdNetwork(1.5e-4), 0.5)
    assert closing_distance is None
    assert key == [PAIRS[0], LEFT]
    key, _ = at(ThresholdNetwork(1.5e-4, Verdicts(forced=PAIRS[2:], forbidden=PAIRS[:1])), 1.0)
    assert key == [LEFT, PAIRS[2]]


def test_closing_distance_is_the_logarithm_of_the_missing_probability():
    network = ProbabilityNetwork(PairProbability.none(), PairProbability(PAIRS, np.array([0.9, 0.3, 0.03])))
    key, closing_distance = at(network, 1.0)
    assert key == PAIRS.tolist()
    assert closing_distance == pytest.approx([0.0, 0.0, 1.0])


def test_probability_is_linear_over_the_interval():
    start = PairProbability(PAIRS[:2], np.array([0.03, 1.0]))
    end = PairProbability(PAIRS[1:], np.array([0.2, 0.03]))
    key, closing_distance = at(ProbabilityNetwork(start, end), 0.5)
    assert key == PAIRS.tolist()
    assert closing_distance == pytest.approx(np.maximum(0.0, np.log10(0.3 / np.array([0.015, 0.6, 0.015]))))
    key, closing_distance = at(ProbabilityNetwork(start, end), 1.0)
    assert key == PAIRS[1:].tolist()
    assert closing_distance == pytest.approx(np.log10(0.3 / np.array([0.2, 0.03])))


def test_improbable_pairs_and_those_of_absent_grains_are_no_contacts():
    network = ProbabilityNetwork(PairProbability.none(), PairProbability(PAIRS, np.array([0.9, 0.99 * LEAST, 0.9])))
    assert at(network, 1.0)[0] == [PAIRS[0], PAIRS[2]]
    for absent, left in ((0, [PAIRS[2]]), (3, [PAIRS[0]])):
        present = np.arange(4) != absent
        absent_state = type(STATE)(STATE.position, STATE.velocity, STATE.spin, present)
        assert at(network, 1.0, absent_state)[0] == left


def test_unknown_pair_has_zero_probability():
    known = PairProbability(PAIRS[:2], np.array([0.4, 0.7]))
    assert known.of(np.array([PAIRS[1], PAIRS[2], PAIRS[0], 10**6])).tolist() == [0.7, 0.0, 0.4, 0.0]
    assert PairProbability.none().of(PAIRS).tolist() == [0.0, 0.0, 0.0]
