"""A step of the simulation in a periodic cell against a plain implementation from the mechanics."""

import numpy as np
import pytest
from rodsight.solver.dem.boundaries import CELL, CELL_PRESSURE, Boundary
from rodsight.solver.dem.contact_law import Law
from rodsight.solver.dem.time_step import DemBodies, DemPairs, advance

pytestmark = pytest.mark.unit

LAW = Law(1e-4, 2e4, 1.4e4, 0.5, 0.25, 0.25, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0)
REQUIRED, VISCOSITY, LENGTH = 5e3, 2e5, 0.06  # [Pa], [Pa s], [m]
NO_WALLS = DemPairs(*np.empty((2, 0), np.int32), np.empty((0, 2), np.int64), *np.empty((5, 0)))
RATE = 0.8  # [1/s]


def make_bodies() -> tuple[DemBodies, DemPairs, Boundary]:
    """Three rods in a row that closes across the inclined edge of their cell."""
    rng = np.random.default_rng(4)
    radius, mass = np.array([0.010, 0.011, 0.009]), np.array([0.05, 0.06, 0.04])
    cell = np.array([[0.02, 0.05], [0.0785, 0.051]])  # the row closes by a − b
    state = np.zeros((3, 6))
    state[:, :2] = np.array([[0.01, 0.01], [0.0305, 0.0105], [0.05, 0.0105]])
    state[:, 3:] = rng.normal(0, [1e-2, 1e-2, 1.0], (3, 3))
    pairs = DemPairs(
        np.array([0, 1, 0], np.int32), np.array([1, 2, 2], np.int32), np.array([[0, 0], [0, 0], [1, -1]]),
        rng.uniform(1, 2, 3), rng.normal(0, 1, 3), np.zeros(3), np.zeros(3), np.zeros(3),
    )  # fmt: skip
    boundary = Boundary(
        CELL, np.array([*cell.ravel(), 4e3, 0.0]), np.zeros((2, 3)), np.array([REQUIRED, VISCOSITY, 10.0, LENGTH])
    )
    bodies = DemBodies(
        state, rng.normal(0, 1, (3, 3)), radius, mass, np.zeros((3, 3)), np.zeros(3), np.ones(3), np.zeros((3, 2)),
        rng.uniform(0.0, np.pi, 3),
    )  # fmt: skip
    return bodies, pairs, boundary


def test_a_step_is_that_of_the_plain_mechanics() -> None:
    bodies, pairs, boundary = make_bodies()
    start, spring = bodies.state.copy(), pairs.spring.copy()
    force, cell = bodies.force.copy(), boundary.state[:4].reshape(2, 2).copy()
    dt = LAW.time_step
    assert advance(bodies, pairs, NO_WALLS, LAW, boundary, np.array([[RATE]]), 1.0) == 1

    stretch = (4e3 - REQUIRED) / VISCOSITY
    gradient = np.array([[stretch, RATE], [0.0, stretch]])
    velocity = (1 - LAW.drag * dt) * start[:, 3:5] + dt * force[:, :2] / bodies.mass[:, None]
    spin = (1 - LAW.drag * dt) * start[:, 5] + dt * force[:, 2] / (0.5 * bodies.mass * bodies.radius**2)
    place = start[:, :2] + dt * (velocity + start[:, :2] @ gradient.T)
    cell = cell + dt * cell @ gradient.T
    total, work = np.zeros((3, 3)), 0.0
    for p in range(3):
        i, j = pairs.i[p], pairs.j[p]
        branch = place[j] + pairs.image[p] @ cell - place[i]
        distance = float(np.linalg.norm(branch))
        n = branch / distance
        t = np.array([-n[1], n[0]])
        moved = velocity[j] - velocity[i] + gradient @ branch
        ut = float(t @ moved) - bodies.radius[i] * spin[i] - bodies.radius[j] * spin[j]
        overlap = bodies.radius[i] + bodies.radius[j] - distance
        assert overlap > 0.0
        fn = max(LAW.normal_stiffness * overlap - pairs.damping[p] * float(n @ moved), 0.0)
        elastic = spring[p] - LAW.tangential_stiffness * ut * dt
        ft = float(np.clip(elastic - LAW.tangential_damping * pairs.damping[p] * ut, -0.25 * fn, 0.25 * fn))
        assert (pairs.fn[p], pairs.ft[p]) == pytest.approx((fn, ft), rel=1e-12)
        f = fn * n + ft * t
        total[j, :2] += f
        total[i, :2] -= f
        total[[i, j], 2] -= bodies.radius[[i, j]] * ft
        work += fn * distance
    assert bodies.state[:, :2] == pytest.approx(place, rel=1e-13)
    assert bodies.state[:, 3:5] == pytest.approx(velocity, rel=1e-12)
    assert boundary.state[:4].reshape(2, 2) == pytest.approx(cell, rel=1e-13)
    assert bodies.force == pytest.approx(total, rel=1e-9, abs=1e-12)
    assert boundary.state[CELL_PRESSURE] == pytest.approx(work / (2 * abs(np.linalg.det(cell)) * LENGTH), rel=1e-12)


def test_pairs_that_separate_lose_their_springs() -> None:
    bodies, pairs, boundary = make_bodies()
    bodies.state[:, :2] *= 1.2
    boundary.state[:4] *= 1.2
    advance(bodies, pairs, NO_WALLS, LAW, boundary, np.zeros((1, 1)), 1.0)
    assert not pairs.fn.any()
    assert not pairs.spring.any()
