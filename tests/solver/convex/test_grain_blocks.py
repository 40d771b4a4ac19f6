"""The balance by blocks is the balance, whatever the number of grains."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from solver.convex.grain_blocks import block_balance
from solver.convex.legs import FILLED, LEG, ROWS

GRAINS = 60_000  # pairs of grains and contacts have numbers beyond 32 bits


def test_a_packing_of_many_grains_has_the_legs_of_its_balance():
    contacts = GRAINS - 1  # a chain of grains, each on the next
    contact = np.arange(contacts)
    rows = np.concatenate([contact, contact + 1, GRAINS + contact])
    columns = np.concatenate([contact, contact, contacts + contact])
    values = np.concatenate([np.ones(contacts), -np.ones(contacts), 1.0 + contact])
    matrix = sparse.csr_matrix((values, (rows, columns)), shape=(ROWS * GRAINS, 2 * contacts))
    blocks = block_balance(matrix, np.arange(ROWS * GRAINS, dtype=float), GRAINS, contacts)
    assert np.array_equal(np.diff(blocks.leg_start), np.full(contacts, 2))
    place = blocks.pattern.place
    last = contacts - 1
    legs = {
        int(blocks.node[q]): blocks.leg[LEG * q : LEG * (q + 1)]
        for q in range(blocks.leg_start[last], blocks.leg_start[last + 1])
    }
    assert np.array_equal(legs[int(place[GRAINS - 2])], [1.0, 0.0, 0.0, 0.0, 0.0, 1.0 + last, 0.0, 0.0])
    assert np.array_equal(legs[int(place[GRAINS - 1])], [-1.0] + 7 * [0.0])
    assert blocks.load.reshape(-1, FILLED)[place[7]].tolist() == [7.0, GRAINS + 7.0, 2 * GRAINS + 7.0, 0.0]
