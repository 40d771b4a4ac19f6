"""The compiled discrete-element step against the plain one."""

import numpy as np
import pytest
from rodsight.solver.dem.boundaries import FRAME, Boundary
from rodsight.solver.dem.contact_law import Law, contact_force, rolling_force
from rodsight.solver.dem.time_step import DemBodies, DemPairs, advance

from tests.reference.twins.dem import PlainCell

pytestmark = pytest.mark.unit

# Relative to the greatest value of its kind; stiff springs amplify rounding a little.
ROUNDING = 1e-9
STEPS = 40
SIDE = 6  # grains along a side
OVALITY = 5e-3  # changes the radii by less than the overlaps, so that all branches are reached
LAW = Law(
    time_step=2e-6, normal_stiffness=2e7, tangential_stiffness=1.4e7, tangential_damping=0.48, friction=0.25,
    wall_friction=0.1, rolling_friction=0.05, adhesion=7.0, ovality=0.0, drag=40.0, gravity_x=0.8,
    gravity_y=-9.81,
)  # fmt: skip


def make_cell(load: float, side_load: float = np.nan, law: Law = LAW):
    """Compiled bodies and pairs, and the plain cell, of the same overlapping, fast grains in a slanted frame.

    Some of the grains rub on a base. Loads [N] on the plate and on the right side, NaN: driven.
    """
    rng = np.random.default_rng(5)
    n, pitch = SIDE * SIDE, 0.0158
    x, y = np.meshgrid(np.arange(SIDE) * pitch, np.arange(SIDE) * pitch)
    shear, height, width = 0.05, SIDE * pitch, SIDE * pitch
    position = np.column_stack([x.ravel(), y.ravel()]) + pitch / 2
    position[:, 0] += np.tan(shear) * position[:, 1]
    position += rng.uniform(-6e-5, 6e-5, position.shape)
    radius, mass = rng.uniform(0.00785, 0.00795, n), rng.uniform(0.02, 0.05, n)
    velocity, spin = rng.normal(0, 1.0, (n, 2)), rng.normal(0, 40.0, n)
    state = np.column_stack([position, rng.normal(0, 1, n), velocity, spin])
    plates = np.array([[0.4, load, 80.0], [0.3, side_load, 60.0]])
    boundary = Boundary(FRAME, np.array([shear, height, -0.3, width, 0.2, 0.0]), plates, np.zeros(4))
    base_limit = rng.choice([0.0, 3.0, 400.0], n)
    roughness = np.random.default_rng(6).choice([0.5, 1.0, 1.6], n)
    external = np.random.default_rng(7).normal(0.0, 40.0, (n, 2))
    axis = np.random.default_rng(8).uniform(0.0, np.pi, n)
    bodies = DemBodies(state, np.zeros((n, 3)), radius, mass, np.zeros((n, 3)), base_limit, roughness, external, axis)
    near = [(i, j) for i in range(n) for j in range(i + 1, n) if np.hypot(*(position[j] - position[i])) < 0.0163]
    rows = {0: range(SIDE), 1: range(SIDE - 1, n, SIDE), 2: range(n - SIDE, n), 3: range(0, n, SIDE)}
    walls = sorted((i, w) for w, grains in rows.items() for i in grains)

    def pairs(listed):
        i, j = np.array(listed, np.int32).T
        image = np.zeros((len(i), 2), np.int64)
        return DemPairs(i.copy(), j.copy(), image, rng.choice([1.0, 200.0, 900.0], len(i)), *np.zeros((4, len(i))))

    pair_list, wall_list = pairs(near), pairs(walls)
    damping = {("pair", *key): float(d) for key, d in zip(near, pair_list.damping, strict=True)}
    damping |= {("wall", *key): float(d) for key, d in zip(walls, wall_list.damping, strict=True)}
    plain = PlainCell(
        position.copy(), state[:, 2].copy(), velocity.copy(), spin.copy(), np.zeros((n, 2)), np.zeros(n), radius, mass,
        shear, height, -0.3, width, 0.4, None if np.isnan(load) else load, 80.0, 0.2,
        None if np.isnan(side_load) else (0.3, side_load, 60.0), base_limit, roughness, external, axis, law,
        near, walls, damping,
    )  # fmt: skip
    return bodies, pair_list, wall_list, boundary, plain


