"""Is the given coefficient of friction the one that the motion shows? Too low a one is the worst error of all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
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
from solver.together import work_together

# The least power gap lies below the true friction: by this factor on simulated packings, give or take the scatter
# (packings of 500 and 1172 grains, μ = 0.15, 0.25 and 0.4).
KNOWN_BIAS = 0.92
BIAS_SCATTER = 0.07
# Of walls, over the true one: 0.83 to 1.06 (a core in a ring and a shear box, 200 rods, μ = 0.15 and 0.4 at walls,
# 0.25 between rods).
WALL_BIAS_SCATTER = 0.12
WALL_SCATTER = 0.15  # relative standard deviation over the frames above which nothing is said of walls
WALL_FACTORS = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.12, 1.25, 1.45, 1.7, 2.0, 2.4)
FEWEST_AT_WALLS = 20  # contacts
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

    wall_measured: Annotated[
        float, Quantity("friction of walls that the motion shows and that was used; NaN: as between grains", since=2)
    ] = float("nan")
    wall_low: Annotated[float, Quantity("lower end of its interval", since=2)] = float("nan")
    wall_high: Annotated[float, Quantity("upper end of its interval", since=2)] = float("nan")

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
    workers: int | None = 1,
) -> FrictionCheck:
    """Measure the friction from the sliding in the frames first … last, each over (k − 1, k + 1).

    force_unit [N]: a typical contact force; workers: threads, on which no bit depends.
    Errors: ValueError unless 1 ≤ first ≤ last < number of frames − 1.
    """
    if not 1 <= first <= last < len(snapshots) - 1:
        raise ValueError(f"frames {first} … {last} have no neighbours on both sides in {len(snapshots)} frames")
    frames = _sliding_frames(packing, snapshots, range(first, last + 1), force_unit, settings, workers)
    found = estimate_friction(frames, FACTORS, workers=workers)
    given = packing.material.friction
    measured = given * found.factor / KNOWN_BIAS
    spread = 0.0 if np.isnan(found.factor_sd) else found.factor_sd / max(found.factor, 1e-12)
    width = INTERVAL * float(np.hypot(spread, BIAS_SCATTER))
    return FrictionCheck(
        given, measured, measured * (1.0 - width), measured * (1.0 + width), first, last, found.enclosed,
        found.trial, found.gap,
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class WallFriction:
    """The friction of walls that the motion shows, with its interval of two standard deviations."""

    measured: float
    low: float
    high: float


def measure_wall_friction(
    packing: Packing,
    snapshots: Sequence[Snapshot],
    first: int,
    last: int,
    force_unit: float,
    settings: ContactProbabilitySettings,
    workers: int | None = 1,
) -> WallFriction | None:
    """Measure the friction of walls as `check_friction` does that of all contacts, that between grains being known.

    None where too few rods are at walls, or where what slides there does not tell it.
    """
    frames = _sliding_frames(packing, snapshots, range(first, last + 1), force_unit, settings, workers)
    if np.mean([np.count_nonzero(frame.contacts.with_wall) for frame in frames]) < FEWEST_AT_WALLS:
        return None
    found = estimate_friction(frames, WALL_FACTORS, of_walls=True, workers=workers)
    spread = found.factor_sd / max(found.factor, 1e-12)
    if not found.enclosed or not spread < WALL_SCATTER:
        return None
    measured = packing.material.wall_friction * found.factor
    width = INTERVAL * float(np.hypot(spread, WALL_BIAS_SCATTER))
    return WallFriction(measured, measured * max(1.0 - width, 0.0), measured * (1.0 + width))


def _sliding_frames(
    packing: Packing,
    snapshots: Sequence[Snapshot],
    numbers: Sequence[int],
    force_unit: float,
    settings: ContactProbabilitySettings,
    workers: int | None,
) -> list[SlidingFrame]:
    return work_together(
        [partial(_sliding_frame, packing, snapshots, k, force_unit, settings) for k in numbers], workers
    )


def _sliding_frame(
    packing: Packing, snapshots: Sequence[Snapshot], k: int, force_unit: float, settings: ContactProbabilitySettings
) -> SlidingFrame:
    snapshot, window = snapshots[k], window_of(k, len(snapshots))
    contacts, probability = probable_contacts(
        packing.grains, [snapshots[f] for f in window], k - window.start, settings
    )
    walls = packing.walls_of(snapshot)
    friction = packing.material.friction_at(contacts.with_wall)
    balance = assemble_balance(
        contacts, packing.grains, walls, present=snapshot.present, friction=friction, force_unit=force_unit,
        gravity=packing.material.gravity,
        # The power gap does not depend on the scale of the forces, so any total will do.
        wall_normal_total=None if packing.scale_is_known else force_unit * max(int(contacts.gauge.sum()), 1),
    )  # fmt: skip
    slip = measured_slip(contacts, packing.grains, walls, (snapshots[k - 1], snapshots[k + 1]))
    return SlidingFrame(balance, contacts, slip, probability)
