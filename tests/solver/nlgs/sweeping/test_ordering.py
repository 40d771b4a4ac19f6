import numpy as np
import pytest
from rodsight.solver.bodies.packing import Material
from rodsight.solver.contacts.contacts import detect_contacts
from rodsight.solver.grain_records import RECORD
from rodsight.solver.nlgs.problem import assemble
from rodsight.solver.nlgs.sweeping.ordering import GROUP, visiting_order

from tests.packings import squeezed_heap


@pytest.fixture(scope="module")
def heap():
    grains, state, walls = squeezed_heap(np.random.default_rng(2), columns=14, rows=14)
    return grains, state, walls, detect_contacts(grains, state.position, state.present, walls, 2e-4)


def order_of(contacts, size):
    return visiting_order(contacts.point, contacts.i, contacts.j, size)


@pytest.mark.parametrize("size", [2, 8, GROUP])
def test_every_contact_is_visited_once(heap, size):
    *_, contacts = heap
    order, _ = order_of(contacts, size)
    assert np.array_equal(np.sort(order), np.arange(contacts.count))


@pytest.mark.parametrize("size", [8, GROUP])
def test_contacts_of_a_group_share_no_body(heap, size):
    *_, contacts = heap
    inner = contacts.select(~contacts.with_wall)
    order, grouped = order_of(inner, size)
    assert grouped % size == 0
    assert grouped >= 0.5 * inner.count  # otherwise the test covers little
    for group in order[:grouped].reshape(-1, size):
        bodies = np.concatenate([inner.i[group], inner.j[group]])
        assert len(np.unique(bodies)) == 2 * size


def test_the_order_follows_from_the_geometry_alone(heap):
    *_, contacts = heap
    first, second = order_of(contacts, 8), order_of(contacts, 8)
    assert np.array_equal(first[0], second[0])
    assert first[1] == second[1]


def test_neighbours_in_the_order_are_neighbours_in_the_packing(heap):
    *_, contacts = heap
    inner = contacts.select(~contacts.with_wall)
    order, grouped = order_of(inner, 8)
    centres = inner.point[order[:grouped]].reshape(-1, 8, 2).mean(axis=1)
    apart = np.linalg.norm(np.diff(centres, axis=0), axis=1).mean()
    shuffled = np.random.default_rng(0).permutation(centres)
    assert apart < 0.5 * np.linalg.norm(np.diff(shuffled, axis=0), axis=1).mean()


def test_contacts_that_all_share_a_body_are_in_no_group():
    point = np.random.default_rng(3).random((5, 2))
    order, grouped = visiting_order(point, np.zeros(5, np.int32), np.arange(1, 6, dtype=np.int32), 2)
    assert grouped == 0
    assert np.array_equal(np.sort(order), np.arange(5))


def test_no_contacts_have_an_empty_order():
    order, grouped = visiting_order(np.empty((0, 2)), np.empty(0, np.int32), np.empty(0, np.int32), 8)
    assert len(order) == grouped == 0


def test_the_problem_records_the_order(heap):
    grains, state, walls, contacts = heap
    problem = assemble(grains, state, walls, contacts, Material(0.3, 0.2), grains.mass * 1e3)
    pairs = len(problem.rows) - len(problem.wall)
    assert np.array_equal(np.sort(problem.rows), np.arange(contacts.count))
    for c in range(pairs):
        assert tuple(problem.pair_body[c // GROUP, :, c % GROUP] // RECORD) == (
            contacts.i[problem.rows[c]],
            contacts.j[problem.rows[c]],
        )
    assert np.array_equal(problem.wall_body[:, 1] + grains.count, contacts.j[problem.rows[pairs:]])
