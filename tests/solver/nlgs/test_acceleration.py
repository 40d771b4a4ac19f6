import numpy as np
import pytest
from rodsight.solver.bodies.grains import GrainMotion
from rodsight.solver.bodies.packing import Material
from rodsight.solver.contacts.contacts import detect_contacts
from rodsight.solver.nlgs.acceleration import PERIOD, Acceleration, extrapolate, inner_products
from rodsight.solver.nlgs.problem import assemble
from rodsight.solver.nlgs.solve import NlgsSettings, Stop, solve, sweeps
from rodsight.solver.nlgs.sweeping.kernels import advance, apply_forces

from tests.benchmarks.static_problems import FRICTION, IMPEDANCE, jammed_packing
from tests.packings import squeezed_heap
from tests.solver.nlgs.test_natural_map import natural_map_of

RESIDUAL = 1e-8
ROUNDING = 1e-3  # of the residual: sums in another order


@pytest.fixture(scope="module", params=[1, 5])
def heap(request):
    """A jammed packing under load, everything at rest."""
    packing = jammed_packing(250, seed=request.param)
    material, impedance = Material(FRICTION, FRICTION), packing.grains.mass * IMPEDANCE
    return packing.grains, packing.motion, packing.walls, packing.contacts, material, impedance


def settings(window, **more):
    return NlgsSettings(**{"sweeps": 60_000, "natural_map": RESIDUAL, "acceleration": window, **more})


def test_acceleration_needs_fewer_sweeps_for_the_same_residual(heap):
    problem = assemble(*heap)
    plain = solve(problem, settings(0), every=PERIOD)
    fast = solve(problem, settings(5), every=PERIOD)
    assert plain.stop is fast.stop is Stop.NATURAL_MAP
    assert fast.sweeps < 0.5 * plain.sweeps
    assert natural_map_of(heap, fast.force) <= RESIDUAL * (1 + ROUNDING)


def test_accelerated_forces_never_leave_the_coulomb_cone(heap):
    problem = assemble(*heap)
    pairs = len(problem.rows) - len(problem.wall)
    mu = np.where(np.arange(len(problem.rows)) < pairs, *problem.friction)
    for sweep in sweeps(problem, settings(5)):
        assert np.all(sweep.force[:, 0] >= 0)
        assert np.all(np.abs(sweep.force[:, 1]) <= mu * sweep.force[:, 0])
        if sweep.number == 15 * PERIOD:
            break


def test_an_observer_does_not_change_a_bit_of_an_accelerated_solve(heap):
    problem = assemble(*heap)
    total = 210
    unobserved = solve(problem, settings(5, sweeps=total, natural_map=None), every=total)
    for every in (1, 7, 30):
        observed = solve(problem, settings(5, sweeps=total, natural_map=None), observer=lambda _: None, every=every)
        assert np.array_equal(unobserved.force, observed.force)


@pytest.mark.slow
def test_measured_sweeps_between_strides_of_an_accelerated_solve_have_the_same_residuals(heap):
    problem = assemble(*heap)
    each = np.concatenate([sweep.residuals for sweep in sweeps(problem, settings(5), every=[1] * 5 * PERIOD)])
    (found,) = (sweep.residuals for sweep in sweeps(problem, settings(5), every=[5 * PERIOD], measured=True))
    assert np.isfinite(found).all()
    assert np.array_equal(found, each)


def state_of(problem):
    force, body, plate = np.zeros((len(problem.rows), 2)), problem.body.copy(), problem.plate.copy()
    apply_forces(problem, body, plate, force)
    return force, body, plate


def advance_periods(problem, acceleration, state, periods):
    force, body, plate = state
    for _ in range(periods):
        advance(problem, body, plate, force, PERIOD, 1.0)
        acceleration.accept_or_undo(body, plate, force)
        acceleration.step(body, plate, force)


def test_a_step_that_raises_the_residual_is_undone(heap):
    problem = assemble(*heap)
    state = force, body, plate = state_of(problem)
    acceleration = Acceleration(problem, force, 5)
    advance_periods(problem, acceleration, state, 1)
    advance(problem, body, plate, force, PERIOD, 1.0)
    acceleration.accept_or_undo(body, plate, force)
    before = force.copy(), body.copy(), plate.copy()
    acceleration.step(body, plate, force)
    force *= 50.0  # as after a bad step
    apply_forces(problem, body, plate, force)
    advance(problem, body, plate, force, PERIOD, 1.0)
    assert acceleration.accept_or_undo(body, plate, force)
    assert acceleration.rejected == 1
    for found, expected in zip((force, body, plate), before, strict=True):
        assert np.array_equal(found, expected)


def test_plain_sweeps_follow_an_undone_step(heap):
    problem = assemble(*heap)
    state = force, body, plate = state_of(problem)
    acceleration = Acceleration(problem, force, 5)
    advance_periods(problem, acceleration, state, 2)
    force *= 50.0
    apply_forces(problem, body, plate, force)
    advance(problem, body, plate, force, PERIOD, 1.0)
    assert acceleration.accept_or_undo(body, plate, force)
    plain = [x.copy() for x in state]
    acceleration.step(body, plate, force)
    advance(problem, body, plate, force, PERIOD, 1.0)
    advance(problem, plain[1], plain[2], plain[0], PERIOD, 1.0)
    assert np.array_equal(force, plain[0])


def test_the_residual_falls_over_accepted_steps(heap):
    problem = assemble(*heap)
    state = state_of(problem)
    acceleration = Acceleration(problem, state[0], 5)
    advance_periods(problem, acceleration, state, 30)
    assert acceleration.accepted > 10


def test_a_fixed_point_stays_where_it_is():
    # Without motion and weight, zero forces are the solution, and no pair (f, G(f)) changes them.
    grains, state, walls = squeezed_heap(np.random.default_rng(1))
    at_rest = GrainMotion(state.position, np.zeros_like(state.velocity), np.zeros_like(state.spin), state.present)
    walls = type(walls)(walls.endpoints, walls.velocity, np.full(4, np.nan))
    contacts = detect_contacts(grains, at_rest.position, at_rest.present, walls, 2e-4)
    problem = assemble(grains, at_rest, walls, contacts, Material(0.3, 0.2), grains.mass * 1e3)
    solution = solve(problem, settings(5, sweeps=6 * PERIOD, natural_map=None))
    assert np.array_equal(solution.force, np.zeros((contacts.count, 2)))


def test_products_and_extrapolation_equal_plain_ones():
    rng = np.random.default_rng(0)
    rows, vector = rng.normal(size=(3, 70)), rng.normal(size=70)
    assert inner_products(rows, vector) == pytest.approx(rows @ vector, rel=1e-12)
    force, weights = rng.normal(size=(35, 2)), np.array([0.5, -0.2, 0.1])
    moved = (force.reshape(-1) - weights @ rows).reshape(35, 2)
    extrapolate(force, rows, weights, np.array([0.3, 0.1]), 30)
    normal = np.maximum(moved[:, 0], 0.0)
    limit = np.where(np.arange(35) < 30, 0.3, 0.1) * normal
    expected = np.column_stack([normal, np.clip(moved[:, 1], -limit, limit)])
    assert force == pytest.approx(expected, abs=1e-12)


def test_a_negative_window_is_refused():
    with pytest.raises(ValueError, match="window"):
        NlgsSettings(acceleration=-1)
