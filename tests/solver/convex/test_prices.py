import numpy as np
import pytest

from solver.contacts.contacts import Contacts, detect_contacts
from solver.convex.prices import price_pairs
from solver.convex.program import assemble_balance, solve_member
from tests.packings import box, rods

RADIUS = 0.01
UNIT = 20.0  # [N]
OUT = 1e3  # [displacement scales] beyond what any sliding costs: the price of an unbalance that nothing else can bear


def column(top_load: float):
    """Three rods on top of each other between bottom and a plate."""
    grains = rods(RADIUS, RADIUS, RADIUS)
    position = np.array([[0.05, RADIUS], [0.05, 3 * RADIUS], [0.05, 5 * RADIUS]])
    walls = box(0.1, 6 * RADIUS, top_load=top_load)
    near = detect_contacts(grains, position, np.ones(3, bool), walls, 1e-9)
    assert near.count == 4
    return grains, position, walls, near


def price(grains, walls, contacts: Contacts, pairs: Contacts, present=None) -> np.ndarray:
    present = np.ones(grains.count, bool) if present is None else present
    balance = assemble_balance(
        contacts, grains, walls, present=present, friction=np.full(contacts.count, 0.25), force_unit=UNIT
    )
    nothing = np.zeros(contacts.count)
    found = solve_member(balance, nothing, nothing + 1.0, nothing, nothing)
    return price_pairs(pairs, balance, [np.column_stack([found.fn, found.ft])], walls, present)


@pytest.mark.parametrize("missing", range(4))
def test_a_contact_that_the_balance_cannot_do_without_has_a_price_wherever_it_is(missing):
    grains, _, walls, near = column(top_load=20.0)
    left = np.arange(4) != missing
    assert price(grains, walls, near.select(left), near.select(~left))[0] > 100.0


def test_contacts_that_bear_what_there_is_to_bear_close_by_next_to_nothing():
    grains, _, walls, near = column(top_load=20.0)
    assert np.abs(price(grains, walls, near, near)).max() < 0.1


def test_a_pair_that_the_multipliers_part_has_a_negative_price():
    """Without a bottom the column is pushed out of the box: everything above parts from what is held beside it."""
    grains, position, walls, near = column(top_load=20.0)
    bottom = near.with_wall & (near.normal[:, 1] < 0)
    open_box = near.select(~bottom)
    upside_down = box(0.1, 6 * RADIUS, top_load=20.0)
    pairs = detect_contacts(grains, position, np.ones(3, bool), upside_down, 0.05).select(slice(None))
    told = price(grains, walls, open_box, pairs)
    assert told[pairs.with_wall & (pairs.normal[:, 1] < 0)].max() > 100.0
    assert np.abs(told[np.abs(pairs.normal[:, 0]) > 0.9]).max() < 1.0
