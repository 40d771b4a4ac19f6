import numpy as np
import pytest
from rodsight.solver.contacts.contacts import Contacts, detect_contacts
from rodsight.solver.convex.dual_prices import price_pairs
from rodsight.solver.convex.program import LoadScale, assemble_balance, solve_convex_member

from tests.packings import box, rods

RADIUS = 0.01
UNIT = 20.0  # [N]
OUT = 1e3  # [displacement scales] price of a force residual that no contact can remove


def column(top_load: float):
    """Three rods on top of each other between bottom and a plate."""
    grains = rods(RADIUS, RADIUS, RADIUS)
    position = np.array([[0.05, RADIUS], [0.05, 3 * RADIUS], [0.05, 5 * RADIUS]])
    walls = box(0.1, 6 * RADIUS, top_load=top_load)
    contacts = detect_contacts(grains, position, np.ones(3, bool), walls, 1e-9)
    assert contacts.count == 4
    return grains, position, walls, contacts


def price(grains, walls, contacts: Contacts, pairs: Contacts, present=None) -> np.ndarray:
    present = np.ones(grains.count, bool) if present is None else present
    balance = assemble_balance(
        contacts, grains, walls, present=present, friction=np.full(contacts.count, 0.25), scale=LoadScale(UNIT)
    )
    nothing = np.zeros(contacts.count)
    found = solve_convex_member(balance, nothing, nothing + 1.0, nothing, nothing)
    return price_pairs(pairs, balance, [np.column_stack([found.fn, found.ft])], walls, present)


@pytest.mark.parametrize("missing", range(4))
def test_a_missing_necessary_contact_has_a_high_price(missing):
    grains, _, walls, contacts = column(top_load=20.0)
    left = np.arange(4) != missing
    assert price(grains, walls, contacts.select(left), contacts.select(~left))[0] > 100.0


def test_existing_contacts_hardly_close():
    grains, _, walls, contacts = column(top_load=20.0)
    assert np.abs(price(grains, walls, contacts, contacts)).max() < 0.1


def test_a_pair_that_the_multipliers_separate_has_no_price():
    """Without a bottom the column moves down: its contact with the bottom closes, pairs with the sides do not."""
    grains, position, walls, contacts = column(top_load=20.0)
    bottom = contacts.with_wall & (contacts.normal[:, 1] < 0)
    open_box = contacts.select(~bottom)
    upside_down = box(0.1, 6 * RADIUS, top_load=20.0)
    pairs = detect_contacts(grains, position, np.ones(3, bool), upside_down, 0.05).select(slice(None))
    prices = price(grains, walls, open_box, pairs)
    assert prices[pairs.with_wall & (pairs.normal[:, 1] < 0)].max() > 100.0
    assert np.abs(prices[np.abs(pairs.normal[:, 0]) > 0.9]).max() < 1.0
