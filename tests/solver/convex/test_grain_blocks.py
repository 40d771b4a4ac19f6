"""The equilibrium equations in blocks equal those of the matrix, for any number of grains."""

from __future__ import annotations

import numpy as np
from rodsight.solver.convex.contact_jacobian import JACOBIAN_SIZE, PADDED_ROWS, ROWS
from rodsight.solver.convex.grain_blocks import block_balance
from scipy import sparse

GRAINS = 60_000  # the number of grain times contact exceeds 32 bits


def test_a_packing_of_many_grains_has_the_jacobian_of_its_matrix():
    contacts = GRAINS - 1  # a chain of grains, each on the next
    contact = np.arange(contacts)
    rows = np.concatenate([contact, contact + 1, GRAINS + contact])
    columns = np.concatenate([contact, contact, contacts + contact])
    values = np.concatenate([np.ones(contacts), -np.ones(contacts), 1.0 + contact])
    matrix = sparse.csr_matrix((values, (rows, columns)), shape=(ROWS * GRAINS, 2 * contacts))
    blocks = block_balance(matrix, np.arange(ROWS * GRAINS, dtype=float), GRAINS, contacts)
    assert np.array_equal(np.diff(blocks.jacobian_start), np.full(contacts, 2))
    place = blocks.pattern.place
    last = contacts - 1
    by_node = {
        int(blocks.node[q]): blocks.jacobian[JACOBIAN_SIZE * q : JACOBIAN_SIZE * (q + 1)]
        for q in range(blocks.jacobian_start[last], blocks.jacobian_start[last + 1])
    }
    assert np.array_equal(by_node[int(place[GRAINS - 2])], [1.0, 0.0, 0.0, 0.0, 0.0, 1.0 + last, 0.0, 0.0])
    assert np.array_equal(by_node[int(place[GRAINS - 1])], [-1.0] + 7 * [0.0])
    assert blocks.load.reshape(-1, PADDED_ROWS)[place[7]].tolist() == [7.0, GRAINS + 7.0, 2 * GRAINS + 7.0, 0.0]
