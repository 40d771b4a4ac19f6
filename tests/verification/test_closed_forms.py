"""Problems whose forces are known in closed form."""

import numpy as np
import pytest
from rodsight.solver.nlgs.solve import NlgsSettings, Stop, solve

from tests.packings import box, motion, problem_of, rods

EXACT = 1e-12  # relative: a handful of floating-point operations
CONVERGED = 1e-9  # relative, of an iteration run far beyond its need


def test_two_approaching_grains_stop_each_other():
    grains = rods(0.008, 0.011)
    state = motion(np.array([[0.0, 0.0], [0.019, 0.0]]), np.array([[2e-3, 0.0], [-1e-3, 0.0]]))
    impedance = np.array([3.0, 7.0])
    problem, _ = problem_of(grains, state, box_far_away(), impedance=impedance)
    solution = solve(problem, NlgsSettings(sweeps=1))
    # The force that removes the closing velocity of 3 mm/s through 1/Z₁ + 1/Z₂.
    assert solution.fn == pytest.approx([3e-3 / (1 / 3 + 1 / 7)], rel=EXACT)
    assert solution.ft == pytest.approx([0.0], abs=EXACT)


def test_two_separating_grains_bear_no_force():
    state = motion(np.array([[0.0, 0.0], [0.016, 0.0]]), np.array([[-1e-3, 0.0], [1e-3, 0.0]]))
    problem, _ = problem_of(rods(0.008, 0.008), state, box_far_away())
    solution = solve(problem, NlgsSettings(sweeps=3))
    assert solution.fn == pytest.approx([0.0], abs=0.0)


@pytest.mark.parametrize(("friction", "sliding"), [(10.0, False), (0.1, True)])
def test_glancing_pair_sticks_or_slides_by_coulombs_law(friction, sliding):
    state = motion(np.array([[0.0, 0.0], [0.016, 0.0]]), np.array([[1e-3, 0.0], [0.0, 1e-3]]))
    impedance = np.array([2.0, 2.0])
    problem, _ = problem_of(rods(0.008, 0.008), state, box_far_away(), friction=friction, impedance=impedance)
    solution = solve(problem, NlgsSettings(sweeps=1))
    normal = 1e-3 / (1 / 2 + 1 / 2)
    stick = -1e-3 / (3 * (1 / 2 + 1 / 2))  # W_tt is three times W_nn between solid rods
    assert solution.fn == pytest.approx([normal], rel=EXACT)
    assert solution.ft == pytest.approx([-friction * normal if sliding else stick], rel=EXACT)


def test_spinning_grains_are_slowed_by_friction():
    # Both turn counter-clockwise: at the contact the surface of j moves down, that of i up.
    state = motion(np.array([[0.0, 0.0], [0.016, 0.0]]), np.array([[1e-2, 0.0], [0.0, 0.0]]), np.array([0.5, 0.5]))
    problem, _ = problem_of(rods(0.008, 0.008), state, box_far_away(), friction=10.0, impedance=np.array([2.0, 2.0]))
    solution = solve(problem, NlgsSettings(sweeps=1))
    assert solution.ft == pytest.approx([2 * 0.008 * 0.5 / 3.0], rel=EXACT)


def test_grain_between_two_walls_carries_the_load():
    grains = rods(0.008)
    problem, contacts = problem_of(
        grains, motion(np.array([[0.03, 0.008]])), box(0.06, 0.016, top_load=12.0), friction=0.3
    )
    assert contacts.count == 2
    solution = solve(problem, NlgsSettings(sweeps=2000, natural_map=1e-14), every=1)
    assert solution.stop is Stop.NATURAL_MAP
    assert solution.fn == pytest.approx([12.0, 12.0], rel=CONVERGED)
    assert solution.ft == pytest.approx([0.0, 0.0], abs=CONVERGED)


def test_stack_of_three_grains_carries_its_weight():
    grains = rods(0.008, 0.010, 0.007)
    height = np.cumsum([0.008, 0.018, 0.017])
    problem, contacts = problem_of(
        grains,
        motion(np.column_stack([np.full(3, 0.03), height])),
        box(0.06, 0.2),
        gravity=(0.0, -9.81),
    )
    solution = solve(problem, NlgsSettings(sweeps=5000, natural_map=1e-14))
    weight = grains.mass * 9.81
    expected = {(0, 1): weight[1] + weight[2], (0, 3): weight.sum(), (1, 2): weight[2]}
    for i, j, fn in zip(contacts.i, contacts.j, solution.fn, strict=True):
        assert fn == pytest.approx(expected[(int(i), int(j))], rel=CONVERGED)


def test_pyramid_of_three_carries_the_weight_of_the_top_grain():
    # Two grains on the floor held by friction, a third on top: equilibrium of the top grain gives 2 f·cos30° = m g
    # for the resultant along the branch, whatever the friction.
    grains = rods(0.01, 0.01, 0.01)
    position = np.array([[0.02, 0.01], [0.04, 0.01], [0.03, 0.01 + 0.01 * np.sqrt(3)]])
    problem, contacts = problem_of(
        grains, motion(position), box(0.2, 0.2), gravity=(0.0, -9.81), friction=0.6, threshold=1e-9
    )
    solution = solve(problem, NlgsSettings(sweeps=200_000, natural_map=1e-13), every=10)
    weight = float(grains.mass[0]) * 9.81
    force = solution.fn[:, None] * contacts.normal + solution.ft[:, None] * contacts.tangent
    upward = sum(force[c, 1] for c in range(contacts.count) if contacts.j[c] == 2)
    floor = [solution.fn[c] for c in range(contacts.count) if contacts.j[c] == 3]
    assert upward == pytest.approx(weight, rel=1e-6)
    assert floor == pytest.approx([1.5 * weight, 1.5 * weight], rel=1e-6)


def box_far_away():
    walls = box(1.0, 1.0)
    return type(walls)(walls.endpoints - 0.5, walls.velocity, walls.load)
