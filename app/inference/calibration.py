"""Self-calibration as a stage: tracks and walls in, corrected tracks and walls out, with what was found."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.calibration.calibrate import EXCESSIVE_NOISE, Calibration, calibrate, expected_priors
from solver.calibration.settings import CalibrationSettings

from ..tracks import Tracks, WallTracks
from .snapshots import measure_sequence

SEED = 0  # of the draws behind the standard deviations: the same input gives the same bits
LEAST_FRAMES = 3  # fewer photographs than this cannot tell a constant error from noise
MOST_CLASSES = 8  # more different radii than this are no classes
SAME = 1e-6  # of a radius: radii that differ less are one class


def calibrate_tracks(
    settings: CalibrationSettings,
    tracks: Tracks,
    walls: WallTracks,
    typical_overlap: float,
    failed: Collection[int] = (),
    radius_prior: float = np.inf,
) -> tuple[Tracks, WallTracks, Calibration | None]:
    """Find the constant errors of centres, radii, walls and pixel size, and correct them where gaps get narrower.

    The corrected tracks carry the errors that are left: `centre_sigma`, and `sigma` where positions scatter more
    than was stated, corrected or not. typical_overlap [m] of a touching pair. failed: frames that show nothing.
    radius_prior [m]: standard deviation of the radii's errors, where it is known. None: the sequence is too short.
    """
    if tracks.frame_count - len(failed) < LEAST_FRAMES:
        return tracks, walls, None
    measured = measure_sequence(tracks, walls)
    measured.present[list(failed)] = False
    priors = expected_priors(
        measured,
        pixel_size=settings.pixel_size if settings.radii_are_known else 0.0,
        radius_class=settings.radius_class if settings.radii_are_known else 0.0,
        radius_offset=settings.radius_offset,
    )
    priors = replace(priors, lens=priors.lens if settings.lens else 0.0, radius=min(priors.radius, radius_prior))
    found = calibrate(
        measured, priors, rng=np.random.default_rng(SEED), typical_overlap=typical_overlap,
        radius_class=radius_classes(tracks.radius),
    )  # fmt: skip
    if not found.applied:
        # Positions that scatter far more than stated would have contacts missed, whatever their centres are.
        scatter = found.noise_factor if found.noise_factor > EXCESSIVE_NOISE else 1.0
        return replace(tracks, sigma=scatter * tracks.sigma), walls, found
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


def known_radii(radius: Array) -> Array | None:
    """The different radii (q,) [m] of grains of these radii (n,) [m], ascending; None where they are no classes."""
    classes = radius_classes(radius)
    return None if classes is None else radius[np.unique(classes, return_index=True)[1]]


def radius_classes(radius: Array) -> NDArray[np.int64] | None:
    """The class of each grain (n,), by its radius (n,) [m]; None where radii do not come in classes."""
    ordered = np.sort(radius)
    new = np.concatenate([[True], np.diff(ordered) > SAME * ordered[1:]])
    if new.sum() > MOST_CLASSES:
        return None
    return np.searchsorted(ordered[new], radius * (1.0 + SAME), side="right") - 1
