import numpy as np
import pytest
from rodsight.solver.bodies.grains import Grains
from rodsight.solver.bodies.walls import Walls
from rodsight.solver.contacts.contacts import Contacts, detect_contacts, measure_contacts
from rodsight.solver.contacts.kinematics import equilibrium_matrix, external_load, relative_motion

STEP = 1e-7  # [m] its square over a radius, 1e-12 m, is the error of first order
FIRST_ORDER = 2e-4 * STEP  # curvature STEP / R = 1e-5 of a step, and rounding of centimetres, 2e-18 m
EXACT = 1e-12  # rounding of a handful of terms of order one


def box(width: float, height: float, top_load: float = np.nan) -> Walls:
    corner = np.array([[0, 0], [width, 0], [width, height], [0, height]], dtype=float)
    endpoints = np.stack([corner, np.roll(corner, -1, axis=0)], axis=1)
    return Walls(endpoints, np.zeros((4, 2, 2)), np.array([np.nan, np.nan, top_load, np.nan]))


def packing() -> tuple[Grains, np.ndarray, Walls, Contacts]:
    rng = np.random.default_rng(3)
    lattice = np.stack(np.meshgrid(np.arange(5), np.arange(5)), axis=-1).reshape(-1, 2)
    position = 0.02 * lattice + 0.012 + rng.uniform(-1e-3, 1e-3, (25, 2))
    grains = Grains.of_rods(rng.uniform(0.008, 0.011, 25), density=2700.0, length=0.06)
    walls = box(0.104, 0.104, top_load=100.0)
    return grains, position, walls, detect_contacts(grains, position, np.ones(25, bool), walls, 4e-3)


def degrees_of_freedom(translation: np.ndarray, rotation: np.ndarray, plate: float) -> np.ndarray:
    return np.concatenate([translation[:, 0], translation[:, 1], rotation, [plate]])


def test_transpose_gives_the_change_of_every_gap():
    grains, position, walls, contacts = packing()
    rng = np.random.default_rng(4)
    translation, rotation, plate = rng.normal(size=(25, 2)), rng.normal(size=25), 0.7
    motion = equilibrium_matrix(contacts, grains.radius, walls).T @ degrees_of_freedom(translation, rotation, plate)

    endpoints = walls.endpoints.copy()
    endpoints[2] += STEP * plate * walls.outward[2]
    moved = measure_contacts(
        grains, position + STEP * translation, Walls(endpoints, walls.velocity, walls.load), contacts.i, contacts.j
    )
    assert contacts.count > 40
    np.testing.assert_allclose(moved.gap - contacts.gap, STEP * motion[: contacts.count], atol=FIRST_ORDER, rtol=0)


def test_transpose_gives_the_sliding_of_material_points():
    grains, position, walls, contacts = packing()
    rng = np.random.default_rng(5)
    translation, rotation = rng.normal(size=(25, 2)), rng.normal(size=25)
    motion = equilibrium_matrix(contacts, grains.radius, walls).T @ degrees_of_freedom(translation, rotation, 0.0)

    def moved_point(grain: np.ndarray, arm: np.ndarray) -> np.ndarray:
        angle = STEP * rotation[grain]
        cosine, sine = np.cos(angle), np.sin(angle)
        rotated = np.stack([cosine * arm[:, 0] - sine * arm[:, 1], sine * arm[:, 0] + cosine * arm[:, 1]], axis=1)
        return position[grain] + STEP * translation[grain] + rotated

    pair = ~contacts.with_wall
    i, j, normal = contacts.i[pair], contacts.j[pair], contacts.normal[pair]
    apart = moved_point(j, -grains.radius[j][:, None] * normal) - moved_point(i, grains.radius[i][:, None] * normal)
    before = contacts.gap[pair][:, None] * normal
    sliding = np.einsum("ij,ij->i", apart - before, contacts.tangent[pair])
    np.testing.assert_allclose(sliding, STEP * motion[contacts.count :][pair], atol=FIRST_ORDER, rtol=0)


