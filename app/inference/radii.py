"""Radii that scatter, found from all frames together before anything else of the grains is calibrated.

An error of a radius and one of a centre look much alike in the gaps of a grain; with the balance of forces they do not.
Walls, scale and what all radii share are calibrated first, for a wall that stands wrong would pass for radii along it.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from solver.bodies.bridging import bridge_frames
from solver.bodies.motion import Snapshot
from solver.bodies.packing import Packing
from solver.bodies.rods import RodMaterial
from solver.calibration.calibrate import Calibration
from solver.calibration.settings import CalibrationSettings
from solver.posterior.radii import RadiusPosterior, estimate_radii, radii_scatter

from ..tracks import Tracks, WallTracks
from .calibration import calibrate_tracks
from .snapshots import make_snapshots, measure_sequence

SEED = 0  # of the draws: the same input gives the same bits


def calibrate_with_radii(
    material: RodMaterial,
    settings: CalibrationSettings,
    tracks: Tracks,
    walls: WallTracks,
    typical_overlap: float,
    failed: Collection[int] = (),
) -> tuple[Tracks, WallTracks, Calibration | None]:
    """Calibrate tracks and walls; where radii scatter more than can be told from errors of centres, these before.

    Arguments as of `calibrate_tracks`, and it is all that is done to exact radii.
    """
    calibrated = calibrate_tracks(settings, tracks, walls, typical_overlap, failed)
    first = calibrated[2]
    if first is None or not radii_scatter(*_seen(material, tracks, walls, failed)):
        return calibrated
    shared = _correct_shared(first, tracks, walls)
    found = estimate_radii(*_seen(material, *shared, failed), np.random.default_rng(SEED))
    better = replace(tracks, radius=tracks.radius + found.correction)
    left = float(np.sqrt(np.mean(found.deviation**2)))
    tracks, walls, then = calibrate_tracks(settings, better, walls, typical_overlap, failed, left)
    assert then is not None
    if tracks.centre_sigma is None or not then.applied:
        tracks = replace(tracks, centre_sigma=np.full(tracks.grain_count, left))  # a gap has two radii, and two centres
    return tracks, walls, _joined(first, found, then)


def _seen(
    material: RodMaterial, tracks: Tracks, walls: WallTracks, failed: Collection[int]
) -> tuple[Packing, list[Snapshot]]:
    packing = material.pack(tracks.radius, walls.usual_pressure(material.length))
    return packing, bridge_frames(make_snapshots(tracks, walls), failed)


def _correct_shared(found: Calibration, tracks: Tracks, walls: WallTracks) -> tuple[Tracks, WallTracks]:
    """Correct what grains have in common: their own centres and radii stay as they were told."""
    shared = replace(
        found, offset=np.zeros_like(found.offset), radius=np.full(tracks.grain_count, found.radius_offset)
    )  # fmt: skip
    better = shared.correct(measure_sequence(tracks, walls))
    return replace(tracks, radius=better.radius, position=better.position), replace(walls, endpoints=better.endpoints)


def _joined(first: Calibration, found: RadiusPosterior, then: Calibration) -> Calibration:
    """All that was found, in one."""
    size = 1e6 * float(np.sqrt(np.mean(found.correction**2)))
    told = f"applied: the radii told are wrong by {size:.0f} µm rms, as gaps and balance of all photographs show"
    return replace(
        then,
        radius=then.radius + found.correction,
        radius_sd=found.deviation,
        before=first.before,
        applied=True,
        verdict=told + (f"; then {then.verdict.removeprefix('applied: ')}" if then.applied else ""),
    )
