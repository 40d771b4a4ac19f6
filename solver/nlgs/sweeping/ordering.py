"""The order in which a sweep visits contacts.

Solutions are not unique and the order selects one of them, so it depends on the geometry alone and is recorded. It also
makes a sweep fast: neighbours in memory are neighbours in the packing (Morton order), and contacts form groups in which
no two share a body. A whole group is then relaxed at once, and the sweep is still a Gauss-Seidel sweep.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...bodies.grains import Array
from ...contacts.contacts import Contacts
from ...independent_blocks import independent_blocks

GROUP = 32  # contacts between grains that share no grain; four vectors of eight numbers
WALL_GROUP = 4  # contacts with walls: a frame has four walls


class VisitingOrder(NamedTuple):
    """Rows of contacts as a sweep visits them."""

    pair: NDArray[np.int64]  # (p,) between grains, the first `grouped` of them in groups that share no grain
    wall: NDArray[np.int64]  # (q,) with walls, after them
    grouped: int


def order_contacts(contacts: Contacts) -> VisitingOrder:
    """Order the contacts of a frame, those with walls last."""
    point, i, j = contacts.point, contacts.i, contacts.j
    pair, wall = np.flatnonzero(~contacts.with_wall), np.flatnonzero(contacts.with_wall)
    order, grouped = visiting_order(point[pair], i[pair], j[pair], GROUP)
    wall_order, _ = visiting_order(point[wall], i[wall], j[wall], WALL_GROUP)
    return VisitingOrder(pair[order], wall[wall_order], grouped)


def visiting_order(
    point: Array, i: NDArray[np.int32], j: NDArray[np.int32], size: int
) -> tuple[NDArray[np.int64], int]:
    """Order contacts in groups that share no body, groups along the Morton curve.

    Parameters
    ----------
    point : (c, 2)
        Positions of the contacts [m].
    i, j : (c,)
        Their bodies.
    size : int
        Contacts of a group.

    Returns
    -------
    tuple
        Permutation (c,) and the number of contacts in complete groups. The others follow in Morton order and may share
        bodies.
    """
    if len(point) == 0:
        return np.empty(0, np.int64), 0
    order = np.argsort(_morton_code(point), kind="stable")
    bodies = np.column_stack([i[order], j[order]]).astype(np.int64)
    items, begin = independent_blocks(2 * np.arange(len(order) + 1), bodies.ravel(), int(bodies.max()) + 1, size)
    complete = np.diff(begin) == size
    grouped = int(begin[len(complete) if complete.all() else np.argmin(complete)])
    return order[np.concatenate([items[:grouped], np.sort(items[grouped:])])], grouped


def _morton_code(point: Array) -> NDArray[np.uint64]:
    """Compute the Morton code: the interleaved bits of the coordinates, 16 bits each."""
    low = point.min(axis=0)
    extent = max(float((point.max(axis=0) - low).max()), 1e-30)
    cell = np.minimum((point - low) / extent * 65536.0, 65535.0).astype(np.uint64)
    return _spread(cell[:, 0]) | (_spread(cell[:, 1]) << np.uint64(1))


def _spread(x: NDArray[np.uint64]) -> NDArray[np.uint64]:
    for shift, mask in ((8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555)):
        x = (x | (x << np.uint64(shift))) & np.uint64(mask)
    return x
