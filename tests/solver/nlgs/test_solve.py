import numpy as np
import pytest
from rodsight.solver.bodies.packing import Material
from rodsight.solver.contacts.contacts import detect_contacts
from rodsight.solver.nlgs.problem import assemble
from rodsight.solver.nlgs.solve import NlgsSettings, Stop, solve, sweeps, to_contact_order

from tests.packings import box, motion, problem_of, rods, squeezed_heap
from tests.reference.twins.sweeps import plain_sweeps

ROUNDING = 1e-10  # relative; the compiled sweep sums in another order than the plain one


@pytest.fixture
def heap():
    grains, state, walls = squeezed_heap(np.random.default_rng(1))
    contacts = detect_contacts(grains, state.position, state.present, walls, 2e-4)
    material = Material(0.3, 0.2, 0.0, (0.0, -9.81))
    impedance = grains.mass * 1e3
    return grains, state, walls, contacts, material, impedance


def test_compiled_sweeps_equal_plain_ones(heap):
    problem = assemble(*heap)
    found = solve(problem, NlgsSettings(sweeps=7))
    expected = plain_sweeps(*heap, problem.rows, 7)
    scale = np.abs(expected).max()
    assert found.fn == pytest.approx(expected[:, 0], abs=ROUNDING * scale)
    assert found.ft == pytest.approx(expected[:, 1], abs=ROUNDING * scale)


@pytest.mark.parametrize(("every", "measured"), [(1, False), (7, False), (20, True), ((1, 30, 11), True)])
def test_an_observer_does_not_change_a_bit(heap, every, measured):
    problem = assemble(*heap)
    unobserved = solve(problem, NlgsSettings(sweeps=60))
    received = []
    observed = solve(problem, NlgsSettings(sweeps=60), observer=received.append, every=every, measured=measured)
    assert np.array_equal(unobserved.fn, observed.fn)
    assert np.array_equal(unobserved.ft, observed.ft)
    assert (
        unobserved.sweeps
        == observed.sweeps
        == received[-1].number
        == sum(len(sweep.residuals) for sweep in received)
        == 60
    )


def test_strides_select_the_observed_sweeps(heap):
    problem = assemble(*heap)
    assert [sweep.number for sweep in sweeps(problem, NlgsSettings(), every=(1, 30, 11))] == [1, 31, 42]
    received = []
    solve(problem, NlgsSettings(sweeps=35), observer=lambda sweep: received.append(sweep.number), every=(1, 30, 11))
    assert received == [1, 31, 35]


def test_sweeps_between_strides_are_measured_on_request(heap):
    problem = assemble(*heap)
    each = np.concatenate([sweep.residuals for sweep in sweeps(problem, NlgsSettings(), every=[1] * 40)])
    (all_,) = (sweep.residuals for sweep in sweeps(problem, NlgsSettings(), every=[39], measured=True))
    (last,) = (sweep.residuals for sweep in sweeps(problem, NlgsSettings(), every=[39]))
    assert np.array_equal(all_, each[:39])
    assert np.array_equal(np.flatnonzero(np.isfinite(last).any(axis=1)), [38])
    assert np.array_equal(last[38], each[38])


def test_every_force_lies_in_the_coulomb_cone(heap):
    problem, (*_, contacts, material, _) = assemble(*heap), heap
    for number, sweep in enumerate(sweeps(problem, NlgsSettings())):
        force = to_contact_order(problem, sweep.force)
        mu = np.where(contacts.with_wall, material.wall_friction, material.friction)
        assert np.all(force[:, 0] >= 0)
        assert np.all(np.abs(force[:, 1]) <= mu * force[:, 0])
        if number == 20:
            break


def test_residuals_fall_as_a_load_is_transmitted():
    radius = 0.008
    column = motion(np.column_stack([np.full(6, 0.03), radius * (2 * np.arange(6) + 1)]))
    problem, _ = problem_of(rods(*[radius] * 6), column, box(0.06, 12 * radius, top_load=12.0))
    coarse = solve(problem, NlgsSettings(sweeps=20))
    fine = solve(problem, NlgsSettings(sweeps=5000))
    assert fine.natural_map < 1e-3 * coarse.natural_map
    assert fine.unbalance < 1e-2 * coarse.unbalance


def test_a_solution_states_how_the_solve_ended():
    problem, _ = problem_of(rods(0.008), motion(np.array([[0.03, 0.008]])), box(0.06, 0.016, top_load=12.0))
    assert solve(problem, NlgsSettings(sweeps=2)).stop is Stop.SWEEPS
    assert solve(problem, NlgsSettings(sweeps=9000, natural_map=1e-9)).stop is Stop.NATURAL_MAP
    assert solve(problem, NlgsSettings(sweeps=9000, force_change=1e-6)).stop is Stop.FORCE_CHANGE
    free_grain, _ = problem_of(rods(0.008), motion(np.array([[0.03, 0.01]])), box(0.06, 0.03))
    assert solve(free_grain, NlgsSettings()).stop is Stop.EMPTY


def test_a_guess_is_in_the_order_of_the_contacts(heap):
    problem = assemble(*heap)
    first = solve(problem, NlgsSettings(sweeps=30))
    onward = solve(problem, NlgsSettings(sweeps=30), guess=first.force)
    straight = solve(problem, NlgsSettings(sweeps=60))
    scale = straight.fn.max()
    assert onward.fn == pytest.approx(straight.fn, abs=1e-9 * scale)  # body velocities are recomputed at a restart


@pytest.mark.parametrize("bad", [{"sweeps": -1}, {"relaxation": 2.0}, {"relaxation": 0.0}])
def test_invalid_settings_are_refused(bad):
    with pytest.raises(ValueError, match=r"relaxation|sweeps"):
        NlgsSettings(**bad)