def close_to(expected):
    expected = np.asarray(expected)
    return pytest.approx(expected, rel=0, abs=ROUNDING * max(np.abs(expected).max(), 1e-300))


def make_drive():
    """Shear rate, and velocities of plate and side where they are driven."""
    return np.column_stack(
        [np.linspace(2.0, -1.0, STEPS), np.linspace(-0.4, 0.4, STEPS), np.linspace(0.3, -0.2, STEPS)]
    )


@pytest.mark.parametrize(
    ("load", "side_load", "ovality"), [(300.0, np.nan, 0.0), (np.nan, 250.0, 0.0), (300.0, 250.0, OVALITY)]
)
def test_the_step_is_the_plain_one(load, side_load, ovality):
    law = LAW._replace(ovality=ovality)
    bodies, pairs, walls, boundary, plain = make_cell(load, side_load, law)
    drive = make_drive()
    assert advance(bodies, pairs, walls, law, boundary, drive, np.inf) == STEPS
    for each in drive:
        plain.step(*each)
    assert bodies.state[:, :2] == close_to(plain.position)
    assert bodies.state[:, 2] == close_to(plain.angle)
    assert bodies.state[:, 3:5] == close_to(plain.velocity)
    assert bodies.state[:, 5] == close_to(plain.spin)
    assert bodies.force[:, :2] == close_to(plain.force)
    assert bodies.force[:, 2] == close_to(plain.torque)
    assert boundary.state[:5] == pytest.approx(
        [plain.shear, plain.height, plain.rise, plain.width, plain.spread], rel=ROUNDING
    )
    assert bodies.base == close_to([plain.held.get(k, np.zeros(3)) for k in range(len(bodies.mass))])
    for kind, found in (("pair", pairs), ("wall", walls)):
        key = [(kind, int(i), int(j)) for i, j in zip(found.i, found.j, strict=True)]
        assert np.stack([found.fn, found.ft], axis=1) == close_to([plain.contact[each] for each in key])
        assert found.spring == close_to([plain.spring[each] for each in key])
        assert found.roll == close_to([plain.roll[each] for each in key])


@pytest.mark.parametrize("ovality", [0.0, OVALITY])
def test_the_cell_reaches_every_branch(ovality):
    *_, plain = make_cell(300.0, law=LAW._replace(ovality=ovality))
    for each in make_drive():
        plain.step(*each)
    for kind in ("pair", "wall"):
        for what in ("open", "open again", "torn", "sticks", "slides forth", "slides back"):
            assert f"{kind} {what}" in plain.seen
        for what in ("does not roll", "rolls forth", "rolls back"):
            assert f"{kind} {what}" in plain.seen
    assert {"no base", "base sticks", "base slides", "base rotates forth", "base rotates back"} <= plain.seen
    assert {"bottom", "right", "top", "left"} <= plain.seen


def test_it_stops_once_two_bodies_may_have_approached_by_the_reach():
    bodies, pairs, walls, boundary, plain = make_cell(300.0)
    drive, reach = np.tile([60.0, 0.0, 3.0], (STEPS, 1)), 1.2e-4
    travel, steps = 0.0, 0
    while travel <= reach:
        travel += plain.step(*drive[steps])
        steps += 1
    assert 3 < steps < STEPS
    assert advance(bodies, pairs, walls, LAW, boundary, drive, reach) == steps
    assert bodies.state[:, :2] == close_to(plain.position)


def test_a_dashpot_does_not_pull():
    fn, ft, spring = contact_force(1e-7, 1.0, 0.2, 500.0, 3.0, 0.25, LAW)
    assert (fn, ft, spring) == (-LAW.adhesion, 0.0, 0.0)


def test_a_contact_rolls_once_its_moment_exceeds_the_friction_limit():
    assert rolling_force(10.0, 0.0, 0.0, 0.4, LAW) == (0.4, 0.4)
    assert rolling_force(10.0, 1.0, 500.0, 0.4, LAW) == (-0.5, -0.5)
    assert rolling_force(0.0, -1.0, 500.0, 0.4, LAW) == (0.0, 0.0)
