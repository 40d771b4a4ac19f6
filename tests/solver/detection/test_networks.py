"""Which pairs count at an instant of an interval, and which must close before they bear force."""

import numpy as np
import pytest

from solver.contacts.verdicts import Verdicts
from solver.detection.networks import LEAST, NearPairs, PairProbability, ProbablePairs
from tests.packings import box, motion, rods

# A row of four rods, each a little apart from the next, the first on a wall.
GRAINS = rods(0.01, 0.01, 0.01, 0.01)
STATE = motion(np.array([[0.01, 0.02], [0.0301, 0.02], [0.0503, 0.02], [0.0706, 0.02]]))
WALLS = box(0.2, 0.1)
BODIES = 8
PAIRS = np.array([0 * BODIES + 1, 1 * BODIES + 2, 2 * BODIES + 3])
LEFT = 0 * BODIES + 4 + 3  # the first rod and the left wall


def at(network, fraction, state=STATE):
    contacts, reluctance = network.at(fraction, GRAINS, state, WALLS)
    return contacts.key.tolist(), reluctance


def test_near_pairs_bear_at_once():
    key, reluctance = at(NearPairs(1.5e-4), 0.5)
    assert reluctance is None
    assert key == [PAIRS[0], LEFT]
    key, _ = at(NearPairs(1.5e-4, Verdicts(forced=PAIRS[2:], forbidden=PAIRS[:1])), 1.0)
    assert key == [LEFT, PAIRS[2]]


def test_doubtful_pairs_are_reluctant_by_the_powers_of_ten_that_they_lack():
    network = ProbablePairs(PairProbability.none(), PairProbability(PAIRS, np.array([0.9, 0.3, 0.03])))
    key, reluctance = at(network, 1.0)
    assert key == PAIRS.tolist()
    assert reluctance == pytest.approx([0.0, 0.0, 1.0])


def test_probability_goes_from_the_start_to_the_end_of_an_interval():
    start = PairProbability(PAIRS[:2], np.array([0.03, 1.0]))
    end = PairProbability(PAIRS[1:], np.array([0.2, 0.03]))
    key, reluctance = at(ProbablePairs(start, end), 0.5)
    assert key == PAIRS.tolist()
    assert reluctance == pytest.approx(np.maximum(0.0, np.log10(0.3 / np.array([0.015, 0.6, 0.015]))))
    key, reluctance = at(ProbablePairs(start, end), 1.0)
    assert key == PAIRS[1:].tolist()
    assert reluctance == pytest.approx(np.log10(0.3 / np.array([0.2, 0.03])))


def test_improbable_pairs_and_those_of_absent_grains_do_not_count():
    network = ProbablePairs(PairProbability.none(), PairProbability(PAIRS, np.array([0.9, 0.99 * LEAST, 0.9])))
    assert at(network, 1.0)[0] == [PAIRS[0], PAIRS[2]]
    for absent, left in ((0, [PAIRS[2]]), (3, [PAIRS[0]])):
        present = np.arange(4) != absent
        gone = type(STATE)(STATE.position, STATE.velocity, STATE.spin, present)
        assert at(network, 1.0, gone)[0] == left


def test_a_pair_that_is_not_named_does_not_touch():
    known = PairProbability(PAIRS[:2], np.array([0.4, 0.7]))
    assert known.of(np.array([PAIRS[1], PAIRS[2], PAIRS[0], 10**6])).tolist() == [0.7, 0.0, 0.4, 0.0]
    assert PairProbability.none().of(PAIRS).tolist() == [0.0, 0.0, 0.0]
