"""A base drags rods against their motion and resists their turning, in every equation of equilibrium."""

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.bodies.grains import GrainMotion
from rodsight.solver.bodies.packing import BASE_ARM
from rodsight.solver.contacts.contacts import detect_contacts
from rodsight.solver.convex.program import LoadScale, assemble_balance
from rodsight.solver.nlgs.problem import assemble

from tests.solver.sequence.test_frames import sheared_frames

DRAG = 2.0  # m/s²


@pytest.fixture(scope="module")
def moved():
    packing, snapshots = sheared_frames(3)
    rotation = np.linspace(-0.01, 0.01, packing.grains.count)
    snapshots = [replace(each, rotation=k * rotation, sigma=1e-7) for k, each in enumerate(snapshots)]
    based = replace(packing, material=replace(packing.material, base_drag=DRAG))
    return packing, snapshots, based.at_frame(snapshots, 1)


def test_drag_and_moment_oppose_the_motion(moved):
    packing, snapshots, based = moved
    grains, limit = based.grains, DRAG * packing.grains.mass
    step = snapshots[1].position - snapshots[0].position
    far = np.linalg.norm(step, axis=1) > 1e-5
    assert far.sum() > 10
    assert np.linalg.norm(grains.drag, axis=1)[far] == pytest.approx(limit[far], rel=1e-3)
    assert (np.einsum("ij,ij->i", grains.drag, step) <= 0.0).all()
    turned = snapshots[1].rotation - snapshots[0].rotation
    assert (grains.moment * turned <= 0.0).all()
    fast = np.abs(turned) > 1e-3
    assert np.abs(grains.moment)[fast] == pytest.approx(0.5 * BASE_ARM * (limit * grains.radius)[fast], rel=1e-2)
    assert grains.moment_sd == pytest.approx(0.5 * BASE_ARM * limit * grains.radius)
    assert packing.at_frame(snapshots, 1) is packing


def test_both_enter_the_equilibrium_of_the_convex_program(moved):
    packing, snapshots, based = moved
    walls = packing.walls_of(snapshots[1])
    contacts = detect_contacts(packing.grains, snapshots[1].position, snapshots[1].present, walls, 1e-5)

    def load(grains):
        friction = packing.material.friction_at(contacts.with_wall)
        return assemble_balance(
            contacts, grains, walls, present=snapshots[1].present, friction=friction, scale=LoadScale(1.0)
        ).load

    n, added = packing.grains.count, load(replace(based.grains, moment_sd=None)) - load(packing.grains)
    assert added[:n] == pytest.approx(-based.grains.drag[:, 0])
    assert added[n : 2 * n] == pytest.approx(-based.grains.drag[:, 1])
    assert added[2 * n : 3 * n] == pytest.approx(-based.grains.moment / packing.grains.radius.mean())


def test_a_free_rod_is_slowed_by_both(moved):
    packing, snapshots, based = moved
    walls, n = packing.walls_of(snapshots[1]), packing.grains.count
    none = detect_contacts(packing.grains, snapshots[1].position, snapshots[1].present, walls, -1.0)
    impedance = 5.0 * packing.grains.mass

    def body(grains):
        motion = GrainMotion(snapshots[1].position, np.zeros((n, 2)), np.zeros(n), snapshots[1].present)
        return assemble(grains, motion, walls, none, packing.material, impedance).body

    moving = body(based.grains) - body(packing.grains)
    assert moving[:, :2] == pytest.approx(based.grains.drag / impedance[:, None])
    inertia = 0.5 * impedance * packing.grains.radius**2  # of a solid rod
    assert moving[:, 2] == pytest.approx(packing.grains.radius * based.grains.moment / inertia)
