"""The convex members of the ensemble: each reads the sliding of its own interval and keeps its own history."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.bodies.grains import Array, Grains
from solver.bodies.motion import Snapshot
from solver.bodies.walls import Walls
from solver.contacts.contacts import Contacts
from solver.convex.program import SLIP_SIGMAS, Balance, ConvexForces, ConvexSettings, soft_slip, solve_member
from solver.detection.displacement import contact_displacement, displacement_scale
from solver.nlgs.warm_start import ForceMemory

EXACT = 1e-12  # [m] standard deviation of a sliding that counts as no noise at all


@dataclass(frozen=True, slots=True)
class SeenSlip:
    """Measured sliding (c,), zero where a grain is missing."""

    over_noise: Array  # u_t over its standard deviation
    over_scale: Array  # |u_t| over what neighbours move by, or over its standard deviation where that is more


@dataclass(frozen=True, slots=True)
class Slip:
    """The sliding that one member reads off the photographs, and how much the noise leaves of it."""

    value: Array  # (c,) û_t, zero where nothing is known
    worth: float  # s² / (s² + noise²), from 0 (noise alone) to 1
    seen: SeenSlip | None = None  # what it was read from; None: from what two intervals have in common


@dataclass(frozen=True, slots=True)
class RefinedMotion:
    """An interval's motion as refined by the contacts."""

    position: tuple[Array, Array]  # (n, 2) [m] at its beginning and its end, NaN where a grain is missing
    deviation: Array  # (c,) [m] standard deviation of the sliding at each contact


def advance_member(
    balance: Balance,
    contacts: Contacts,
    frame: Snapshot,
    slip: Slip,
    probability: Array,
    memory: ForceMemory,
    settings: ConvexSettings | None = None,
) -> tuple[ConvexForces, ForceMemory]:
    """Take one member to a frame: its forces there, and its memory for the next frame.

    balance, contacts and frame are those of the frame; slip on these contacts; probability (c,), P(touch).
    """
    previous = memory.recall(contacts)
    forces = solve_member(balance, slip.value, probability, previous[:, 0], previous[:, 1], settings)
    return forces, memory.renew(contacts, np.column_stack([forces.fn, forces.ft]), frame.present)


def measured_slip(
    contacts: Contacts,
    grains: Grains,
    walls: Walls,
    interval: tuple[Snapshot, Snapshot],
    settings: ConvexSettings | None = None,
) -> Array:
    """Give û_t (c,) of an interval alone: `read_slip` without its worth."""
    return read_slip(contacts, grains, walls, interval, settings).value


def read_slip(
    contacts: Contacts,
    grains: Grains,
    walls: Walls,
    interval: tuple[Snapshot, Snapshot],
    settings: ConvexSettings | None = None,
    refined: RefinedMotion | None = None,
) -> Slip:
    """Read the sliding of an interval; zero, that is no evidence, at contacts of a grain missing at either end.

    contacts and walls are those of the frame whose forces are sought; interval: the earlier and the later snapshot;
    refined: what is known better than the photographs themselves say.
    """
    earlier, later = (np.where(s.present[:, None], s.position, np.nan) for s in interval)
    sigma = float(np.hypot(interval[0].sigma, interval[1].sigma) / np.sqrt(2.0))
    scale = displacement_scale(earlier, later, np.full(grains.count, sigma))
    deviation = np.full(contacts.count, SLIP_SIGMAS * sigma) if refined is None else refined.deviation
    _, ut = contact_displacement(
        contacts, grains.radius, (earlier, later) if refined is None else refined.position,
        (interval[0].rotation, interval[1].rotation), walls, (interval[0].endpoints, interval[1].endpoints),
        (interval[0].cell, interval[1].cell),
    )  # fmt: skip
    noise = float(np.mean(deviation**2)) if contacts.count else 0.0
    seen = np.nan_to_num(np.asarray(ut, dtype=np.float64), nan=0.0)
    sure = np.maximum(deviation, EXACT)
    return Slip(
        soft_slip(ut, scale, deviation / SLIP_SIGMAS, settings), scale**2 / (scale**2 + noise),
        SeenSlip(seen / sure, np.abs(seen) / np.maximum(scale, sure)),
    )  # fmt: skip


def steady_slip(before: Slip, after: Slip) -> Slip:
    """Give the sliding that outlasts the frame: the lesser of the two, none where they are opposed.

    Forces are those of an instant, the photographs show an interval. A contact that slides on both sides of the frame
    surely slides at it; one that turns round in between may stick, and then its sliding says nothing.
    """
    same = before.value * after.value > 0.0
    lesser = np.sign(before.value) * np.minimum(np.abs(before.value), np.abs(after.value))
    return Slip(np.where(same, lesser, 0.0), min(before.worth, after.worth))
