"""The convex members of the ensemble: each reads the motion of its own interval and keeps its own history."""

from __future__ import annotations

import numpy as np

from solver.boundaries import Walls
from solver.contacts import Contacts
from solver.convex import Balance, ConvexForces, ConvexSettings, soft_slip, solve_member
from solver.displacement import contact_displacement, displacement_scale
from solver.grains import Array, Grains
from solver.motion import Snapshot
from solver.warm_start import ForceMemory


def advance_member(
    balance: Balance,
    contacts: Contacts,
    grains: Grains,
    walls: Walls,
    frame: Snapshot,
    interval: tuple[Snapshot, Snapshot],
    probability: Array,
    memory: ForceMemory,
    settings: ConvexSettings | None = None,
) -> tuple[ConvexForces, ForceMemory]:
    """Take one member to a frame: its forces there, and its memory for the next frame.

    balance, contacts, walls and frame are those of the frame; interval: the earlier and the later snapshot whose
    motion this member reads (`member_intervals`); probability (c,), P(touch).
    """
    slip = measured_slip(contacts, grains, walls, interval, settings)
    previous = memory.recall(contacts)
    forces = solve_member(balance, slip, probability, previous[:, 0], previous[:, 1], settings)
    return forces, memory.renew(contacts, np.column_stack([forces.fn, forces.ft]), frame.present)


def measured_slip(
    contacts: Contacts,
    grains: Grains,
    walls: Walls,
    interval: tuple[Snapshot, Snapshot],
    settings: ConvexSettings | None = None,
) -> Array:
    """Give û_t (c,) of an interval; zero, that is no evidence, at contacts of a grain missing at either end."""
    earlier, later = (np.where(s.present[:, None], s.position, np.nan) for s in interval)
    sigma = float(np.hypot(interval[0].sigma, interval[1].sigma) / np.sqrt(2.0))
    scale = displacement_scale(earlier, later, np.full(grains.count, sigma))
    _, ut = contact_displacement(
        contacts, grains.radius, (earlier, later), (interval[0].rotation, interval[1].rotation),
        walls, (interval[0].endpoints, interval[1].endpoints),
    )  # fmt: skip
    return soft_slip(ut, scale, sigma, settings)
