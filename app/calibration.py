"""Self-calibration as a stage: tracks and walls in, corrected tracks and walls out, with what was found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from app.tracks import Tracks, WallTracks
from solver.calibration import Calibration, calibrate
from solver.calibration_equations import MeasuredSequence

SEED = 0  # of the draws behind the standard deviations: the same input gives the same bits
LEAST_FRAMES = 3  # fewer photographs than this cannot tell a constant error from noise


def calibrate_tracks(
    tracks: Tracks, walls: WallTracks, typical_overlap: float
) -> tuple[Tracks, WallTracks, Calibration | None]:
    """Find the constant errors of centres, radii and walls, and correct them where that makes the gaps narrower.

    The corrected tracks carry the errors that are left: `centre_sigma`, and `sigma` where positions scatter more
    than was stated. typical_overlap [m] of a touching pair. None: the sequence is too short.
    """
    if tracks.frame_count < LEAST_FRAMES:
        return tracks, walls, None
    present = tracks.present
    measured = MeasuredSequence(
        tracks.radius, tracks.position, tracks.rotation, present, walls.endpoints, np.where(present, tracks.sigma, 0.0)
    )
    found = calibrate(measured, rng=np.random.default_rng(SEED), typical_overlap=typical_overlap)
    if not found.applied:
        return tracks, walls, found
    better = found.correct(measured)
    left = np.full(tracks.grain_count, found.position_sd(0.0))
    corrected = replace(
        tracks,
        radius=better.radius,
        position=better.position,
        sigma=found.noise_factor * tracks.sigma,
        centre_sigma=left,
    )
    return corrected, replace(walls, endpoints=better.endpoints), found
