"""Invariance under rotation of the axes, and scaling of forces."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rodsight.solver.bodies.grains import GrainMotion
from rodsight.solver.bodies.packing import Material
from rodsight.solver.bodies.walls import Walls
from rodsight.solver.contacts.contacts import detect_contacts
from rodsight.solver.contacts.kinematics import equilibrium_matrix, external_load, relative_motion
from rodsight.solver.nlgs.problem import PreparedContacts, assemble
from rodsight.solver.nlgs.solve import NlgsSettings, solve
from rodsight.solver.statistics.fabric import anisotropies, contact_fabric, fabric_anisotropy
from rodsight.solver.statistics.stress import (
    branch_vectors,
    contact_force_vectors,
    friction_angle,
    love_weber_stress,
    principal_stresses,
)

from tests.packings import squeezed_heap

ROUNDING = 1e-9  # relative, of a rotation and its inverse
ANGLES = st.floats(-np.pi, np.pi)
SPEEDS = st.floats(-1.0, 1.0)

GRAINS, MOTION, WALLS = squeezed_heap(np.random.default_rng(6), columns=4, rows=4)
CONTACTS = detect_contacts(GRAINS, MOTION.position, MOTION.present, WALLS, 4e-4)


def matrix(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def rotated(angle, velocity=None, wall_velocity=None):
    """Motion, walls and contacts rotated by an angle."""
    rotation = matrix(angle)
    velocity = MOTION.velocity if velocity is None else velocity
    wall_velocity = WALLS.velocity if wall_velocity is None else wall_velocity
    motion = GrainMotion(MOTION.position @ rotation.T, velocity @ rotation.T, MOTION.spin, MOTION.present)
    walls = Walls(WALLS.endpoints @ rotation.T, wall_velocity @ rotation.T, WALLS.load)
    return motion, walls, detect_contacts(GRAINS, motion.position, motion.present, walls, 4e-4)


def some_forces(seed):
    rng = np.random.default_rng(seed)
    return rng.exponential(1.0, CONTACTS.count), rng.normal(0.0, 0.2, CONTACTS.count)


@given(SPEEDS, SPEEDS, SPEEDS)
def test_rigid_motion_has_no_relative_motion(vx, vy, spin):
    def velocity(point):
        return np.array([vx, vy]) + spin * np.stack([-point[..., 1], point[..., 0]], axis=-1)

    walls = Walls(WALLS.endpoints, velocity(WALLS.endpoints), WALLS.load)
    un, ut = relative_motion(CONTACTS, GRAINS.radius, velocity(MOTION.position), np.full(GRAINS.count, spin), walls)
    # The contact point is half a gap from either surface, which gives this relative motion.
    tolerance = ROUNDING + 0.5 * abs(spin) * np.abs(CONTACTS.gap).max() * 2.0
    assert np.abs(un).max() <= ROUNDING
    assert np.abs(ut).max() <= tolerance


@given(ANGLES, st.integers(0, 99))
def test_relative_motion_does_not_depend_on_the_observers_axes(angle, seed):
    rng = np.random.default_rng(seed)
    velocity, wall_velocity = rng.normal(size=(GRAINS.count, 2)), rng.normal(size=(4, 2, 2))
    walls = Walls(WALLS.endpoints, wall_velocity, WALLS.load)
    expected = relative_motion(CONTACTS, GRAINS.radius, velocity, MOTION.spin, walls)
    motion, walls, contacts = rotated(angle, velocity, wall_velocity)
    found = relative_motion(contacts, GRAINS.radius, motion.velocity, motion.spin, walls)
    assert np.array_equal(contacts.key, CONTACTS.key)
    assert np.stack(found) == pytest.approx(np.stack(expected), abs=ROUNDING)


@given(ANGLES, st.integers(0, 99))
def test_forces_and_stress_rotate_with_the_packing(angle, seed):
    fn, ft = some_forces(seed)
    rotation = matrix(angle)
    motion, _, contacts = rotated(angle)
    assert contact_force_vectors(contacts, fn, ft) == pytest.approx(
        contact_force_vectors(CONTACTS, fn, ft) @ rotation.T, abs=ROUNDING
    )
    stress = love_weber_stress(CONTACTS, fn, ft, MOTION.position, 0.02, 0.06)
    found = love_weber_stress(contacts, fn, ft, motion.position, 0.02, 0.06)
    assert found == pytest.approx(rotation @ stress @ rotation.T, abs=ROUNDING * np.abs(stress).max())
    assert friction_angle(found) == pytest.approx(friction_angle(stress), abs=ROUNDING)
    (major, minor, direction), (own, least, before) = principal_stresses(found), principal_stresses(stress)
    assert (major, minor) == pytest.approx((own, least), rel=ROUNDING)
    assert np.sin(2.0 * (direction - before - angle)) == pytest.approx(0.0, abs=1e-6)


@given(ANGLES, st.integers(0, 99))
def test_fabric_and_anisotropies_rotate_with_the_packing(angle, seed):
    fn, ft = some_forces(seed)
    rotation = matrix(angle)
    motion, _, contacts = rotated(angle)
    fabric, found = contact_fabric(CONTACTS.normal), contact_fabric(contacts.normal)
    assert found == pytest.approx(rotation @ fabric @ rotation.T, abs=ROUNDING)
    assert fabric_anisotropy(found) == pytest.approx(fabric_anisotropy(fabric), abs=ROUNDING)
    before = anisotropies(CONTACTS.normal, branch_vectors(CONTACTS, MOTION.position), fn, ft)
    after = anisotropies(contacts.normal, branch_vectors(contacts, motion.position), fn, ft)
    for kind in ("contact", "branch", "normal", "tangential"):
        one, other = getattr(before, kind), getattr(after, kind)
        assert other.amplitude == pytest.approx(one.amplitude, rel=1e-6)
        assert np.sin(2.0 * (other.direction - one.direction - angle)) == pytest.approx(0.0, abs=1e-6)


@given(st.integers(-8, 8))
def test_forces_scale_with_load_and_motion_bit_for_bit(power):
    """A power of two changes no digit: a term that does not scale with the load would show."""
    scale, impedance = 2.0**power, GRAINS.mass * 1e3
    closing = np.where(np.arange(CONTACTS.count) % 3 == 0, 1e-6, 0.0)

    def forces(factor):
        motion = GrainMotion(MOTION.position, factor * MOTION.velocity, factor * MOTION.spin, MOTION.present)
        walls = Walls(WALLS.endpoints, np.full((4, 2, 2), factor * 1e-6), factor * WALLS.load)
        material = Material(0.3, 0.2, gravity=(0.0, -9.81 * factor))
        problem = assemble(GRAINS, motion, walls, CONTACTS, material, impedance, PreparedContacts(factor * closing))
        return solve(problem, NlgsSettings(sweeps=12)).force

    assert np.array_equal(forces(scale), scale * forces(1.0))


@given(st.integers(0, 99))
def test_relative_motion_is_the_transpose_of_equilibrium(seed):
    """f · Hᵀ v = v · H f: relative motion is the transpose of equilibrium."""
    rng = np.random.default_rng(seed)
    n, velocity, spin = GRAINS.count, rng.normal(size=(GRAINS.count, 2)), rng.normal(size=GRAINS.count)
    fn, ft = some_forces(seed)
    plate = rng.normal()
    # The loaded wall moves along its outward normal, and no other wall does.
    moved = np.where(WALLS.loaded[:, None, None], plate * WALLS.outward[:, None, :], 0.0) * np.ones((4, 2, 2))
    un, ut = relative_motion(CONTACTS, GRAINS.radius, velocity, spin, Walls(WALLS.endpoints, moved, WALLS.load))
    h = equilibrium_matrix(CONTACTS, GRAINS.radius, WALLS)
    bodies = np.concatenate([velocity[:, 0], velocity[:, 1], spin, [plate]])
    work = float(bodies @ (h @ np.concatenate([fn, ft])))
    assert work == pytest.approx(float(fn @ un + ft @ ut), rel=ROUNDING, abs=ROUNDING)
    assert len(external_load(GRAINS.weight((0.0, -9.81)), WALLS)) == 3 * n + 1
