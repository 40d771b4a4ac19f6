"""Is the given coefficient of friction the one that the motion shows? Too low a one is the worst error of all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from solver.bodies.grains import Array
from solver.bodies.motion import Snapshot
from solver.bodies.packing import Packing
from solver.bodies.quantity import Quantity
from solver.convex.friction_estimate import FACTORS, SlidingFrame, estimate_friction
from solver.convex.members import measured_slip
from solver.convex.program import assemble_balance
from solver.detection.touch_probability import ContactProbabilitySettings, probable_contacts, window_of

# The least power gap lies below the true friction: by this factor on simulated packings, give or take the scatter
# (packings of 500 and 1172 grains, μ = 0.15, 0.25 and 0.4).
KNOWN_BIAS = 0.92
BIAS_SCATTER = 0.07
INTERVAL = 2.0  # standard deviations
FRAMES = 8  # consecutive photographs that the check looks at


@dataclass(frozen=True, slots=True)
class FrictionCheck:
    """The friction that the motion shows, over the one that was given."""

    given: Annotated[float, Quantity("friction that was given")]
    measured: Annotated[float, Quantity("friction that the motion shows; NaN where nothing slides")]
    low: Annotated[float, Quantity("lower end of the interval of two standard deviations")]
    high: Annotated[float, Quantity("upper end of that interval")]
    first: Annotated[int, Quantity("first of the frames looked at", absent=0)]
    last: Annotated[int, Quantity("last of the frames looked at", absent=0)]
    enclosed: Annotated[bool, Quantity("whether the friction lies within the trials", absent=False)]
    trial: Annotated[Array, Quantity("factors on the given friction that were tried", dims="friction_trial")]
    gap: Annotated[Array, Quantity("relative power gap of every trial", dims="friction_trial")]

    @property
    def agrees(self) -> bool:
        """Whether the given friction is within the interval, or nothing can be said."""
        return not self.enclosed or self.low <= self.given <= self.high


def check_friction(
    packing: Packing,
    snapshots: Sequence[Snapshot],
    first: int,
    last: int,
    force_unit: float,
    settings: ContactProbabilitySettings,
) -> FrictionCheck:
    """Measure the friction from the sliding in the frames first … last, each over (k − 1, k + 1).

    force_unit [N]: a typical contact force. Errors: ValueError unless 1 ≤ first ≤ last < number of frames − 1.
    """
    if not 1 <= first <= last < len(snapshots) - 1:
        raise ValueError(f"frames {first} … {last} have no neighbours on both sides in {len(snapshots)} frames")
    frames = [_sliding_frame(packing, snapshots, k, force_unit, settings) for k in range(first, last + 1)]
    found = estimate_friction(frames, FACTORS)
    given = packing.material.friction
    measured = given * found.factor / KNOWN_BIAS
    spread = 0.0 if np.isnan(found.factor_sd) else found.factor_sd / max(found.factor, 1e-12)
    width = INTERVAL * float(np.hypot(spread, BIAS_SCATTER))
    return FrictionCheck(
        given, measured, measured * (1.0 - width), measured * (1.0 + width), first, last, found.enclosed,
        found.trial, found.gap,
    )  # fmt: skip


def _sliding_frame(
    packing: Packing, snapshots: Sequence[Snapshot], k: int, force_unit: float, settings: ContactProbabilitySettings
) -> SlidingFrame:
    snapshot, window = snapshots[k], window_of(k, len(snapshots))
    contacts, probability = probable_contacts(
        packing.grains, [snapshots[f] for f in window], k - window.start, settings
    )
    walls = packing.walls(snapshot.endpoints)
    friction = packing.material.friction_at(contacts.with_wall)
    balance = assemble_balance(
        contacts, packing.grains, walls, present=snapshot.present, friction=friction, force_unit=force_unit,
        gravity=packing.material.gravity,
        # The power gap does not depend on the scale of the forces, so any total will do.
        wall_normal_total=None if walls.loaded.any() else force_unit * max(int(contacts.with_wall.sum()), 1),
    )  # fmt: skip
    slip = measured_slip(contacts, packing.grains, walls, (snapshots[k - 1], snapshots[k + 1]))
    return SlidingFrame(balance, contacts, slip, probability)
