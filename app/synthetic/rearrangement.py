"""Rearrangements of a simulated packing: the residual of the previous forces on the following contact network."""

from __future__ import annotations

import numpy as np

from ..solver.bodies.grains import Array, Grains
from ..solver.bodies.walls import Walls
from ..solver.contacts.contacts import measure_contacts
from ..solver.contacts.pairs import are_among, make_keys
from ..solver.dem.dem_truth import DemTruth
from ..solver.statistics.balance import resultant_norms


def measure_old_unbalance(truth: DemTruth) -> Array:
    """Compute the residual ū of the previous true forces on the lasting contacts of each frame.

    Returns
    -------
    ndarray
        (f,) mean |ΣF| of the forces of frame k−1 over their mean f_n, NaN at frame 0: small while contacts last and
        rotate slowly, large where strong contacts open.
    """
    settings = truth.settings
    grains = Grains.of_rods(truth.radius, density=settings.density, length=settings.length)
    bodies, weight = grains.count + len(truth.wall_names), grains.weight(settings.gravity)
    result = np.full(truth.frame_count, np.nan)
    for k in range(1, truth.frame_count):
        old, new = (slice(int(truth.offset[m]), int(truth.offset[m + 1])) for m in (k - 1, k))
        old_key, new_key = (make_keys(truth.i[rows], truth.j[rows], bodies) for rows in (old, new))
        lasting = are_among(old_key, new_key)
        i, j = truth.i[old][lasting], truth.j[old][lasting]
        contacts = measure_contacts(grains, truth.position[k], Walls.at_rest(truth.endpoints[k]), i, j)
        fn, ft = truth.fn[old][lasting], truth.ft[old][lasting]
        result[k] = resultant_norms(contacts, fn, ft, weight).mean() / truth.fn[old].mean()
    return result


def choose_window(old_unbalance: Array, frames: int) -> tuple[int, int]:
    """Choose `frames` consecutive photographs around the greatest rearrangement.

    The event is the photograph of greatest ū (f,) among those with half a window before them and a quarter of a window
    from them on, so that inferred forces settle before it and again after it. It is in the middle of the window, or
    later where the photographs end.

    Returns
    -------
    tuple of int
        First photograph of the window, and photograph of the event.
    """
    if frames == 1:  # nothing settles around it
        event = int(np.argmax(old_unbalance))
        return event, event
    before, behind = frames // 2, -(-frames // 4)
    last = len(old_unbalance) - behind
    if before < 1 or last < before:
        raise ValueError(f"{len(old_unbalance)} photographs leave no choice of {frames} around a rearrangement")
    event = before + int(np.argmax(old_unbalance[before : last + 1]))
    return min(event - before, len(old_unbalance) - frames), event
