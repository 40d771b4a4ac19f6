"""Second opinions on a solved sequence: the friction that the motion shows, the radii that the connectivity wants."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from solver.bodies.motion import Snapshot
from solver.bodies.packing import Packing
from solver.contacts.radius_tuning import RadiusTuning, tune_radii
from solver.convex.friction_check import FRAMES, FrictionCheck, check_friction
from solver.detection.touch_probability import ContactProbabilitySettings
from solver.nlgs.chain import ChainSettings, force_scale
from solver.sequence.frame_forces import FrameForces, FrameStatus

from ..tracks import Tracks, WallTracks

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
) -> FrictionCheck | None:
    """Check the friction on the quietest consecutive frames.

    None where there are too few, where there is no friction to check, or where too many grains are lost.
    """
    if len(snapshots) < 4 or packing.material.friction <= 0 or packing.material.wall_friction <= 0:
        return None
    calm = np.array([frame.status in (FrameStatus.SETTLED, FrameStatus.SETTLING) for frame in frames])
    lost = np.array([1.0 - snapshot.present.mean() for snapshot in snapshots])
    contacts = max(int(np.median([frame.contacts.count for frame in frames])), 1)
    wanted = int(np.clip(-(-ENOUGH_CONTACTS // contacts), FEWEST_FRAMES, FRAMES))
    count = min(wanted, len(snapshots) - 2)
    starts = np.arange(1, len(snapshots) - count)
    quiet = calm & (lost <= TOLERATED_LOSS)
    first = int(starts[np.argmax([quiet[s : s + count].sum() for s in starts])])
    if lost[first - 1 : first + count + 1].mean() > TOLERATED_LOSS:
        return None
    return check_friction(packing, snapshots, first, first + count - 1, force_scale(packing, ChainSettings()), settings)


def tuned_radii(packing: Packing, tracks: Tracks, walls: WallTracks, wanted: float) -> RadiusTuning:
    """The common change of all radii that gives the wanted coordination number, rattlers excluded."""
    reach = REACH * float(packing.grains.radius.mean())
    change = np.linspace(-reach, reach, CURVE_POINTS)
    bodies = [packing.walls(ends) for ends in walls.endpoints]
    return tune_radii(packing.grains, tracks.position, tracks.present, bodies, wanted, change)
