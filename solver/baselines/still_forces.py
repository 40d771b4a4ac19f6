"""Forces read from one photograph's geometry, without any motion: the simplest fields that one could report.

All rods whose gap is small enough for the noise are taken to bear. Then either every contact bears the same; or the
forces are those in balance, inside the Coulomb cone, that are nearest to the same force on all; or those nearest to
forces in proportion to the overlaps, averaged over a few photographs. An estimator that reads the motion, too, should
never be worse.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from solver.bodies.grains import Array
from solver.bodies.motion import Snapshot
from solver.bodies.packing import Packing
from solver.bodies.walls import Walls
from solver.contacts.contacts import Contacts, detect_contacts, measure_contacts
from solver.contacts.pairs import Keys
from solver.convex.program import Balance, assemble_balance, polish

GAP_SIGMAS = 3.0  # standard deviations of a gap, to which a touching pair may seem to stand apart
AVERAGED = 2  # photographs before and after one, over which its overlaps are averaged
NEAR = 0.06  # of a mean diameter: pairs within it are compared
ISOSTATIC = 1.5  # contacts of a grain without which no packing of rods with friction stands, walls left aside


@dataclass(frozen=True, slots=True)
class StillForces:
    """One frame's fields, all on the same contacts; their size means something only where a load or weight sets it."""

    contacts: Contacts  # (c,) taken to bear
    near: Keys  # (m,) pairs worth comparing on: all within NEAR
    balanced: Array  # (c, 2) f_n, f_t [N] in balance, near the same force on all; NaN where no balance was found
    overlapping: Array  # (c, 2) [N] in balance, near forces in proportion to the overlaps; likewise
    uniform: Array  # (c, 2) [N] the same on all


def estimate_still(packing: Packing, snapshots: Sequence[Snapshot], k: int, noise: float) -> StillForces:
    """Estimate frame k of a sequence; noise [m], standard deviation of a position component."""
    snapshot = snapshots[k]
    walls, grains = packing.walls_of(snapshot), packing.grains
    near = detect_contacts(
        grains, snapshot.position, snapshot.present, walls, NEAR * 2.0 * float(grains.radius.mean())
    )  # fmt: skip
    touching = touching_gap(near.gap, int(snapshot.present.sum()))
    contacts = near.select(near.gap < touching + GAP_SIGMAS * np.sqrt(2.0) * noise)
    unit = _typical_force(packing, walls, snapshot)
    uniform = np.column_stack([np.full(contacts.count, unit), np.zeros(contacts.count)])
    overlap = np.maximum(touching - _mean_gap(packing, snapshots, k, contacts), 0.0)
    mean = float(overlap.mean()) if contacts.count else 0.0
    centre = uniform if mean == 0.0 else np.column_stack([unit * overlap / mean, np.zeros(contacts.count)])
    balance = _assemble(packing, walls, snapshot, contacts, unit)
    return StillForces(contacts, near.key, _bring_into(balance, uniform), _bring_into(balance, centre), uniform)


def touching_gap(gap: Array, grains: int) -> float:
    """The gap [m] that touching surfaces seem to have, of all gaps (m,) [m]: 0 unless radii are too small.

    As many pairs as a packing needs to stand touch; those nearest to each other are they.
    """
    count = min(round(ISOSTATIC * grains), len(gap))
    return max(float(np.median(np.partition(gap, count - 1)[:count])), 0.0) if count else 0.0


def _mean_gap(packing: Packing, snapshots: Sequence[Snapshot], k: int, contacts: Contacts) -> Array:
    """Gap of the pairs (c,) [m], averaged over the photographs around frame k that show both bodies."""
    gaps = []
    for each in snapshots[max(0, k - AVERAGED) : k + AVERAGED + 1]:
        position = np.where(each.present[:, None], each.position, np.nan)
        walls = each.walls
        gaps.append(measure_contacts(packing.grains, position, walls, contacts.i, contacts.j).gap)
    return np.nanmean(np.stack(gaps), axis=0)


def _typical_force(packing: Packing, walls: Walls, snapshot: Snapshot) -> float:
    """A force [N] of the size to be expected: of the plates' load, of the weight half way down, or of nothing known."""
    diameter = 2.0 * float(packing.grains.radius.mean())
    if walls.loaded.any():
        return float((walls.load[walls.loaded] / walls.face[walls.loaded]).mean()) * diameter
    weight = np.linalg.norm(packing.weight[snapshot.present], axis=1)
    return 0.5 * float(np.sqrt(len(weight)) * weight.mean()) if weight.any() else 1.0


def _assemble(packing: Packing, walls: Walls, snapshot: Snapshot, contacts: Contacts, unit: float) -> Balance:
    material = packing.material
    return assemble_balance(
        contacts, packing.grains, walls, present=snapshot.present,
        friction=material.friction_at(contacts.with_wall), force_unit=unit, gravity=material.gravity,
        wall_normal_total=None if packing.scale_is_known else unit * int(contacts.gauge.sum()),
    )  # fmt: skip


def _bring_into(balance: Balance, centre: Array) -> Array:
    """The forces in balance nearest to a centre (c, 2) [N]."""
    found = polish(balance, centre[:, 0], centre[:, 1])
    return np.column_stack([found.fn, found.ft]) if found.converged else np.full_like(centre, np.nan)
