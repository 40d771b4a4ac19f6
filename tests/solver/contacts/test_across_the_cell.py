"""Contacts across the edges of a periodic cell, and contacts of boundary grains."""

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.bodies.cell import Cell
from rodsight.solver.bodies.grains import Array, Grains
from rodsight.solver.bodies.walls import Walls
from rodsight.solver.contacts.contacts import Contacts, detect_contacts
from rodsight.solver.contacts.kinematics import relative_motion
from rodsight.solver.statistics.stress import branch_vectors

from tests.packings import box, rods

VECTORS = np.array([[0.1, 0.0], [0.03, 0.09]])


def dense() -> tuple[Grains, Array]:
    rng = np.random.default_rng(5)
    fraction = (np.stack(np.meshgrid(np.arange(6), np.arange(5)), axis=-1).reshape(-1, 2) + 0.3) / (6, 5)
    return rods(*rng.uniform(0.0085, 0.0095, 30)), fraction @ VECTORS + rng.uniform(-5e-4, 5e-4, (30, 2))


def contacts_in(cell: Cell, position: Array, grains: Grains) -> tuple[Contacts, Walls]:
    walls = Walls(np.empty((0, 2, 2)), np.empty((0, 2, 2)), np.empty(0), cell=cell)
    return detect_contacts(grains, position, np.ones(len(position), bool), walls, 1e-3), walls


def test_contacts_do_not_depend_on_the_origin_of_the_cell() -> None:
    grains, position = dense()
    here, _ = contacts_in(Cell.at_rest(VECTORS), position, grains)
    elsewhere = Cell.at_rest(VECTORS).wrapped(position + np.array([0.04, 0.05]))
    there, _ = contacts_in(Cell.at_rest(VECTORS), elsewhere, grains)
    assert here.count > 40
    assert here.key.tolist() == there.key.tolist()
    assert there.gap == pytest.approx(here.gap, abs=1e-12)
    assert there.normal == pytest.approx(here.normal, abs=1e-9)
    assert branch_vectors(there, elsewhere) == pytest.approx(branch_vectors(here, position), abs=1e-12)


def test_relative_motion_across_the_edge_is_that_of_homogeneous_shear() -> None:
    grains, position = dense()
    gradient = np.array([[0.0, 0.02], [0.0, -0.01]])  # [1/s]
    contacts, walls = contacts_in(Cell(VECTORS, VECTORS @ gradient.T), position, grains)
    un, ut = relative_motion(contacts, grains.radius, position @ gradient.T, np.zeros(30), walls)
    moved = branch_vectors(contacts, position) @ gradient.T
    assert contacts.shift is not None
    assert np.any(contacts.shift, axis=1).sum() > 5
    assert un == pytest.approx(np.einsum("ck,ck->c", moved, contacts.normal), abs=1e-12)
    assert ut == pytest.approx(np.einsum("ck,ck->c", moved, contacts.tangent), abs=1e-12)


def test_boundary_grains_have_no_contacts_with_each_other_or_walls() -> None:
    grains = rods(0.01, 0.01, 0.01)
    position = np.array([[0.01, 0.01], [0.03, 0.01], [0.05, 0.01]])
    marked = replace(grains, boundary=np.array([True, True, False]))
    found = detect_contacts(marked, position, np.ones(3, bool), box(0.06, 0.05), 1e-6)
    assert list(zip(found.i, found.j, strict=True)) == [(1, 2), (2, 3), (2, 4)]
