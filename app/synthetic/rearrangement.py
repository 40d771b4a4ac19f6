"""Where a simulated packing rearranges: how badly the former forces fit the network that follows."""

from __future__ import annotations

import numpy as np

from solver.bodies.grains import Array, Grains
from solver.bodies.walls import Walls
from solver.contacts.contacts import measure_contacts
from solver.contacts.pairs import are_among, make_keys
from solver.dem.simulation import DemTruth
from solver.statistics.balance import unbalances


def measure_old_unbalance(truth: DemTruth) -> Array:
    """Mean |ΣF| of the true forces of frame k−1 on those of its contacts that frame k still has, over mean f_n.

    Returns (f,), NaN at frame 0. Small while contacts last and turn slowly, large where strong contacts open.
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
        result[k] = unbalances(contacts, fn, ft, weight).mean() / truth.fn[old].mean()
    return result


def choose_window(old_unbalance: Array, frames: int) -> tuple[int, int]:
    """Choose `frames` consecutive photographs with the greatest rearrangement: (first photograph, event's).

    The event is the photograph of greatest ū (f,) among those with half a window before them and a
    quarter, itself counted, behind: forces found from the photographs have settled when it comes and
    may settle again after it. It stands in the middle of the window, or later where the photographs end.
    """
    before, behind = frames // 2, -(-frames // 4)
    last = len(old_unbalance) - behind
    if before < 1 or last < before:
        raise ValueError(f"{len(old_unbalance)} photographs leave no choice of {frames} around a rearrangement")
    event = before + int(np.argmax(old_unbalance[before : last + 1]))
    return min(event - before, len(old_unbalance) - frames), event