def test_relative_motion_agrees_with_the_transpose():
    grains, _, walls, contacts = packing()
    rng = np.random.default_rng(6)
    translation, rotation, plate = rng.normal(size=(25, 2)), rng.normal(size=25), -0.3
    velocity = walls.velocity.copy()
    velocity[2] = plate * walls.outward[2]
    moving = Walls(walls.endpoints, velocity, walls.load)
    un, ut = relative_motion(contacts, grains.radius, translation, rotation, moving)
    expected = equilibrium_matrix(contacts, grains.radius, walls).T @ degrees_of_freedom(translation, rotation, plate)
    np.testing.assert_allclose(np.concatenate([un, ut]), expected, atol=EXACT)


def test_rigid_motion_neither_opens_nor_slides_touching_contacts():
    grains, position, walls, contacts = packing()
    drift, spin = np.array([0.3, -0.2]), 0.8

    def rigid(point: np.ndarray) -> np.ndarray:
        return drift + spin * np.stack([-point[..., 1], point[..., 0]], axis=-1)

    rotating = Walls(walls.endpoints, rigid(walls.endpoints), walls.load)
    un, ut = relative_motion(contacts, grains.radius, rigid(position), np.full(25, spin), rotating)
    # Surfaces that do not touch are separated by the gap, which rotates as well.
    np.testing.assert_allclose(un, 0.0, atol=EXACT)
    np.testing.assert_allclose(ut, spin * contacts.gap, atol=EXACT)


def test_stack_of_three_grains_carries_load_and_weight():
    radius = np.array([0.01, 0.008, 0.011])
    grains = Grains.of_rods(radius, density=2700.0, length=0.06)
    height = 2 * radius.sum()
    centre = np.cumsum(2 * radius) - radius
    position = np.stack([np.full(3, 0.05), centre], axis=1)
    walls = box(0.1, height, top_load=20.0)
    contacts = detect_contacts(grains, position, np.ones(3, bool), walls, 1e-9)
    matrix = equilibrium_matrix(contacts, radius, walls)
    weight = 9.81 * grains.mass
    # 0-1, 0-floor, 1-2, 2-plate: every contact carries the weight and load above it.
    above = {1: 20 + weight[1:].sum(), 3: 20 + weight.sum(), 2: 20 + weight[2], 5: 20.0}
    fn = np.array([above[int(j)] for j in contacts.j])
    load = external_load(grains.weight((0.0, -9.81)), walls)
    np.testing.assert_allclose(matrix @ np.concatenate([fn, np.zeros(4)]), load, atol=EXACT * 20)


def test_torques_of_friction_on_both_grains_have_the_same_sign():
    grains = Grains.of_rods(np.array([0.01, 0.02]), density=2700.0, length=0.06)
    position = np.array([[0.05, 0.05], [0.08, 0.05]])
    walls = box(1.0, 1.0)
    contacts = detect_contacts(grains, position, np.ones(2, bool), walls, 1e-9)
    torque = (equilibrium_matrix(contacts, grains.radius, walls) @ np.array([0.0, 1.0]))[4:6]
    np.testing.assert_allclose(torque, [-0.01, -0.02], atol=EXACT)


def test_relative_motion_at_contacts_of_a_missing_grain_is_nan():
    grains, _, walls, contacts = packing()
    translation = np.zeros((25, 2))
    translation[7] = np.nan
    un, ut = relative_motion(contacts, grains.radius, translation, np.zeros(25), walls)
    touched = (contacts.i == 7) | (contacts.j == 7)
    assert touched.any()
    assert np.all(np.isnan(un[touched]) & np.isnan(ut[touched]))
    assert np.all(np.isfinite(un[~touched]))


@pytest.mark.parametrize("loaded", [False, True])
def test_plate_has_a_row_only_under_load(loaded: bool):
    grains, _, walls, contacts = packing()
    load = np.full(4, np.nan)
    if loaded:
        load[1] = 5.0
    matrix = equilibrium_matrix(contacts, grains.radius, Walls(walls.endpoints, walls.velocity, load))
    assert matrix.shape[0] == 75 + loaded
    if loaded:
        row = matrix.toarray()[75]
        np.testing.assert_array_equal(row[: contacts.count], contacts.j == 26)
        assert not row[contacts.count :].any()
