"""Second opinions on a solved sequence: the friction that the motion shows, the radii that the connectivity wants."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from solver.bodies.motion import Snapshot
from solver.bodies.packing import Packing
from solver.bodies.rods import RodMaterial
from solver.contacts.radius_tuning import RadiusTuning, tune_radii
from solver.convex.friction_check import FRAMES, FrictionCheck, WallFriction, check_friction, measure_wall_friction
from solver.detection.touch_probability import ContactProbabilitySettings
from solver.nlgs.chain import ChainSettings, force_scale
from solver.sequence.frame_forces import FrameForces, FrameStatus

from ..errors import UndeterminedError
from ..tracks import Tracks, WallTracks
from .snapshots import make_snapshots

GUESSES = 5  # of the friction, each from the one before
SAME_FRICTION = 0.02  # relative change below which it is found
POSSIBLE = (0.02, 2.0)  # friction
REACH = 0.04  # radii are changed by this share of the mean radius at most, either way
CURVE_POINTS = 81
ENOUGH_CONTACTS = 8000  # of all frames together, to measure friction on: more frames of a large packing add only time
FEWEST_FRAMES = 4  # whose scatter gives the interval
TOLERATED_LOSS = 0.005  # share of grains: the forces of lost ones are missing from the balance that friction closes


def friction_of(
    packing: Packing,
    snapshots: Sequence[Snapshot],
    frames: Sequence[FrameForces],
    settings: ContactProbabilitySettings,
    workers: int | None = 1,
) -> FrictionCheck | None:
    """Check the friction on the quietest consecutive frames; workers: threads.

    None where there are too few, where there is no friction to check, or where too many grains are lost.
    """
    if len(snapshots) < 4 or packing.material.friction <= 0 or packing.material.wall_friction <= 0:
        return None
    found = [(frame.status, frame.contacts.count) for frame in frames]
    calm = np.array([status in (FrameStatus.SETTLED, FrameStatus.SETTLING) for status, _ in found])
    lost = np.array([1.0 - snapshot.present.mean() for snapshot in snapshots])
    contacts = max(int(np.median([count for _, count in found])), 1)
    wanted = int(np.clip(-(-ENOUGH_CONTACTS // contacts), FEWEST_FRAMES, FRAMES))
    count = min(wanted, len(snapshots) - 2)
    starts = np.arange(1, len(snapshots) - count)
    quiet = calm & (lost <= TOLERATED_LOSS)
    first = int(starts[np.argmax([quiet[s : s + count].sum() for s in starts])])
    if lost[first - 1 : first + count + 1].mean() > TOLERATED_LOSS:
        return None
    unit = force_scale(packing, ChainSettings())
    return check_friction(packing, snapshots, first, first + count - 1, unit, settings, workers)


def measure_friction(
    material: RodMaterial,
    packing: Packing,
    snapshots: Sequence[Snapshot],
    settings: ContactProbabilitySettings,
    workers: int | None = 1,
) -> RodMaterial:
    """The material with the friction that the motion shows, found anew with it until both agree.

    A friction at walls that was told stays. Raises FrictionError where the motion does not tell it.
    """
    count = min(FRAMES, len(snapshots) - 2)
    if count < 1:
        raise FrictionError("three photographs are needed to measure it")
    first = max(1, (len(snapshots) - count) // 2)
    unit = force_scale(packing, ChainSettings())
    for _ in range(GUESSES):
        guess = replace(packing, material=material.friction_law())
        found = check_friction(guess, snapshots, first, first + count - 1, unit, settings, workers)
        if not np.isfinite(found.measured):
            raise FrictionError("nothing slides in these photographs, so that they do not tell it: give a number")
        change = abs(found.measured / material.friction - 1.0)
        material = replace(material, friction=float(np.clip(found.measured, *POSSIBLE)))
        if found.enclosed and change < SAME_FRICTION:
            return material
    ended = f"{GUESSES} guesses ended at {material.friction:.3f}"
    raise FrictionError(f"the motion does not tell it ({ended}): give a number")


def measure_friction_of_walls(
    material: RodMaterial,
    packing: Packing,
    snapshots: Sequence[Snapshot],
    settings: ContactProbabilitySettings,
    workers: int | None = 1,
) -> WallFriction | None:
    """The friction of walls that the motion shows; None where it was told, or where it is not shown."""
    count = min(FRAMES, len(snapshots) - 2)
    if material.wall_friction is not None or count < FEWEST_FRAMES:
        return None
    first = max(1, (len(snapshots) - count) // 2)
    unit = force_scale(packing, ChainSettings())
    return measure_wall_friction(packing, snapshots, first, first + count - 1, unit, settings, workers)


class FrictionError(UndeterminedError):
    """The motion does not tell the friction."""

    key = 'material.friction = "measured"'


def tuned_radii(
    packing: Packing, tracks: Tracks, walls: WallTracks, wanted: float, failed: Collection[int] = ()
) -> RadiusTuning:
    """The common change of all radii that gives the wanted coordination number, rattlers excluded.

    failed: frames that show nothing.
    """
    seen = [k for k in range(tracks.frame_count) if k not in failed]
    reach = REACH * float(packing.grains.radius.mean())
    change = np.linspace(-reach, reach, CURVE_POINTS)
    snapshots = make_snapshots(tracks, walls)
    bodies = [packing.walls_of(snapshots[k]) for k in seen]
    return tune_radii(packing.grains, tracks.position[seen], tracks.present[seen], bodies, wanted, change)
