"""Residuals of forces, visiting order and acceleration against plain implementations."""

import numpy as np
import pytest
from rodsight.solver.nlgs.acceleration import extrapolate, inner_products
from rodsight.solver.nlgs.sweeping.contact_law import project_on_cone
from rodsight.solver.nlgs.sweeping.kernels import (
    advance,
    apply_forces,
    measure_force_residual,
    measure_forces,
    measure_natural_map,
    measure_state,
)
from rodsight.solver.nlgs.sweeping.measured_sweeps import (
    advance_and_measure,
    advance_and_sample,
    equilibrium_shape,
    find_equilibrium,
    greatest_force_residual,
)
from rodsight.solver.nlgs.sweeping.ordering import GROUP, visiting_order

from tests.reference.twins.ordering import plain_order
from tests.reference.twins.packing import make_case, make_guess
from tests.reference.twins.sweeps import PlainSolver, greatest_change, mean_normal

pytestmark = pytest.mark.unit

ROUNDING = 1e-9  # relative; differences of velocities cancel some digits


@pytest.fixture(scope="module")
def case():
    return make_case()


@pytest.fixture(scope="module")
def plain(case):
    return PlainSolver(case.grains, case.motion, case.walls, case.contacts, case.material, case.impedance, case.closing)


def state_of(problem, force):
    body, plate = np.empty_like(problem.body), np.empty_like(problem.plate)
    apply_forces(problem, body, plate, force)
    return body, plate


def test_force_measures_are_those_of_the_paper(case):
    force, before = make_guess(case, 3), make_guess(case, 4)
    before[5] = force[5] = 0.0
    assert ((force == 0).all(axis=1) & (before != 0).any(axis=1)).any()  # contacts that lose their whole force
    change, norm, mean = measure_forces(force, before)
    assert change == pytest.approx(greatest_change(force, before), rel=ROUNDING)
    assert norm == pytest.approx(np.sqrt(sum(fn**2 + ft**2 for fn, ft in force)), rel=ROUNDING)
    assert mean == pytest.approx(mean_normal(force), rel=ROUNDING)


def test_a_contact_that_loses_all_its_force_counts_as_one():
    force, before = np.array([[1.0, 0.0], [0.0, 0.0]]), np.array([[1.0, 1e-6], [1e-9, 0.0]])
    assert measure_forces(force, before)[0] == 1.0
    assert measure_forces(force[:1], before[:1])[0] == pytest.approx(1e-6)
    assert measure_forces(force[1:], force[1:]) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("sweeps", [0, 3])
def test_residuals_are_those_of_the_forces(case, plain, sweeps):
    problem = case.assemble()
    force = make_guess(case)[problem.rows].copy()
    body, plate = state_of(problem, force)
    advance(problem, body, plate, force, sweeps, 1.0)
    ordered = np.empty_like(force)
    ordered[problem.rows] = force
    natural_map, (worst, mean) = plain.natural_map(ordered), plain.force_residual(ordered)
    norm = float(np.linalg.norm(force))
    assert measure_natural_map(problem, body, plate, force, norm) == pytest.approx(natural_map, rel=ROUNDING)
    assert measure_force_residual(problem, body) == pytest.approx((worst, mean), rel=ROUNDING)
    expected = natural_map, worst / mean_normal(ordered)
    assert measure_state(problem, body, plate, force) == pytest.approx(expected, rel=ROUNDING)


def test_zero_forces_under_load_have_an_infinite_residual(case):
    problem = case.assemble()
    force = np.zeros((case.contacts.count, 2))
    body, plate = state_of(problem, force)
    assert measure_natural_map(problem, body, plate, force, 0.0) == np.inf
    assert measure_state(problem, body, plate, force)[1] == 0.0


@pytest.fixture(scope="module", params=["walls", "boundary grains and a cell"])
def swept(request):
    return make_case(with_boundary=request.param != "walls")


def equilibrium_of(problem):
    equilibrium = np.empty(equilibrium_shape(len(problem.body)))
    find_equilibrium(problem, equilibrium)
    return equilibrium


def test_the_worst_force_residual_is_found_at_any_grain(case):
    problem = case.assemble()
    equilibrium = equilibrium_of(problem)
    for g in np.flatnonzero(problem.body[:, 3] > 0.0)[[0, 1, -2, -1]]:
        body = problem.body.copy()
        body[:, :2] = equilibrium[:, :2].transpose(0, 2, 1).reshape(-1, 2)[: len(body)]
        body[g, 0] += 3.0 * body[g, 3]
        body[g, 1] -= 4.0 * body[g, 3]
        assert greatest_force_residual(equilibrium, body) == pytest.approx(5.0, rel=ROUNDING)


