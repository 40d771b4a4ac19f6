"""Invariance of the forces: rotated, mirrored, scaled and renumbered problems have the same solution."""

import numpy as np
import pytest
from rodsight.solver.bodies.grains import GrainMotion, Grains
from rodsight.solver.bodies.packing import Material
from rodsight.solver.bodies.walls import Walls
from rodsight.solver.contacts.contacts import detect_contacts
from rodsight.solver.nlgs.problem import assemble
from rodsight.solver.nlgs.solve import NlgsSettings, solve

from tests.packings import squeezed_heap

# Without friction the normal forces of this heap are unique, so different visiting orders must meet; the iteration
# stops at this relative residual, and hyperstatic directions are a few hundred times softer.
RESIDUAL = 1e-12
SAME = 1e-7
MATERIAL = Material(0.0, 0.0)


@pytest.fixture
def heap():
    return squeezed_heap(np.random.default_rng(4))


def forces(grains, state, walls, material=MATERIAL, threshold=2e-4):
    contacts = detect_contacts(grains, state.position, state.present, walls, threshold)
    problem = assemble(grains, state, walls, contacts, material, grains.mass * 1e3)
    solution = solve(problem, NlgsSettings(sweeps=200_000, natural_map=RESIDUAL), every=50)
    assert solution.natural_map <= RESIDUAL
    return contacts, solution.fn


def transformed(heap, matrix):
    grains, state, walls = heap
    sign = np.linalg.det(matrix)
    endpoints, velocity = walls.endpoints @ matrix.T, walls.velocity @ matrix.T
    if sign < 0:  # mirrored walls are reversed to keep the packing on their left
        endpoints, velocity = endpoints[:, ::-1], velocity[:, ::-1]
    return (
        grains,
        GrainMotion(state.position @ matrix.T, state.velocity @ matrix.T, sign * state.spin, state.present),
        Walls(endpoints, velocity, walls.load),
    )


@pytest.mark.parametrize("degrees", [30.0, 90.0, 217.0])
def test_forces_rotate_with_the_packing(heap, degrees):
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    _, expected = forces(*heap)
    _, found = forces(*transformed(heap, np.array([[c, -s], [s, c]])))
    assert found == pytest.approx(expected, abs=SAME * expected.max())


def test_forces_are_mirrored_with_the_packing(heap):
    _, expected = forces(*heap)
    _, found = forces(*transformed(heap, np.array([[-1.0, 0.0], [0.0, 1.0]])))
    assert found == pytest.approx(expected, abs=SAME * expected.max())


def test_forces_scale_with_load_and_motion(heap):
    grains, state, walls = heap
    _, expected = forces(*heap)
    faster = GrainMotion(state.position, 3 * state.velocity, 3 * state.spin, state.present)
    _, found = forces(grains, faster, Walls(walls.endpoints, 3 * walls.velocity, 3 * walls.load))
    assert found == pytest.approx(3 * expected, abs=3 * SAME * expected.max())


def test_forces_do_not_depend_on_the_numbering_of_the_grains(heap):
    grains, state, walls = heap
    contacts, expected = forces(*heap)
    order = np.random.default_rng(0).permutation(grains.count)
    new_row = np.argsort(order)  # old row → new row
    renumbered, found = forces(
        Grains(grains.radius[order], grains.mass[order]),
        GrainMotion(state.position[order], state.velocity[order], state.spin[order], state.present[order]),
        walls,
    )
    by_pair = {frozenset((int(i), int(j))): fn for i, j, fn in zip(renumbered.i, renumbered.j, found, strict=True)}
    for i, j, fn in zip(contacts.i, contacts.j, expected, strict=True):
        new_j = int(new_row[j]) if j < grains.count else int(j)
        assert by_pair[frozenset((int(new_row[i]), new_j))] == pytest.approx(fn, abs=SAME * expected.max())


def test_mirrored_single_sweep_mirrors_friction_too():
    # One contact with friction: f_t changes its sign in the mirror, f_n does not.
    from tests.packings import motion, problem_of, rods
    from tests.verification.test_closed_forms import box_far_away

    for side in (1.0, -1.0):
        state = motion(np.array([[0.0, 0.0], [side * 0.016, 0.0]]), np.array([[side * 1e-3, 0.0], [0.0, 1e-3]]))
        problem, _ = problem_of(rods(0.008, 0.008), state, box_far_away(), friction=10.0)
        solution = solve(problem, NlgsSettings(sweeps=1))
        if side > 0:
            first = solution
    assert solution.fn == pytest.approx(first.fn, rel=1e-12)
    assert solution.ft == pytest.approx(-first.ft, rel=1e-12)
