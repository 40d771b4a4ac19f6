import numpy as np
import pytest
from rodsight.solver.bodies.grains import Grains
from rodsight.solver.bodies.walls import Walls
from rodsight.solver.contacts.contacts import detect_contacts
from rodsight.solver.convex.friction_estimate import (
    FACTORS,
    SlidingFrame,
    _bracket_minimum,
    _jackknife,
    _minimum,
    estimate_friction,
    relative_power_gap,
)
from rodsight.solver.convex.program import LoadScale, assemble_balance

EXACT = 1e-12  # rounding of a few terms of order one
PARABOLA = 1e-9  # a parabola through three points of a parabola has its minimum


def test_gap_is_zero_at_coulombs_limit_and_one_without_friction():
    slip, friction, fn = np.array([1.0, -0.5, 0.0]), np.full(3, 0.25), np.array([2.0, 4.0, 1.0])
    limit = -friction * fn * np.sign(slip)
    assert relative_power_gap(slip, friction, fn, limit) == pytest.approx(0.0, abs=EXACT)
    assert relative_power_gap(slip, friction, fn, np.zeros(3)) == pytest.approx(1.0, abs=EXACT)
    assert relative_power_gap(slip, friction, fn, -limit) == pytest.approx(2.0, abs=EXACT)


def test_gap_is_unknown_where_nothing_slides():
    assert np.isnan(relative_power_gap(np.zeros(2), np.ones(2), np.ones(2), np.zeros(2)))


def wedge(tilt: float) -> SlidingFrame:
    """A grain dragged by a plate against a tilted side: it slides on floor, plate and side."""
    r = 0.01
    grains = Grains.of_rods(np.array([r]), density=2700.0, length=0.06)
    corner = np.array([[0.0, 0.0], [0.2, 0.0], [0.2, 2 * r], [0.0, 2 * r]])
    endpoints = np.stack([corner, np.roll(corner, -1, axis=0)], axis=1)
    along = np.array([np.sin(tilt), np.cos(tilt)])
    outward = np.array([along[1], -along[0]])
    foot = np.array([0.1, r]) + r * outward
    endpoints[1] = np.stack([foot - 0.05 * along, foot + 0.05 * along])
    walls = Walls(endpoints, np.zeros((4, 2, 2)), np.array([np.nan, np.nan, 20.0, np.nan]))
    contacts = detect_contacts(grains, np.array([[0.1, r]]), np.ones(1, bool), walls, 1e-9)
    balance = assemble_balance(
        contacts, grains, walls, present=np.ones(1, bool), friction=np.full(contacts.count, 0.25), scale=LoadScale(20.0)
    )
    slip = np.zeros(contacts.count)
    slip[contacts.j == 3] = -1.0
    return SlidingFrame(balance, contacts, slip, np.ones(contacts.count))


def test_trials_are_sorted_and_every_gap_reported():
    estimate = estimate_friction([wedge(0.1)] * 3, factors=(2.0, 0.5, 1.0))
    assert estimate.trial.tolist() == [0.5, 1.0, 2.0]
    assert estimate.gap.shape == (3,)
    assert np.all(np.isfinite(estimate.gap))


def test_a_minimum_at_the_edge_is_not_enclosed():
    trial = np.array([0.5, 0.7, 1.0])
    assert _minimum(trial, trial) == (0.5, False)
    assert _minimum(trial, -trial) == (1.0, False)


def test_few_frames_have_no_standard_deviation():
    assert np.isnan(estimate_friction([wedge(0.1)] * 2).factor_sd)
    assert estimate_friction([wedge(0.1)] * 3).factor_sd >= 0


def test_no_sliding_gives_no_estimate():
    frame = wedge(0.1)
    no_slip = SlidingFrame(frame.balance, frame.contacts, np.zeros_like(frame.slip), frame.probability)
    estimate = estimate_friction([no_slip])
    assert np.isnan(estimate.factor)
    assert not estimate.enclosed


def test_the_minimum_between_trials_is_found():
    trial = np.array([0.6, 0.8, 1.0, 1.3, 1.7])
    factor, enclosed = _minimum(trial, 0.05 + np.log(trial / 0.93) ** 2)
    assert enclosed
    assert factor == pytest.approx(0.93, rel=PARABOLA)


def test_too_few_trials_are_refused():
    with pytest.raises(ValueError, match="three trial factors"):
        estimate_friction([wedge(0.1)], factors=(1.0, 1.2))
    with pytest.raises(ValueError, match="at least one frame"):
        estimate_friction([])


def test_every_trial_is_solved_with_its_own_friction():
    frame = wedge(0.2)
    twisted = SlidingFrame(frame.balance, frame.contacts, np.array([-1.0, 1.0, -1.0]), frame.probability)
    gap = estimate_friction([twisted], factors=(0.5, 1.0, 2.0)).gap
    # With more friction the grain can oppose more of this sliding.
    assert gap[0] > 1.1 * gap[1] > 1.2 * gap[2]


def power_gaps(lowest: np.ndarray) -> np.ndarray:
    """Gaps (f, q) at FACTORS of frames with their minimum at these factors (f,)."""
    return 0.1 + np.log(np.array(FACTORS) / lowest[:, None]) ** 2


@pytest.mark.parametrize("workers", [1, 3])
@pytest.mark.parametrize("lowest", [0.3, 0.55, 0.75, 0.92, 1.0, 1.1, 1.5, 2.5])
def test_bracketing_finds_the_minimum_of_all_trials(lowest: float, workers: int):
    gaps, trial = power_gaps(lowest * np.linspace(0.9, 1.1, 8)), np.array(FACTORS)
    evaluated, gap = _bracket_minimum(trial, lambda factor: gaps[:, FACTORS.index(factor)], workers)
    assert list(evaluated) == sorted(evaluated)
    assert _minimum(evaluated, gap.mean(axis=0)) == _minimum(trial, gaps.mean(axis=0))
    assert _jackknife(evaluated, gap) == _jackknife(trial, gaps)


def test_few_trials_are_needed_where_the_given_friction_is_right():
    gaps = power_gaps(np.full(8, 0.92))
    evaluated, _ = _bracket_minimum(np.array(FACTORS), lambda factor: gaps[:, FACTORS.index(factor)])
    assert len(evaluated) <= 6


def test_bracketing_covers_every_leave_one_out_minimum():
    gaps = power_gaps(np.array([0.5, 1.0, 2.0]))  # without one of them: 0.71, 1 or 1.41
    evaluated, gap = _bracket_minimum(np.array(FACTORS), lambda factor: gaps[:, FACTORS.index(factor)])
    assert evaluated[0] < 0.7
    assert evaluated[-1] > 1.45
    assert _jackknife(evaluated, gap) == _jackknife(np.array(FACTORS), gaps)
