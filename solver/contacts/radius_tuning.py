"""Radius tuning: a common change of all radii that gives a packing a required coordination number.

Absolute radii are known less well than the motion. Richefeu, Combe & Maurin (Powders & Grains 2013) vary all radii
slightly to tune the connectivity, to a coordination number close to 4 in their case. Contacts are geometric here:
bodies touch where the gap between them, with the changed radii, is not positive. Forces are not used.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array, Grains
from ..bodies.walls import Walls
from ..quantity import Quantity
from .connectivity import coordination_number
from .contacts import Contacts, detect_contacts

ABOVE_STEP = 1e-9  # [m] greatest distance of the solution above its step, so that rounding does not lose the contact


@dataclass(frozen=True, slots=True)
class TuningPairs:
    """Pairs of one frame that touch at some change of radius within the range."""

    contacts: Contacts
    level: Array  # (c,) [m] least change of radius at which the pair touches
    present: NDArray[np.bool_]  # (n,)


@dataclass(frozen=True, slots=True)
class RadiusTuning:
    """The curve z(δR), and the change at which it reaches the required coordination number."""

    change: Annotated[Array, Quantity("change of all radii δR, ascending", "m", "radius_change")]
    coordination_number: Annotated[Array, Quantity("without rattlers, the mean over frames", dims="radius_change")]
    frame_coordination_number: Annotated[
        Array, Quantity("without rattlers, in every frame", dims="radius_change frame")
    ]
    wanted: Annotated[float, Quantity("required coordination number")]
    found: Annotated[float, Quantity("δR that gives the required number; NaN: none does", "m")]
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
    """Measure z(δR) and find the δR at which z, rattlers excluded, first reaches the required value from below.

    Parameters
    ----------
    grains
        Grains with their radii.
    position : (f, n, 2)
        Positions [m].
    present : (f, n) bool
        Grains seen in every frame.
    walls
        Walls of every frame.
    wanted
        Required coordination number. A contact with a wall counts once; all frames have equal weight.
    change : (m,)
        Values of δR [m] at which the curve is measured, ascending, at least two.

    Raises
    ------
    ValueError
        The changes do not ascend, leave a radius negative, or the frames disagree in number.

    Notes
    -----
    z(δR) is a step function with a step wherever a pair begins to touch. The curve brackets the solution, and
    bisection over the steps in the bracket finds the step that reaches the required value. z need not be monotonic: a
    rattler is counted from its second contact on. If z crosses the value several times, the solution is a crossing in
    the first bracket of the curve.
    """
    change = np.asarray(change, float)
    if change.ndim != 1 or len(change) < 2 or not np.all(np.diff(change) > 0) or not np.all(np.isfinite(change)):
        raise ValueError("the changes of radius must be at least two finite numbers that ascend")
    if not len(position) == len(present) == len(walls) or len(position) == 0:
        raise ValueError("position, present and walls must have the same number of frames, at least one")
    smallest = float(grains.radius.min())
    if change[0] <= -smallest:
        raise ValueError(f"a change of {change[0]} m makes the smallest radius, {smallest} m, zero or negative")
    frames = [
        find_tuning_pairs(grains, position[k], present[k], walls[k], float(change[-1])) for k in range(len(position))
    ]
    curve = np.array([coordination_numbers(frames, each) for each in change])
    mean = curve.mean(axis=1)
    found, reached = _find(frames, change, mean, wanted)
    return RadiusTuning(change, mean, curve, wanted, found, reached)


def find_tuning_pairs(
    grains: Grains, position: Array, present: NDArray[np.bool_], walls: Walls, greatest_change: float
) -> TuningPairs:
    """Find the pairs of one frame that touch at a change of radius up to `greatest_change` [m].

    position (n, 2) [m]; present (n,). The gap between two grains closes by twice the change, that to a wall by once.
    """
    reach = greatest_change + ABOVE_STEP
    contacts = detect_contacts(grains, position, present, walls, 2.0 * reach, wall_threshold=reach)
    return TuningPairs(contacts, np.where(contacts.with_wall, contacts.gap, 0.5 * contacts.gap), present & grains.free)


def coordination_numbers(frames: Sequence[TuningPairs], change: float) -> Array:
    """Return the coordination number without rattlers of every frame (f,), all radii changed by `change` [m]."""
    return np.array(
        [
            coordination_number(each.contacts, each.level <= change, each.present, without_rattlers=True)
            for each in frames
        ]
    )


def _find(frames: Sequence[TuningPairs], change: Array, mean: Array, wanted: float) -> tuple[float, float]:
    """Bisect over the steps of the first interval of the curve that rises through the required value."""
    risen = np.flatnonzero((mean[:-1] < wanted) & (mean[1:] >= wanted))
    if len(risen) == 0:
        return float("nan"), float("nan")
    low, high = change[risen[0]], change[risen[0] + 1]
    level = np.concatenate([each.level for each in frames])
    # z is constant between steps; the loop keeps z(steps[before]) < wanted <= z(steps[after]).
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
