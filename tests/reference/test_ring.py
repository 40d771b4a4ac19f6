"""The compiled forces of circles against the plain ones."""

import numpy as np
import pytest
from rodsight.solver.dem.boundaries import RING, Boundary
from rodsight.solver.dem.contact_law import Law
from rodsight.solver.dem.time_step import DemBodies, DemPairs, wall_forces

from tests.reference.twins.ring import plain_circle_forces

pytestmark = pytest.mark.unit

ROUNDING = 1e-11
LAW = Law(
    time_step=2e-6, normal_stiffness=2e7, tangential_stiffness=1.4e7, tangential_damping=0.48, friction=0.25,
    wall_friction=0.1, rolling_friction=0.0, adhesion=0.0, ovality=0.0, drag=0.0, gravity_x=0.0,
    gravity_y=0.0,
)  # fmt: skip
CIRCLES = np.array([0.1, -0.4, 0.04, 0.003, -0.002, 0.7])
DRIVE = np.array([0.3, -0.2, 12.0, 0.0])


def test_forces_of_circles_are_the_plain_ones():
    rng = np.random.default_rng(2)
    n = 60
    radius, angle = rng.uniform(0.006, 0.008, n), np.linspace(0.0, 2.0 * np.pi, n)
    unit = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    at_ring = np.arange(n) % 2 == 0
    away = np.where(at_ring, 0.1 - radius, 0.04 + radius) + rng.uniform(-3e-5, 3e-5, n)
    place = away[:, None] * unit + np.where(at_ring[:, None], 0.0, CIRCLES[3:5])
    state = np.column_stack([place, rng.normal(0, 1, (n, 2)), rng.normal(0, 0.5, n), rng.normal(0, 40.0, n)])
    empty = np.zeros((n, 3))
    bodies = DemBodies(
        state, empty.copy(), radius, np.full(n, 0.03), empty, np.zeros(n), np.ones(n), np.zeros((n, 2)), np.zeros(n)
    )
    boundary = Boundary(RING, CIRCLES, np.zeros((2, 3)), np.zeros(4))
    wall, damping = np.where(at_ring, 0, 1).astype(np.int32), rng.choice([1.0, 200.0, 900.0], n)
    image = np.zeros((n, 2), np.int64)
    pairs = DemPairs(np.arange(n, dtype=np.int32), wall, image, damping, rng.normal(0, 5.0, n), *np.zeros((3, n)))
    force, found, push = plain_circle_forces(bodies, pairs, LAW, CIRCLES, DRIVE)
    closed = found[:, 0] > 0.0
    slides = closed & np.isclose(np.abs(found[:, 1]), LAW.wall_friction * found[:, 0])
    assert (slides & at_ring).any()
    assert (slides & ~at_ring).any()
    assert (closed & ~slides).any()
    assert (found[:, 2] == 0.0).any()  # open
    assert wall_forces(bodies, pairs, LAW, boundary, DRIVE) == pytest.approx((push, 0.0), rel=ROUNDING)
    np.testing.assert_allclose(bodies.force, force, atol=ROUNDING * np.abs(force).max())
    np.testing.assert_allclose(
        np.stack([pairs.fn, pairs.ft, pairs.spring], axis=1), found, atol=ROUNDING * np.abs(found).max()
    )
