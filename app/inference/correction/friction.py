"""Friction coefficients that the motion shows, and radii that give a requested coordination number."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from ...process.errors import UndeterminedError
from ...solver.bodies.motion import Snapshot
from ...solver.bodies.packing import Packing
from ...solver.bodies.rods import RodMaterial
from ...solver.contacts.radius_tuning import RadiusTuning, tune_radii
from ...solver.convex.friction_check import (
    BIAS,
    CHECKED_FRAMES,
    COVERAGE_FACTOR,
    LEAST_SLIDING,
    MIN_WALL_CONTACTS,
    QUIET,
    WALL_BIAS_SD,
    FrictionCheck,
    WallFriction,
    check_friction,
    measure_wall_friction,
)
from ...solver.convex.resistance import (
    COMPARED_FRAMES,
    LEAST_WALLS,
    Resistance,
    base_drag_of,
    find_in_sequence,
    find_unstated,
    model_of,
    resisted_frames,
)
from ...solver.convex.sliding_model import Parameter, fit_model
from ...solver.detection.touch_probability import ContactProbabilitySettings
from ...solver.frame_forces import FrameForces, FrameStatus
from ...tracks import Tracks, WallTracks
from ..corrected_sequence import CorrectedSequence
from ..snapshots import make_snapshots

GUESSES = 5  # of the friction, each by the previous one
SAME_FRICTION = 0.02  # relative change below which the iteration has converged
POSSIBLE = (0.02, 2.0)  # range of the friction
REACH = 0.04  # largest change of the radii, as a fraction of the mean radius
CURVE_POINTS = 81
ENOUGH_CONTACTS = 8000  # of all frames together, to measure friction on: more frames of a large packing add only time
FEWEST_FRAMES = 4  # for an interval
TOLERATED_LOSS = 0.005  # fraction of lost grains: their forces are missing from the balance


def check_sequence_friction(sequence: CorrectedSequence, frames: Sequence[FrameForces]) -> FrictionCheck | None:
    """Check the given friction on the quietest consecutive frames of a solved sequence.

    Returns
    -------
    FrictionCheck or None
        With the coefficient measured at walls, if any. None with too few frames, without friction, or with too many
        lost grains.
    """
    packing, snapshots = sequence.packing, sequence.snapshots
    if len(snapshots) < 4 or packing.material.friction <= 0 or packing.material.wall_friction <= 0:
        return None
    found = [(frame.status, frame.contacts.count) for frame in frames]
    calm = np.array([status in (FrameStatus.SETTLED, FrameStatus.SETTLING) for status, _ in found])
    lost = np.array([1.0 - snapshot.present.mean() for snapshot in snapshots])
    contacts = max(int(np.median([count for _, count in found])), 1)
    wanted = int(np.clip(-(-ENOUGH_CONTACTS // contacts), FEWEST_FRAMES, CHECKED_FRAMES))
    count = min(wanted, len(snapshots) - 2)
    starts = np.arange(1, len(snapshots) - count)
    quiet = calm & (lost <= TOLERATED_LOSS)
    first = int(starts[np.argmax([quiet[s : s + count].sum() for s in starts])])
    if lost[first - 1 : first + count + 1].mean() > TOLERATED_LOSS:
        return None
    probability = sequence.settings.for_radii(packing.grains.radius).ensemble.probability
    check = check_friction(packing, snapshots, first, first + count - 1, probability, sequence.settings.workers)
    if check.sliding < LEAST_SLIDING:
        check = replace(check, enclosed=False)
    elif not check.agrees or check.given_gap > QUIET:
        check = _beside_others(check, find_in_sequence(packing, snapshots, first, probability))
    walls = sequence.wall_friction
    if walls is None:
        return check
    return replace(check, wall_measured=walls.measured, wall_low=walls.low, wall_high=walls.high)


def _beside_others(check: FrictionCheck, found: Resistance | None) -> FrictionCheck:
    """The check with the friction between rods beside that of walls or base or an attraction, where these are named."""
    if found is None or found.cause in ("", "friction", "photographs_reversed"):
        return check
    ratio = found.found.friction / BIAS / check.measured
    return replace(
        check, measured=ratio * check.measured, low=ratio * check.low, high=ratio * check.high, enclosed=True
    )


def measure_friction(
    material: RodMaterial,
    packing: Packing,
    snapshots: Sequence[Snapshot],
    settings: ContactProbabilitySettings,
    workers: int | None = 1,
) -> RodMaterial:
    """Measure the friction from the motion, repeated with the result until both agree; a given wall friction stays.

    Raises
    ------
    FrictionError
        The motion does not determine it.
    """
    frames = _middle_frames(snapshots, CHECKED_FRAMES)
    if not frames:
        raise FrictionError("three photographs are needed to measure it")
    for _ in range(GUESSES):
        guess = replace(packing, material=material.friction_law())
        found = check_friction(guess, snapshots, frames[0], frames[-1], settings, workers)
        if not np.isfinite(found.measured):
            raise FrictionError("nothing slides in these photographs, so they do not determine it: give a number")
        change = abs(found.measured / material.friction - 1.0)
        material = replace(material, friction=float(np.clip(found.measured, *POSSIBLE)))
        if found.enclosed and change < SAME_FRICTION:
            return material
    ended = f"{GUESSES} guesses ended at {material.friction:.3f}"
    raise FrictionError(f"the motion does not determine it ({ended}): give a number")


def measure_friction_of_walls(
    material: RodMaterial,
    packing: Packing,
    snapshots: Sequence[Snapshot],
    settings: ContactProbabilitySettings,
    workers: int | None = 1,
) -> WallFriction | None:
    """Measure the friction at walls from the motion; None where it is given, or not shown."""
    frames = _middle_frames(snapshots, CHECKED_FRAMES)
    if material.wall_friction is not None or len(frames) < FEWEST_FRAMES:
        return None
    return measure_wall_friction(packing, snapshots, frames[0], frames[-1], settings, workers)


def refine_wall_friction(
    material: RodMaterial,
    packing: Packing,
    snapshots: Sequence[Snapshot],
    settings: ContactProbabilitySettings,
    workers: int | None = 1,
) -> WallFriction | None:
    """Measure the friction at walls anew, with its interval over the frames; else that of other packings.

    None where `measure_resisting` has not found it.
    """
    if (measured := material.wall_friction) is None:
        return None
    free = replace(material, wall_friction=None)
    found = measure_friction_of_walls(free, packing, snapshots, settings, workers)
    half_width = COVERAGE_FACTOR * WALL_BIAS_SD * measured
    return found or WallFriction(measured, max(measured - half_width, 0.0), measured + half_width)


def measure_resisting(
    material: RodMaterial,
    packing: Packing,
    snapshots: Sequence[Snapshot],
    settings: ContactProbabilitySettings,
    workers: int | None = 1,
) -> RodMaterial:
    """Measure together what resists sliding and is not given: friction of rods, of walls, and of the base.

    Raises
    ------
    FrictionError, BaseFrictionError
        The motion does not determine it.
    """
    numbers = _middle_frames(snapshots, CHECKED_FRAMES)
    error = BaseFrictionError if material.base_friction_measured else FrictionError
    if not numbers:
        raise error("three photographs are needed to measure it")
    frames = resisted_frames(packing, snapshots, numbers, settings, workers)
    free: list[Parameter] = ["base_drag"] if material.base_friction_measured else []
    walls = float(np.mean([each.contacts.with_wall.sum() for each in frames]))
    if material.friction_measured:
        own = material.wall_friction is not None or walls < MIN_WALL_CONTACTS
        free.extend(("friction",) if own else ("wall_friction", "friction"))
    found = fit_model(frames, model_of(packing), free)
    if not np.isfinite(found.gap):
        raise error("nothing slides in these photographs, so they do not determine it: give a number")
    if material.base_friction_measured:
        if not packing.scale_is_known:
            raise BaseFrictionError("needs a wall with a known load")
        drag = base_drag_of(packing, found.model)
        material = replace(material, base_friction=drag / material.base_gravity, base_friction_measured=False)
    if "wall_friction" in free and found.enclosed:
        material = replace(material, wall_friction=max(found.model.wall_friction, POSSIBLE[0]))
    return material


def use_unstated(
    material: RodMaterial,
    packing: Packing,
    snapshots: Sequence[Snapshot],
    settings: ContactProbabilitySettings,
    workers: int | None = 1,
) -> tuple[RodMaterial, str]:
    """Use a friction of walls or base that is not stated but that the sliding clearly shows.

    Returns
    -------
    RodMaterial
        The same friction between rods.
    str
        What is used; empty: nothing.
    """
    numbers = _middle_frames(snapshots, COMPARED_FRAMES)
    if (
        len(numbers) < COMPARED_FRAMES
        or material.friction <= 0.0
        or material.at_walls() <= 0.0
        or material.friction_measured
    ):
        return material, ""
    frames = resisted_frames(packing, snapshots, numbers, settings, workers)
    names = []
    if float(np.mean([each.contacts.with_wall.sum() for each in frames])) >= LEAST_WALLS:
        names.append("wall_friction")
    if packing.scale_is_known and material.base_friction == 0.0 and not material.base_friction_measured:
        names.append("base_friction")
    given = model_of(packing)
    found = find_unstated(frames, given, names, workers)
    remarks = []
    if found.wall_friction != given.wall_friction:
        remarks.append(
            f"rods slide on walls as with a friction of {found.wall_friction:.2g}, not {given.wall_friction:g}"
        )
        material = replace(material, wall_friction=found.wall_friction)
    if found.base_drag != given.base_drag:
        coefficient = base_drag_of(packing, found) / material.base_gravity
        remarks.append(f"the base drags the rods as with a friction of {coefficient:.2g}")
        material = replace(material, base_friction=coefficient)
    return material, "; ".join(f"{each}: this is used, unless calibration.resistance is false" for each in remarks)


def _middle_frames(snapshots: Sequence[Snapshot], most: int) -> range:
    """Return the middle frames with a photograph before and after each, at most so many; empty: there are none."""
    count = min(most, len(snapshots) - 2)
    first = max(1, (len(snapshots) - count) // 2)
    return range(first, first + count)


class BaseFrictionError(UndeterminedError):
    """The motion does not determine the friction of the base."""

    key = "material.base_friction"


class FrictionError(UndeterminedError):
    """The motion does not determine the friction coefficient."""

    key = 'material.friction = "measured"'


def tuned_radii(
    packing: Packing, tracks: Tracks, walls: WallTracks, wanted: float, failed: Collection[int] = ()
) -> RadiusTuning:
    """Find the common change of all radii that gives the requested coordination number, rattlers excluded.

    failed: unusable frames.
    """
    seen = [k for k in range(tracks.frame_count) if k not in failed]
    reach = REACH * float(packing.grains.radius.mean())
    change = np.linspace(-reach, reach, CURVE_POINTS)
    snapshots = make_snapshots(tracks, walls)
    bodies = [packing.walls_of(snapshots[k]) for k in seen]
    return tune_radii(packing.grains, tracks.position[seen], tracks.present[seen], bodies, wanted, change)