@pytest.mark.parametrize("relaxation", [1.0, 1.4])
def test_measured_sweeps_are_the_plain_ones(swept, relaxation):
    problem = swept.assemble()
    force = make_guess(swept)[problem.rows].copy()
    body, plate = state_of(problem, force)
    unmeasured = [each.copy() for each in (body, plate, force)]
    advance_and_measure(problem, body, plate, force, equilibrium_of(problem), relaxation, np.empty((6, 3)))
    advance(problem, *unmeasured, 6, relaxation)
    assert all(np.array_equal(one, other) for one, other in zip(unmeasured, (body, plate, force), strict=True))


@pytest.mark.parametrize("relaxation", [1.0, 1.4])
def test_every_sweep_holds_its_own_residuals(swept, relaxation):
    plain = PlainSolver(
        swept.grains, swept.motion, swept.walls, swept.contacts, swept.material, swept.impedance, swept.closing
    )
    problem, count = swept.assemble(), 6
    expected = make_guess(swept)
    force = expected[problem.rows].copy()
    body, plate = state_of(problem, force)
    residuals = np.empty((count, 3))
    advance_and_measure(problem, body, plate, force, equilibrium_of(problem), relaxation, residuals)
    bodies = plain.body_velocities(expected)
    for row in range(count):
        before = expected.copy()
        plain.sweep(bodies, expected, problem.rows, relaxation)
        assert residuals[row] == pytest.approx(
            (
                greatest_change(expected, before),
                plain.natural_map(expected),
                plain.force_residual(expected)[0] / mean_normal(expected),
            ),
            rel=ROUNDING,
        )


def test_sweeps_have_the_same_residuals_however_many_are_done_at_once(case):
    problem = case.assemble()
    force = make_guess(case)[problem.rows].copy()
    body, plate = state_of(problem, force)
    again = [each.copy() for each in (body, plate, force)]
    at_once, one_by_one = np.empty((7, 3)), np.empty((7, 3))
    advance_and_measure(problem, body, plate, force, equilibrium_of(problem), 1.0, at_once)
    for row in range(len(one_by_one)):
        advance_and_measure(problem, *again, equilibrium_of(problem), 1.0, one_by_one[row : row + 1])
    assert np.array_equal(at_once, one_by_one)


@pytest.mark.parametrize("spacing", [1, 3, 10])
def test_sampled_sweeps_have_the_residuals_of_measured_ones(swept, spacing):
    problem, count = swept.assemble(), 7
    force = make_guess(swept)[problem.rows].copy()
    body, plate = state_of(problem, force)
    sampled = [each.copy() for each in (body, plate, force)]
    every, some = np.empty((count, 3)), np.empty((count, 3))
    advance_and_measure(problem, body, plate, force, equilibrium_of(problem), 1.0, every)
    advance_and_sample(problem, *sampled, equilibrium_of(problem), 1.0, some, spacing)
    measured = [*range(spacing - 1, count - 1, spacing), count - 1]
    assert np.array_equal(some[measured], every[measured])
    assert np.all(np.isnan(np.delete(some, measured, axis=0)))
    assert all(np.array_equal(one, other) for one, other in zip(sampled, (body, plate, force), strict=True))


@pytest.mark.parametrize("size", [4, GROUP])
def test_contacts_are_visited_in_the_plain_order(case, size):
    pair = ~case.contacts.with_wall
    point, i, j = case.contacts.point[pair], case.contacts.i[pair], case.contacts.j[pair]
    order, grouped = visiting_order(point, i, j, size)
    assert (order.tolist(), grouped) == plain_order(point, i, j, size)
    assert 0 < grouped < len(order)


def test_forces_are_extrapolated_and_projected_onto_their_cones():
    rng = np.random.default_rng(0)
    rows, vector = rng.normal(size=(3, 70)), rng.normal(size=70)
    assert inner_products(rows, vector) == pytest.approx(
        [sum(a * b for a, b in zip(r, vector, strict=True)) for r in rows]
    )
    force, weights = rng.normal(size=(35, 2)) + np.array([1.0, 0.0]), np.array([0.5, -0.2, 0.1])
    expected = []
    for c in range(35):
        fn, ft = (force[c, k] - sum(weights[r] * rows[r, 2 * c + k] for r in range(3)) for k in range(2))
        mu = 0.3 if c < 20 else 0.1
        fn = fn if fn > 0 else 0.0
        expected.append((fn, ft if abs(ft) <= mu * fn else np.sign(ft) * mu * fn))
    extrapolate(force, rows, weights, np.array([0.3, 0.1]), 20)
    assert force == pytest.approx(np.array(expected), abs=1e-12)


@pytest.mark.parametrize(
    ("given", "expected"),
    [((2.0, 0.1), (2.0, 0.1)), ((2.0, 3.0), (2.0, 0.5)), ((2.0, -3.0), (2.0, -0.5)), ((-1.0, 0.4), (0.0, 0.0))],
)
def test_a_force_is_projected_by_components(given, expected):
    assert project_on_cone(*given, 0.25) == expected
