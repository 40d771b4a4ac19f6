"""Agreement of the estimates of a frame, and how much of the forces its positions show."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from rodsight.solver.mixture.estimate_agreement import correlate, with_agreements, with_former_agreements

from ..assessment.test_penalties import ASSESSED

KEY = np.array([2, 5, 9])
MOTION, FORCE, BALANCE = np.array([1.0, 2.0, 4.0]), np.array([1.0, 3.0, 2.0]), np.array([3.0, 1.0, 0.0])


def agreements(sigma: float, corrected_gap: float = 0.0):
    """Evidence with the agreements of three estimates on the same pairs; overlap of the mean force: 2 µm."""
    positions = cast("Any", SimpleNamespace(contacts=SimpleNamespace(key=KEY), fn=FORCE, overlap=2e-6))
    evidence = replace(ASSESSED, corrected_gap=corrected_gap)
    return with_agreements(evidence, (KEY, MOTION), positions, (KEY, BALANCE), sigma)


def test_each_pair_of_estimates_has_its_correlation():
    found = agreements(1e-5)
    assert found.agreement == pytest.approx(np.corrcoef(MOTION, FORCE)[0, 1])
    assert found.position_agreement == pytest.approx(np.corrcoef(FORCE, BALANCE)[0, 1])
    assert found.overlap_agreement == pytest.approx(np.corrcoef(MOTION, BALANCE)[0, 1])
    assert found.agreement_age == 0


def test_positions_show_the_overlap_of_the_mean_force_over_their_noise():
    assert agreements(1e-5).shown_overlap == pytest.approx(0.2)
    assert agreements(0.0).shown_overlap == np.inf
    assert agreements(3e-6, corrected_gap=4e-6).shown_overlap == pytest.approx(0.4)  # corrected errors hide them, too


def test_agreements_are_carried_on_with_their_age():
    carried = with_former_agreements(ASSESSED, with_former_agreements(ASSESSED, agreements(1e-5)))
    assert (carried.agreement, carried.shown_overlap) == (agreements(1e-5).agreement, pytest.approx(0.2))
    assert carried.agreement_age == 2


def test_a_missing_pair_bears_no_force():
    other = np.array([2, 7])
    union = np.corrcoef([1.0, 2.0, 0.0, 4.0], [5.0, 0.0, 3.0, 0.0])[0, 1]
    assert correlate((KEY, MOTION), (other, np.array([5.0, 3.0]))) == pytest.approx(union)
