"""Individual errors of radii, estimated from all frames together before the centres are calibrated.

An error of a radius and one of a centre look alike in the gaps of a grain, but not with the balance of forces. Walls,
scale and the common error of the radii are calibrated first, because a displaced wall looks like wrong radii along it.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from ...solver.bodies.interpolation import interpolate_ignored_frames
from ...solver.bodies.motion import Snapshot
from ...solver.bodies.packing import Packing
from ...solver.bodies.rods import RodMaterial
from ...solver.boundary.size_classes import find_size_classes
from ...solver.calibration.calibrate import Calibration
from ...solver.calibration.priors import CalibrationSettings
from ...solver.posterior.radius_posterior import RadiusPosterior, estimate_radii, has_radius_errors
from ...tracks import Tracks, WallTracks
from ..snapshots import make_snapshots, measure_sequence
from .calibration import calibrate_tracks

SEED = 0  # of the draws: the same input gives the same bits


def use_size_classes(material: RodMaterial, tracks: Tracks) -> tuple[Tracks, str]:
    """Replace readings of the radii of soft grains by their nominal sizes, as far as touching pairs support them.

    Errors of the radii of hard grains are calibrated with those of their centres; overlaps of soft grains are forces,
    so that only the classes of their sizes show them.

    Returns
    -------
    Tracks
    str
        A sentence on the correction; empty: none.
    """
    if material.stiffness in (None, "rigid") or tracks.grain_count == 0:
        return tracks, ""
    found = find_size_classes(np.where(tracks.present[..., None], tracks.position, np.nan), tracks.radius)
    return (tracks, "") if found is None else (replace(tracks, radius=found.radius), found.describe())


def calibrate_with_radii(
    material: RodMaterial,
    settings: CalibrationSettings,
    tracks: Tracks,
    walls: WallTracks,
    typical_overlap: float,
    failed: Collection[int] = (),
) -> tuple[Tracks, WallTracks, Calibration | None]:
    """Calibrate tracks and walls, estimating the radii first where their errors vary more than those of centres.

    Parameters as of `calibrate_tracks`, which is all that is done to exact radii.
    """
    calibrated = calibrate_tracks(settings, tracks, walls, typical_overlap, failed)
    first = calibrated[2]
    if first is None or not has_radius_errors(*_seen(material, tracks, walls, failed)):
        return calibrated
    shared = _correct_shared(first, tracks, walls)
    found = estimate_radii(*_seen(material, *shared, failed), np.random.default_rng(SEED))
    better = replace(tracks, radius=tracks.radius + found.correction)
    remaining = float(np.sqrt(np.mean(found.correction_sd**2)))
    tracks, walls, then = calibrate_tracks(settings, better, walls, typical_overlap, failed, remaining)
    assert then is not None
    if tracks.centre_sigma is None or not then.applied:
        tracks = replace(tracks, centre_sigma=np.full(tracks.grain_count, remaining))  # of either kind a gap has two
    return tracks, walls, _joined(first, found, then)


def _seen(
    material: RodMaterial, tracks: Tracks, walls: WallTracks, failed: Collection[int]
) -> tuple[Packing, list[Snapshot]]:
    packing = material.pack(tracks.radius, walls.usual_pressure(material.length))
    return packing, interpolate_ignored_frames(make_snapshots(tracks, walls), failed)


def _correct_shared(found: Calibration, tracks: Tracks, walls: WallTracks) -> tuple[Tracks, WallTracks]:
    """Correct the errors that all grains share; their own centres and radii stay as given."""
    shared = replace(
        found, offset=np.zeros_like(found.offset), radius=found.shared_radius(tracks.radius)
    )  # fmt: skip
    better = shared.correct(measure_sequence(tracks, walls))
    return replace(tracks, radius=better.radius, position=better.position), replace(walls, endpoints=better.endpoints)


def _joined(first: Calibration, found: RadiusPosterior, then: Calibration) -> Calibration:
    """Combine both calibrations and the radii into one."""
    size = 1e6 * float(np.sqrt(np.mean(found.correction**2)))
    verdict = f"applied: the given radii are wrong by {size:.0f} µm rms, as gaps and balance of all photographs show"
    return replace(
        then,
        radius=then.radius + found.correction,
        radius_sd=found.correction_sd,
        before=first.before,
        applied=True,
        verdict=verdict + (f"; then {then.verdict.removeprefix('applied: ')}" if then.applied else ""),
    )
