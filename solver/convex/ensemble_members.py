"""The convex members of the ensemble: each uses the sliding of its own interval and its own previous forces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..bodies.grains import Array, Grains
from ..bodies.motion import Snapshot
from ..bodies.walls import Walls
from ..contacts.contacts import Contacts
from ..detection.displacement import contact_displacement, displacement_scale
from ..nlgs.force_memory import ForceMemory
from ..part_settings import SLIP_SIGMAS
from .program import Balance, ConvexForces, ConvexSettings, soft_slip, solve_convex_member

EXACT = 1e-12  # [m] floor of the standard deviation of a sliding


@dataclass(frozen=True, slots=True)
class NormalisedSlip:
    """Measured sliding (c,) in units of its noise and of its scale; zero where a grain is missing."""

    over_noise: Array  # u_t over its standard deviation
    over_scale: Array  # |u_t| over the displacement scale, or over its standard deviation if that is greater


@dataclass(frozen=True, slots=True)
class Slip:
    """The sliding that one member uses, and its weight against noise."""

    value: Array  # (c,) û_t, zero where unknown
    weight: float  # s² / (s² + noise²), from 0 (noise alone) to 1
    normalised: NormalisedSlip | None = None  # None: common part of two intervals


@dataclass(frozen=True, slots=True)
class RefinedMotion:
    """Motion of an interval, refined by the contacts."""

    position: tuple[Array, Array]  # (n, 2) [m] at the beginning and the end, NaN where a grain is missing
    slip_sd: Array  # (c,) [m] standard deviation of the sliding at each contact


def advance_convex_member(
    balance: Balance,
    contacts: Contacts,
    frame: Snapshot,
    slip: Slip,
    probability: Array,
    memory: ForceMemory,
    settings: ConvexSettings | None = None,
) -> tuple[ConvexForces, ForceMemory]:
    """Solve one convex member at a frame.

    Parameters
    ----------
    balance, contacts, frame
        Equilibrium equations, contacts and snapshot of the frame.
    slip : Slip
        Sliding on these contacts.
    probability : (c,)
        P(touch).
    memory : ForceMemory
        Previous forces of this member.

    Returns
    -------
    tuple
        Forces of the frame, and the memory for the next frame.
    """
    previous = memory.recall(contacts)
    forces = solve_convex_member(
        balance, slip.value, probability, previous[:, 0], previous[:, 1], settings, 1.0 - slip.weight
    )
    return forces, memory.renew(contacts, np.column_stack([forces.fn, forces.ft]), frame.present)


def measured_slip(
    contacts: Contacts,
    grains: Grains,
    walls: Walls,
    interval: tuple[Snapshot, Snapshot],
) -> Array:
    """Compute û_t (c,) of an interval: the value of `read_slip` alone."""
    return read_slip(contacts, grains, walls, interval).value


def read_slip(
    contacts: Contacts,
    grains: Grains,
    walls: Walls,
    interval: tuple[Snapshot, Snapshot],
    settings: ConvexSettings | None = None,
    refined: RefinedMotion | None = None,
) -> Slip:
    """Compute the sliding of an interval and its weight.

    Parameters
    ----------
    contacts, walls
        Of the frame whose forces are estimated.
    interval : tuple of Snapshot
        The earlier and the later snapshot.
    refined : RefinedMotion, optional
        Replaces the measured positions.

    Returns
    -------
    Slip
        Zero, that is no evidence, at contacts of a grain that is missing in either snapshot.
    """
    earlier, later = (np.where(s.present[:, None], s.position, np.nan) for s in interval)
    sigma = float(np.hypot(interval[0].sigma, interval[1].sigma) / np.sqrt(2.0))
    scale = displacement_scale(earlier, later, np.full(grains.count, sigma))
    slip_sd = np.full(contacts.count, SLIP_SIGMAS * sigma) if refined is None else refined.slip_sd
    _, ut = contact_displacement(
        contacts, grains.radius, (earlier, later) if refined is None else refined.position,
        (interval[0].rotation, interval[1].rotation), walls, (interval[0].endpoints, interval[1].endpoints),
        (interval[0].cell, interval[1].cell),
    )  # fmt: skip
    noise = float(np.mean(slip_sd**2)) if contacts.count else 0.0
    measured = np.nan_to_num(np.asarray(ut, dtype=np.float64), nan=0.0)
    floored_sd = np.maximum(slip_sd, EXACT)
    return Slip(
        soft_slip(ut, scale, slip_sd / SLIP_SIGMAS, settings), scale**2 / (scale**2 + noise),
        NormalisedSlip(measured / floored_sd, np.abs(measured) / np.maximum(scale, floored_sd)),
    )  # fmt: skip


def steady_slip(before: Slip, after: Slip) -> Slip:
    """Compute the sliding common to the intervals before and after a frame.

    Forces belong to an instant, measured motion to an interval. A contact that slides in the same direction before and
    after the frame slides at the frame. A contact whose sliding reverses may stick at the frame.

    Notes
    -----
    û = sign(û_before) min(|û_before|, |û_after|), and zero where the two are opposed.
    """
    same = before.value * after.value > 0.0
    lesser = np.sign(before.value) * np.minimum(np.abs(before.value), np.abs(after.value))
    return Slip(np.where(same, lesser, 0.0), min(before.weight, after.weight))
