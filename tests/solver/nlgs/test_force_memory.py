"""Stored forces return to their own contacts only."""

import numpy as np
import pytest
from rodsight.solver.contacts.contacts import detect_contacts
from rodsight.solver.nlgs.force_memory import ForceMemory

from tests.packings import box, motion, rods

GRAINS = rods(0.01, 0.01, 0.01, 0.01)
STATE = motion(np.array([[0.01, 0.01], [0.03, 0.01], [0.05, 0.01], [0.07, 0.01]]))
WALLS = box(0.2, 0.1)


@pytest.fixture
def contacts():
    """Pairs (0, 1), (1, 2), (2, 3) and every grain on the bottom, the first on the left wall, too."""
    return detect_contacts(GRAINS, STATE.position, STATE.present, WALLS, 1e-6)


def forces(contacts):
    return np.column_stack([1.0 + np.arange(contacts.count), 0.1 * np.arange(contacts.count)])


def test_stored_forces_are_recalled_and_new_contacts_have_none(contacts):
    some = np.arange(contacts.count) % 2 == 1
    memory = ForceMemory.empty().renew(contacts.select(some), forces(contacts)[some], STATE.present)
    assert memory.recall(contacts) == pytest.approx(np.where(some[:, None], forces(contacts), 0.0))
    assert np.all(ForceMemory.empty().recall(contacts) == 0.0)


def test_an_open_contact_loses_its_stored_force(contacts):
    memory = ForceMemory.empty().renew(contacts, forces(contacts), STATE.present)
    fewer = contacts.select(np.arange(contacts.count) > 0)
    memory = memory.renew(fewer, forces(contacts)[1:], STATE.present)
    assert np.all(memory.recall(contacts)[0] == 0.0)


@pytest.mark.parametrize("lost", [0, 2, 3])
def test_contacts_of_a_lost_grain_keep_their_stored_forces(contacts, lost):
    memory = ForceMemory.empty().renew(contacts, forces(contacts), STATE.present)
    of_lost = (contacts.i == lost) | (contacts.j == lost)
    assert of_lost.any()
    left = contacts.select(~of_lost)
    memory = memory.renew(left, 10.0 * forces(contacts)[~of_lost], np.arange(4) != lost)
    expected = np.where(of_lost[:, None], forces(contacts), 10.0 * forces(contacts))
    assert memory.recall(contacts) == pytest.approx(expected)
    assert np.all(np.diff(memory.key) > 0)
