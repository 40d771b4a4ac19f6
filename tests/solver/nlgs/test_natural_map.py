"""The residuals of the solver against plain implementations."""

import numpy as np
import pytest
from rodsight.solver.bodies.packing import Material
from rodsight.solver.contacts.contacts import detect_contacts
from rodsight.solver.nlgs.problem import assemble
from rodsight.solver.nlgs.solve import NlgsSettings, relative_force_residual, solve, sweeps

from tests.packings import squeezed_heap

ROUNDING = 1e-9  # relative


def body_velocities(heap, force):
    """Velocities and surface speeds ω R of grains and walls under forces (c, 2) in the order of the contacts."""
    grains, state, walls, contacts, material, impedance = heap
    n = grains.count
    velocity = state.velocity + np.asarray(material.gravity) * (grains.mass / impedance)[:, None]
    velocity = np.concatenate([velocity, np.zeros((walls.count, 2))])
    surface = np.concatenate([state.spin * grains.radius, np.zeros(walls.count)])
    every = np.concatenate([impedance, np.full(walls.count, np.inf)])
    vector = force[:, :1] * contacts.normal + force[:, 1:] * contacts.tangent
    for body, sign in ((contacts.i, -1.0), (contacts.j, 1.0)):
        np.add.at(velocity, body, sign * vector / every[body, None])
        np.add.at(surface, body, -2.0 * force[:, 1] / every[body])
    for w in np.flatnonzero(walls.loaded):
        net_load = force[contacts.j == n + w, 0].sum() - walls.load[w]
        velocity[n + w] = net_load / (30.0 * impedance.mean()) * walls.outward[w]
    return velocity, surface


def natural_map_of(heap, force):
    grains, _, walls, contacts, material, impedance = heap
    velocity, surface = body_velocities(heap, force)
    i, j, n = contacts.i, contacts.j, grains.count
    opening = velocity[j] - velocity[i]
    un = (opening * contacts.normal).sum(axis=1)
    ut = (opening * contacts.tangent).sum(axis=1) - surface[i] - surface[j]
    w = 1.0 / np.concatenate([impedance, np.full(walls.count, np.inf)])
    plate = np.concatenate([np.zeros(n), np.where(walls.loaded, 1.0 / (30.0 * impedance.mean()), 0.0)])
    normal = np.maximum(force[:, 0] - un / (w[i] + w[j] + plate[j]), 0.0)
    limit = np.where(contacts.with_wall, material.wall_friction, material.friction) * normal
    tangential = np.clip(force[:, 1] - ut / (3.0 * (w[i] + w[j])), -limit, limit)
    return float(np.linalg.norm(force - np.column_stack([normal, tangential])) / np.linalg.norm(force))


@pytest.fixture(scope="module")
def heap():
    grains, state, walls = squeezed_heap(np.random.default_rng(3), columns=12, rows=12)
    contacts = detect_contacts(grains, state.position, state.present, walls, 2e-4)
    return grains, state, walls, contacts, Material(0.3, 0.2, 0.0, (0.0, -9.81)), grains.mass * 1e3


@pytest.mark.parametrize("number", [1, 3, 40])
def test_the_natural_map_is_that_of_the_forces(heap, number):
    solution = solve(assemble(*heap), NlgsSettings(sweeps=number))
    assert solution.natural_map == pytest.approx(natural_map_of(heap, solution.force), rel=ROUNDING)


def test_residuals_of_observed_sweeps_are_those_of_the_forces(heap):
    problem = assemble(*heap)
    before = np.zeros((len(problem.rows), 2))
    for sweep in sweeps(problem, NlgsSettings()):
        force = np.empty_like(before)
        force[problem.rows] = sweep.force
        size, change = np.linalg.norm(force, axis=1), np.linalg.norm(force - before, axis=1)
        relative = np.where(size > 0, change / np.where(size > 0, size, 1.0), (change > 0) * 1.0)
        assert sweep.force_change == pytest.approx(relative.max(), rel=ROUNDING)
        assert sweep.natural_map == pytest.approx(natural_map_of(heap, force), rel=ROUNDING)
        assert sweep.unbalance == pytest.approx(relative_force_residual(problem, force)[0], rel=ROUNDING)
        before = force
        if sweep.number == 10:
            break
