"""The compiled sweeps against the plain ones, on a packing that reaches every branch."""

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.nlgs.problem import PLATE_IMPEDANCE, inertial_impedance, kinematic_impedance, with_impedance
from rodsight.solver.nlgs.sweeping.kernels import advance, apply_forces
from rodsight.solver.nlgs.sweeping.ordering import GROUP

from tests.reference.twins.packing import LOST, make_case, make_guess
from tests.reference.twins.sweeps import PLATE, PlainSolver

pytestmark = pytest.mark.unit

# Relative to the greatest force or velocity. Sums are in another order, and a sweep propagates rounding errors to the
# next contact; a dozen sweeps leave 1e-13.
ROUNDING = 1e-11


@pytest.fixture(scope="module", params=["walls", "boundary grains and a cell"])
def case(request):
    return make_case(with_boundary=request.param != "walls")


@pytest.fixture(scope="module")
def plain(case):
    return PlainSolver(case.grains, case.motion, case.walls, case.contacts, case.material, case.impedance, case.closing)


def close_to(expected):
    expected = np.asarray(expected)
    return pytest.approx(expected, rel=0, abs=ROUNDING * np.abs(expected).max())


def state_of(problem, force):
    body, plate = np.empty_like(problem.body), np.empty_like(problem.plate)
    apply_forces(problem, body, plate, force)
    return body, plate


def test_the_case_reaches_every_branch(case, plain):
    problem = case.assemble()
    pairs = len(problem.rows) - len(problem.wall)
    assert case.grains.count >= 144
    assert problem.grouped >= 2 * GROUP
    assert pairs - problem.grouped > 0  # pairs in no group
    assert pairs % GROUP != 0  # a padded block
    assert set(problem.wall_body[:, 1]) == {0, 1, 2, 3}
    fixed = problem.wall[:, 7] != 0.0  # at the disc that is fixed to the plate
    assert fixed.sum() >= 2
    assert set(problem.wall_body[fixed, 1]) == {2}
    loaded = case.walls.loaded[problem.wall_body[:, 1]]
    assert loaded.any()
    assert not loaded.all()
    assert np.count_nonzero(problem.wall[:, 5]) == len(problem.wall)  # walls move tangentially
    assert np.count_nonzero(problem.wall[:, 4]) == len(problem.wall)  # and normally
    assert not case.motion.present.all()
    with_wall = case.contacts.with_wall
    for of in (with_wall, ~with_wall):
        assert (case.closing[of] > 0).any()
        assert (case.closing[of] == 0).any()
    assert problem.friction[0] != problem.friction[1]
    ratio = case.grains.mass / case.grains.radius**2
    assert ratio.max() > 1.5 * ratio.min()
    force = make_guess(case)
    bodies = plain.body_velocities(force)
    for _ in range(4):
        plain.sweep(bodies, force, problem.rows)
    friction = np.array([plain.friction(c) for c in range(len(force))])
    for of in (with_wall, ~with_wall):
        fn, ft, limit = force[of, 0], force[of, 1], friction[of] * force[of, 0]
        assert (fn == 0).any()
        assert ((ft == limit) & (fn > 0)).any()
        assert ((ft == -limit) & (fn > 0)).any()
        assert ((np.abs(ft) < limit) & (fn > 0)).any()


@pytest.mark.parametrize("relaxation", [1.0, 1.4])
@pytest.mark.parametrize("start", ["zero", "guess"])
def test_compiled_sweeps_are_the_plain_ones(case, plain, relaxation, start):
    problem = case.assemble()
    expected = make_guess(case) if start == "guess" else np.zeros((case.contacts.count, 2))
    force = expected[problem.rows].copy()
    body, plate = state_of(problem, force)
    bodies = plain.body_velocities(expected)
    for sweeps in (1, 5):
        advance(problem, body, plate, force, sweeps, relaxation)
        for _ in range(sweeps):
            plain.sweep(bodies, expected, problem.rows, relaxation)
        assert force == close_to(expected[problem.rows])
    present = case.motion.present
    assert body[present, :2] == close_to(bodies.velocity[present])
    assert body[present, 2] == close_to((bodies.spin * case.grains.radius)[present])
    assert plate[:, 0] == close_to(bodies.plate)


def test_forces_set_the_velocities_of_bodies(case, plain):
    problem, force = case.assemble(), make_guess(case)
    body, plate = state_of(problem, force[problem.rows])
    bodies, present = plain.body_velocities(force), case.motion.present
    assert body[present, :2] == close_to(bodies.velocity[present])
    assert body[present, 2] == close_to((bodies.spin * case.grains.radius)[present])
    assert plate[:, 0] == close_to(bodies.plate)
    assert np.all(body[list(LOST)] == 0.0)


def test_the_records_hold_the_plain_operators(case, plain):
    problem = case.assemble()
    pairs = len(problem.rows) - len(problem.wall)
    for row in range(pairs):
        wnn, wtt = plain.compliance(problem.rows[row])
        inverse = problem.pair[row // GROUP, 2, row % GROUP]
        assert inverse == pytest.approx(1.0 / wnn, rel=ROUNDING)
        assert inverse / 3.0 == pytest.approx(1.0 / wtt, rel=ROUNDING)
    for row in range(len(problem.wall)):
        wnn, wtt = plain.compliance(problem.rows[pairs + row])
        assert problem.wall[row, 2:4] == pytest.approx([1.0 / wnn, 1.0 / wtt], rel=ROUNDING)
    assert PLATE_IMPEDANCE == PLATE


def test_the_weight_of_a_lost_grain_does_not_act(case):
    assert np.all(case.assemble().external[list(LOST)] == 0.0)


def test_forces_on_the_boundary_and_on_lost_grains_need_not_balance(case):
    assert np.array_equal(case.assemble().external[:, 2] > 0.0, case.motion.present & case.grains.free)


def test_impedances_follow_the_masses(case):
    grains = case.grains
    kinematic = kinematic_impedance(grains, kappa=0.05, force_scale=40.0, velocity_scale=1e-5, formal_weight=0.2)
    mean = sum(grains.mass) / grains.count
    for k in (0, 5, 99):
        assert kinematic[k] == pytest.approx(0.05 * 40.0 / 1e-5 / 0.8 * grains.mass[k] / mean)
    inertial = inertial_impedance(grains, interval=0.5, formal_weight=0.2)
    assert inertial == pytest.approx(grains.mass / (0.5 * 0.8))


def test_another_impedance_gives_the_problem_that_is_assembled_with_it(case):
    stiffer = replace(case, impedance=3.0 * case.impedance)
    found = with_impedance(case.assemble(), case.grains, case.motion, case.walls, case.material, stiffer.impedance)
    for one, other in zip(found, stiffer.assemble(), strict=True):
        np.testing.assert_array_equal(one, other)
