"""Comparison of the given coefficient of friction with the one estimated from the motion.

A coefficient that is too low is the worst error of all.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated, TypeVar

import numpy as np

from ..bodies.grains import Array
from ..bodies.motion import Snapshot
from ..bodies.packing import Packing
from ..contacts.contacts import Contacts, measure_pairs
from ..contacts.pairs import join_keys, match_values
from ..detection.touch_probability import ContactProbabilitySettings, probable_contacts, window_of
from ..nlgs.chain import ChainSettings, force_scale
from ..parallel import parallel_map
from ..quantity import Quantity
from .dual_prices import ROUNDS, find_missing_pairs
from .ensemble_members import measured_slip
from .friction_estimate import FACTORS, SlidingFrame, estimate_friction, power_gaps
from .program import LoadScale, assemble_balance, solve_convex_member

# The minimum of the power gap lies below the true friction: estimated over true friction on simulated packings, and its
# relative standard deviation (packings of 500 and 1172 grains, μ = 0.15, 0.25 and 0.4).
BIAS = 0.92
BIAS_SD = 0.07
# Of walls, estimated over true friction: 0.83 to 1.06 (a core in a ring and a shear box, 200 rods, μ = 0.15 and 0.4 at
# walls, 0.25 between rods).
WALL_BIAS_SD = 0.12
MAX_WALL_SD = 0.15  # relative standard deviation over the frames; above it, walls get no estimate
WALL_FACTORS = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.12, 1.25, 1.45, 1.7, 2.0, 2.4)
MIN_WALL_CONTACTS = 20
COVERAGE_FACTOR = 2.0  # standard deviations in the half-width of an interval
CHECKED_FRAMES = 8  # consecutive photographs of a check
# Fraction of sliding contacts below which they do not show the friction: noise alone makes .13 of them slide. With .13
# to .22 the estimate was .3 to 3.4 times the truth in seven packings, with .31 to .65 .9 to 1.1 times in ten others.
LEAST_SLIDING = 0.25
QUIET = 0.1  # gap of the given model below which nothing else is looked for
CLEAR = 0.62  # gap of a rival over that of the given model, and of another friction alone, below which it is named
LEAST_GAP = 0.03  # fall of the gap below which nothing is decided
MOST_GAP = 0.25  # gap above which not even the best rival explains the sliding
Frame = TypeVar("Frame", bound=SlidingFrame)


@dataclass(frozen=True, slots=True)
class FrictionCheck:
    """The friction estimated from the motion beside the given one."""

    given: Annotated[float, Quantity("friction that was given")]
    measured: Annotated[float, Quantity("friction estimated from the motion; NaN without sliding")]
    low: Annotated[float, Quantity("lower end of the interval of two standard deviations")]
    high: Annotated[float, Quantity("upper end of that interval")]
    first: Annotated[int, Quantity("first frame of the check", absent=0)]
    last: Annotated[int, Quantity("last frame of the check", absent=0)]
    enclosed: Annotated[
        bool, Quantity("whether the friction lies within the trials, and enough slides to show it", absent=False)
    ]
    trial: Annotated[Array, Quantity("trial factors on the given friction", dims="friction_trial")]
    gap: Annotated[Array, Quantity("relative power gap of every trial", dims="friction_trial")]

    wall_measured: Annotated[
        float, Quantity("friction of walls estimated from the motion and used; NaN: as between grains", since=2)
    ] = float("nan")
    wall_low: Annotated[float, Quantity("lower end of its interval", since=2)] = float("nan")
    wall_high: Annotated[float, Quantity("upper end of its interval", since=2)] = float("nan")
    sliding: Annotated[
        float, Quantity("fraction of the contacts that slide by more than 1.5 standard deviations of a slide", since=2)
    ] = float("nan")

    @property
    def given_gap(self) -> float:
        """Relative power gap of the given friction; NaN without sliding."""
        return float(np.interp(1.0, self.trial, self.gap)) if len(self.trial) else float("nan")

    @property
    def agrees(self) -> bool:
        """Whether the given friction lies within the interval, or no estimate exists."""
        return not self.enclosed or self.low <= self.given <= self.high


def check_friction(
    packing: Packing,
    snapshots: Sequence[Snapshot],
    first: int,
    last: int,
    settings: ContactProbabilitySettings,
    workers: int | None = 1,
) -> FrictionCheck:
    """Estimate the friction from the sliding in the frames first … last, each over (k − 1, k + 1).

    Parameters
    ----------
    first, last : int
        Frames of the check.
    workers : int, optional
        Threads; the result does not depend on their number.

    Raises
    ------
    ValueError
        Unless 1 ≤ first ≤ last < number of frames − 1.
    """
    if not 1 <= first <= last < len(snapshots) - 1:
        raise ValueError(f"frames {first} … {last} have no neighbours on both sides in {len(snapshots)} frames")
    frames = _sliding_frames(packing, snapshots, range(first, last + 1), settings, workers)
    found = estimate_friction(frames, FACTORS, workers=workers)
    given = packing.material.friction
    measured = given * found.factor / BIAS
    relative_sd = 0.0 if np.isnan(found.factor_sd) else found.factor_sd / max(found.factor, 1e-12)
    half_width = COVERAGE_FACTOR * float(np.hypot(relative_sd, BIAS_SD))
    slip = np.concatenate([frame.slip for frame in frames])
    sliding = float(np.mean(slip != 0.0)) if len(slip) else np.nan
    return FrictionCheck(
        given, measured, measured * (1.0 - half_width), measured * (1.0 + half_width), first, last, found.enclosed,
        found.trial, found.gap, sliding=sliding,
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class WallFriction:
    """The friction of walls estimated from the motion, with its interval of two standard deviations."""

    measured: float
    low: float
    high: float


def measure_wall_friction(
    packing: Packing,
    snapshots: Sequence[Snapshot],
    first: int,
    last: int,
    settings: ContactProbabilitySettings,
    workers: int | None = 1,
) -> WallFriction | None:
    """Estimate the friction of walls as `check_friction` does, with known friction between grains.

    Returns
    -------
    WallFriction or None
        None with fewer than MIN_WALL_CONTACTS contacts with walls, or if the sliding does not determine the friction.
    """
    frames = _sliding_frames(packing, snapshots, range(first, last + 1), settings, workers)
    if np.mean([np.count_nonzero(frame.contacts.with_wall) for frame in frames]) < MIN_WALL_CONTACTS:
        return None
    found = estimate_friction(frames, WALL_FACTORS, of_walls=True, workers=workers)
    relative_sd = found.factor_sd / max(found.factor, 1e-12)
    if not found.enclosed or not relative_sd < MAX_WALL_SD:
        return None
    measured = packing.material.wall_friction * found.factor
    half_width = COVERAGE_FACTOR * float(np.hypot(relative_sd, WALL_BIAS_SD))
    return WallFriction(measured, measured * max(1.0 - half_width, 0.0), measured * (1.0 + half_width))


def _sliding_frames(
    packing: Packing,
    snapshots: Sequence[Snapshot],
    numbers: Sequence[int],
    settings: ContactProbabilitySettings,
    workers: int | None,
) -> list[SlidingFrame]:
    def make(k: int, completed: bool) -> SlidingFrame:
        return sliding_frame(packing.at_frame(snapshots, k), snapshots, k, settings, completed=completed)

    return on_better_contacts(make, numbers, workers)


def on_better_contacts(
    make: Callable[[int, bool], Frame], numbers: Sequence[int], workers: int | None = 1
) -> list[Frame]:
    """Prepare frames on the detected contacts or, where they explain the sliding clearly better, on completed ones.

    One strong contact that was not detected leaves a power gap that a drag of the base or another friction seems to
    close: of a sheared packing .37, and .045 with the contact. Where the base does drag, pairs that the balance shows
    instead leave .85 of the gap or more (five packings of 200 rods).

    Parameters
    ----------
    make : callable
        Prepares a frame, given by its number, on detected contacts, or with True on completed ones.
    numbers : sequence of int
        The frames.
    workers : int, optional
        Threads.
    """
    detected = parallel_map([partial(make, k, False) for k in numbers], workers)
    gap = _mean_gap(detected)
    if not gap > QUIET:
        return detected
    completed = parallel_map([partial(make, k, True) for k in numbers], workers)
    return completed if is_clearly_less(_mean_gap(completed), gap) else detected


def is_clearly_less(gap: float, other: float) -> bool:
    """Whether a mean power gap is so much less than another that its model explains the sliding, and that not."""
    return gap < min(CLEAR * other, other - LEAST_GAP, MOST_GAP)


def _mean_gap(frames: Sequence[SlidingFrame]) -> float:
    return float(np.mean(power_gaps(frames))) if frames else np.nan


def sliding_frame(
    packing: Packing,
    snapshots: Sequence[Snapshot],
    k: int,
    settings: ContactProbabilitySettings,
    *,
    completed: bool = False,
) -> SlidingFrame:
    """Prepare a frame with neighbours on both sides.

    Parameters
    ----------
    packing : Packing
        As in this frame.
    snapshots : sequence of Snapshot
    k : int
        The frame.
    settings : ContactProbabilitySettings
    completed : bool
        Whether pairs that were not detected, but that the balance shows, are added.
    """
    snapshot, window = snapshots[k], window_of(k, len(snapshots))
    contacts, probability = probable_contacts(
        packing.grains, [snapshots[f] for f in window], k - window.start, settings
    )
    walls = packing.walls_of(snapshot)
    for _ in range(ROUNDS if completed else 0):
        frame = _frame_on(contacts, probability, packing, snapshots, k)
        none = np.zeros(contacts.count)
        forces = solve_convex_member(frame.balance, frame.slip, probability, none, none)
        solved = frame.balance, [np.column_stack([forces.fn, forces.ft])]
        key, chance = find_missing_pairs(packing.grains, snapshot, walls, contacts.key, solved, settings.overlap)
        if len(key) == 0:
            break
        joined = join_keys(contacts.key, key)
        probability = match_values(joined, contacts.key, probability) + match_values(joined, key, chance)
        contacts = measure_pairs(packing.grains, snapshot.position, walls, joined)
    return _frame_on(contacts, probability, packing, snapshots, k)


def _frame_on(
    contacts: Contacts, probability: Array, packing: Packing, snapshots: Sequence[Snapshot], k: int
) -> SlidingFrame:
    snapshot, force_unit = snapshots[k], force_scale(packing, ChainSettings())
    walls, friction = packing.walls_of(snapshot), packing.material.friction_at(contacts.with_wall)
    # The power gap does not depend on the scale of the forces, so any total is valid.
    total = None if packing.scale_is_known else force_unit * max(int(contacts.gauge.sum()), 1)
    balance = assemble_balance(
        contacts, packing.grains, walls, present=snapshot.present, friction=friction,
        scale=LoadScale(force_unit, packing.material.gravity, total),
    )  # fmt: skip
    slip = measured_slip(contacts, packing.grains, walls, (snapshots[k - 1], snapshots[k + 1]))
    return SlidingFrame(balance, contacts, slip, probability)
