"""Forces after the removal of a contact: same resultants, within friction, nearest to the given forces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.bodies.grains import Grains
from rodsight.solver.contacts.contacts import Contacts
from rodsight.solver.redistribution.contact_removal import remove_contact
from rodsight.solver.redistribution.local_change import limit_friction, rebalance
from rodsight.solver.redistribution.nearest_forces import resultants
from rodsight.solver.statistics.balance import resultant_forces
from scipy.optimize import minimize

MU = 0.4
CLOSE = 2e-4  # of the mean force: where the interior-point method ends


@pytest.fixture
def patch() -> tuple[Grains, Contacts, np.ndarray, np.ndarray]:
    """A hexagonal patch of equal rods in a frame of four walls, under forces within friction."""
    rows = [(x + 0.5 * (y % 2), 0.5 * np.sqrt(3.0) * y) for y in range(4) for x in range(4)]
    place = np.array(rows) * 0.02
    n = len(place)
    grains = Grains.of_rods(np.full(n, 0.01), density=2700.0, length=0.06)
    pairs = [(i, j) for i in range(n) for j in range(i + 1, n) if np.linalg.norm(place[j] - place[i]) < 0.0201]
    low, high = place.min(axis=0), place.max(axis=0)
    walls = [(k, n) for k in range(n) if place[k, 1] < low[1] + 1e-6]
    walls += [(k, n + 1) for k in range(n) if place[k, 1] > high[1] - 1e-6]
    normal = [(place[j] - place[i]) / np.linalg.norm(place[j] - place[i]) for i, j in pairs]
    normal += [np.array([0.0, -1.0 if w == n else 1.0]) for _, w in walls]
    i, j = np.array(pairs + walls, np.int32).T
    point = place[i] + 0.01 * np.array(normal)
    contacts = Contacts(i.copy(), j.copy(), np.zeros(len(i)), np.array(normal), point, n, 2)
    rng = np.random.default_rng(3)
    fn = rng.uniform(4.0, 9.0, len(i))
    return grains, contacts, fn, MU * fn * rng.uniform(-0.5, 0.5, len(i))


def test_resultants_are_preserved_within_the_coulomb_cones(patch) -> None:
    grains, contacts, fn, ft = patch
    row = 10
    found = remove_contact(grains, contacts, fn, ft, row, friction=np.full(len(fn), MU))
    assert found.unbalance < CLOSE
    weight = np.zeros((grains.count, 2))
    before = resultant_forces(contacts, fn, ft, weight)
    after = resultant_forces(contacts, found.fn, found.ft, weight)
    np.testing.assert_allclose(after, before, atol=CLOSE * fn.mean())
    np.testing.assert_allclose(friction_sums(contacts, found.ft), friction_sums(contacts, ft), atol=CLOSE * fn.mean())
    assert found.fn[row] == found.ft[row] == 0.0
    assert found.fn.min() >= 0.0
    assert (np.abs(found.ft) <= MU * found.fn + 1e-9).all()


def friction_sums(contacts: Contacts, ft: np.ndarray) -> np.ndarray:
    """Sum of f_t (n,) over the contacts of every grain: its torque over −R."""
    ends = np.concatenate([contacts.i, contacts.j])
    return np.bincount(ends, np.tile(ft, 2), contacts.grain_count)[: contacts.grain_count]


def test_every_contact_has_its_own_friction(patch) -> None:
    grains, contacts, fn, ft = patch
    friction = np.where(contacts.with_wall, 0.2 * MU, MU)
    inside = np.sign(ft) * np.minimum(np.abs(ft), friction * fn)
    for row in range(contacts.count):
        found = remove_contact(grains, contacts, fn, inside, row, friction=friction)
        assert (np.abs(found.ft) <= friction * found.fn + 1e-9).all()


def test_result_is_the_nearest_admissible_field(patch) -> None:
    grains, contacts, fn, ft = patch
    row = 10
    found = remove_contact(grains, contacts, fn, ft, row, friction=np.full(len(fn), MU))
    rows = np.flatnonzero(found.free)
    places = np.arange(grains.count)
    matrix = resultants(grains, contacts, rows, places)
    given = np.concatenate([fn[rows], ft[rows]])
    wanted = matrix @ given + resultants(grains, contacts, np.array([row]), places) @ np.array([fn[row], ft[row]])

    def room(f: np.ndarray) -> np.ndarray:
        normal, tangential = f.reshape(2, -1)
        return np.concatenate([MU * normal - tangential, MU * normal + tangential])

    best = minimize(
        lambda f: 0.5 * ((f - given) ** 2).sum(), given, jac=lambda f: f - given, method="SLSQP",
        constraints=[
            {"type": "eq", "fun": lambda f: matrix @ f - wanted, "jac": lambda f: matrix.toarray()},
            {"type": "ineq", "fun": room},
        ],
        options={"maxiter": 500, "ftol": 1e-10},
    )  # fmt: skip
    assert best.success
    ours = np.concatenate([found.fn[rows], found.ft[rows]])
    np.testing.assert_allclose(ours, best.x, atol=CLOSE * fn.mean())
    assert np.linalg.norm(ours - given) <= np.linalg.norm(best.x - given) * (1.0 + CLOSE)


def test_forces_beyond_the_neighbourhood_are_unchanged(patch) -> None:
    grains, contacts, fn, ft = patch
    found = remove_contact(grains, contacts, fn, ft, 0, friction=np.full(len(fn), MU), reach=0)
    touched = {int(contacts.i[0]), int(contacts.j[0])}
    for c in range(contacts.count):
        free = bool({int(contacts.i[c]), int(contacts.j[c])} & touched) and c != 0
        assert found.free[c] == free
        if not free and c != 0:
            assert (found.fn[c], found.ft[c]) == (fn[c], ft[c])


def test_boundary_grains_need_no_balance(patch) -> None:
    grains, contacts, fn, ft = patch
    row = 10
    held = np.isin(np.arange(grains.count), [int(contacts.i[row]), int(contacts.j[row])])
    found = remove_contact(replace(grains, boundary=held), contacts, fn, ft, row, friction=np.full(len(fn), MU))
    kept = np.arange(len(fn)) != row
    np.testing.assert_allclose(found.fn[kept], fn[kept], atol=CLOSE * fn.mean())  # its force fell on these two alone


def test_irreplaceable_contact_leaves_a_residual() -> None:
    grains = Grains.of_rods(np.array([0.01]), density=2700.0, length=0.06)
    one = Contacts(
        np.array([0, 0], np.int32), np.array([1, 2], np.int32), np.zeros(2), np.array([[0.0, -1.0], [0.0, 1.0]]),
        np.array([[0.0, -0.01], [0.0, 0.01]]), 1, 2,
    )  # fmt: skip
    heavy = np.array([5.0, 2.0])  # the difference is its weight
    found = remove_contact(grains, one, heavy, np.zeros(2), 0, friction=np.full(2, MU))
    assert found.unbalance > 0.3


def carried(grains, contacts, fn, ft):
    rows, members = np.arange(contacts.count), np.arange(grains.count)
    return resultants(grains, contacts, rows, members) @ np.concatenate([fn, ft])


def test_friction_beyond_smaller_cones_is_redistributed(patch) -> None:
    grains, contacts, fn, ft = patch
    friction = np.full(len(fn), 0.3 * MU)
    new_fn, new_ft = limit_friction(grains, contacts, fn, ft, friction=friction)
    scale = fn.mean()
    assert (np.abs(ft) > friction * fn + 0.01 * scale).any()
    assert (np.abs(new_ft) <= friction * new_fn + CLOSE * scale).all()
    before = carried(grains, contacts, fn, ft)
    np.testing.assert_allclose(carried(grains, contacts, new_fn, new_ft), before, atol=3.0 * CLOSE * scale)


def test_forces_within_larger_cones_stay(patch) -> None:
    grains, contacts, fn, ft = patch
    same = limit_friction(grains, contacts, fn, ft, friction=np.full(len(fn), 2.0))
    assert same[0] is fn
    assert same[1] is ft


def test_moved_normals_carry_the_same_loads(patch) -> None:
    grains, contacts, fn, ft = patch
    rows = np.flatnonzero((contacts.i == 5) | (contacts.j == 5))
    turned, angle = contacts.normal.copy(), 0.05
    turned[rows] = turned[rows] @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    moved = replace(contacts, normal=turned)
    friction = np.full(len(fn), MU)
    new_fn, new_ft = rebalance(grains, contacts, np.stack([fn, ft]), rows, friction=friction, moved=moved)
    before = carried(grains, contacts, fn, ft)
    np.testing.assert_allclose(carried(grains, moved, new_fn, new_ft), before, atol=3.0 * CLOSE * fn.mean())
    assert np.abs(carried(grains, contacts, new_fn, new_ft) - before).max() > 0.01 * fn.mean()
