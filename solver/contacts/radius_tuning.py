"""Radius tuning: a common change of all radii that gives a packing the coordination number it should have.

Absolute radii are known less well than the motion. Richefeu, Combe & Maurin (Powders & Grains 2013) vary all radii
slightly to tune the connectivity, to a coordination number close to 4 in their case. Contacts here are geometric:
bodies touch where the gap between them, with the changed radii, is not positive. No force takes part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array, Grains
from solver.bodies.quantity import Quantity
from solver.bodies.walls import Walls
from solver.contacts.connectivity import coordination_number
from solver.contacts.contacts import Contacts, detect_contacts

ABOVE_STEP = 1e-9  # [m] at most, from the step to the answer, so that rounding cannot lose the contact that makes it


@dataclass(frozen=True, slots=True)
class Candidates:
    """Pairs of one frame that some change of radius in reach makes touch."""

    contacts: Contacts
    level: Array  # (c,) [m] change of radius from which on the pair touches
    present: NDArray[np.bool_]  # (n,)


@dataclass(frozen=True, slots=True)
class RadiusTuning:
    """The curve z(δR), and the change at which it meets the wanted coordination number."""

    change: Annotated[Array, Quantity("change of all radii δR, ascending", "m", "radius_change")]
    coordination_number: Annotated[Array, Quantity("without rattlers, the mean over frames", dims="radius_change")]
    frame_coordination_number: Annotated[
        Array, Quantity("without rattlers, in every frame", dims="radius_change frame")
    ]
    wanted: Annotated[float, Quantity("coordination number that was asked for")]
    found: Annotated[float, Quantity("δR that gives the wanted number; NaN: none does", "m")]
    reached: Annotated[float, Quantity("coordination number at `found`, NaN without one")]

    @property
    def met(self) -> bool:
        return bool(np.isfinite(self.found))


def tune_radii(
    grains: Grains,
    position: Array,
    present: NDArray[np.bool_],
    walls: Sequence[Walls],
    wanted: float,
    change: Array,
) -> RadiusTuning:
    """Measure z(δR) and find the δR at which z, rattlers excluded, first meets the wanted value from below.

    position (f, n, 2) [m]; present (f, n); walls of every frame; change (m,) [m] ascending, at least two, the values
    of δR at which the curve is measured. A contact with a wall counts once; frames count alike.

    z(δR) is a staircase that steps wherever a pair begins to touch. The curve brackets the answer and bisection over
    the steps in the bracket finds the very step that reaches the wanted value, so that z stays below it just before.
    z need not rise everywhere: a rattler that gains its second contact is counted from then on. Where it crosses
    several times, the answer is a crossing in the first bracket that the curve shows.
    """
    change = np.asarray(change, float)
    if change.ndim != 1 or len(change) < 2 or not np.all(np.diff(change) > 0) or not np.all(np.isfinite(change)):
        raise ValueError("the changes of radius must be at least two finite numbers that ascend")
    if not len(position) == len(present) == len(walls) or len(position) == 0:
        raise ValueError("position, present and walls must have the same number of frames, at least one")
    smallest = float(grains.radius.min())
    if change[0] <= -smallest:
        raise ValueError(f"a change of {change[0]} m leaves the smallest radius, {smallest} m, not positive")
    frames = [
        find_candidates(grains, position[k], present[k], walls[k], float(change[-1])) for k in range(len(position))
    ]
    curve = np.array([coordination_numbers(frames, each) for each in change])
    mean = curve.mean(axis=1)
    found, reached = _find(frames, change, mean, wanted)
    return RadiusTuning(change, mean, curve, wanted, found, reached)


def find_candidates(
    grains: Grains, position: Array, present: NDArray[np.bool_], walls: Walls, greatest_change: float
) -> Candidates:
    """Find the pairs of one frame that touch at a change of radius up to `greatest_change` [m].

    position (n, 2) [m]; present (n,). Two grains share what closes their gap; a wall does not grow.
    """
    reach = greatest_change + ABOVE_STEP
    contacts = detect_contacts(grains, position, present, walls, 2.0 * reach, wall_threshold=reach)
    return Candidates(contacts, np.where(contacts.with_wall, contacts.gap, 0.5 * contacts.gap), present & grains.free)


def coordination_numbers(frames: Sequence[Candidates], change: float) -> Array:
    """Coordination number without rattlers of every frame (f,), all radii changed by `change` [m]."""
    return np.array(
        [
            coordination_number(each.contacts, each.level <= change, each.present, without_rattlers=True)
            for each in frames
        ]
    )


def _find(frames: Sequence[Candidates], change: Array, mean: Array, wanted: float) -> tuple[float, float]:
    """Bisect over the steps of the first interval of the curve that rises through the wanted value."""
    risen = np.flatnonzero((mean[:-1] < wanted) & (mean[1:] >= wanted))
    if len(risen) == 0:
        return float("nan"), float("nan")
    low, high = change[risen[0]], change[risen[0] + 1]
    level = np.concatenate([each.level for each in frames])
    # z is constant from one step to the next; z(steps[before]) < wanted <= z(steps[after]) all along.
    steps = np.unique(np.concatenate([[low], level[(level > low) & (level <= high)]]))
    before, after = 0, len(steps) - 1
    while after - before > 1:
        middle = (before + after) // 2
        if coordination_numbers(frames, steps[middle]).mean() >= wanted:
            after = middle
        else:
            before = middle
    later = steps[after + 1] if after + 1 < len(steps) else np.inf
    found = float(min(0.5 * (steps[after] + later), steps[after] + ABOVE_STEP))
    return found, float(coordination_numbers(frames, found).mean())
