"""Self-calibration as a stage: corrects tracks and walls, and returns the errors found."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...solver.bodies.grains import Array
from ...solver.calibration.calibrate import EXCESSIVE_NOISE, Calibration, calibrate, default_priors
from ...solver.part_settings import CalibrationSettings
from ...solver.posterior.radius_posterior import FEWEST
from ...tracks import Tracks, WallTracks, held_once
from ..snapshots import measure_sequence

SEED = 0  # of the draws behind the standard deviations: the same input gives the same bits
LEAST_FRAMES = 3  # fewer photographs do not separate a constant error from noise
MOST_CLASSES = 8  # with more different radii there are no classes
SAME = 1e-6  # relative difference of radii below which they are one class


def calibrate_tracks(
    settings: CalibrationSettings,
    tracks: Tracks,
    walls: WallTracks,
    typical_overlap: float,
    failed: Collection[int] = (),
    radius_prior: float = np.inf,
) -> tuple[Tracks, WallTracks, Calibration | None]:
    """Find the constant errors of centres, radii, walls and pixel size, and correct them where gaps get narrower.

    Parameters
    ----------
    settings : CalibrationSettings
    tracks : Tracks
    walls : WallTracks
    typical_overlap : float
        Of a touching pair [m].
    failed : collection of int
        Unusable frames.
    radius_prior : float
        Standard deviation of the errors of radii, where it is known [m].

    Returns
    -------
    Tracks
        With the remaining errors of the centres as `centre_sigma`, and with `sigma` raised where the noise of the
        positions exceeds the stated one, whether corrected or not.
    WallTracks
    Calibration or None
        None: the sequence is too short.
    """
    if tracks.frame_count - len(failed) < LEAST_FRAMES:
        return tracks, walls, None
    measured = measure_sequence(tracks, walls)
    measured.present[list(failed)] = False
    priors = default_priors(
        measured,
        pixel_size=settings.pixel_size if settings.radii_are_known else 0.0,
        radius_class=settings.radius_class if settings.radii_are_known else 0.0,
        radius_offset=settings.radius_offset,
        radius_factor=settings.radius_factor if settings.radii_are_known else 0.0,
    )
    priors = replace(priors, lens=priors.lens if settings.lens else 0.0, radius=min(priors.radius, radius_prior))
    found = calibrate(
        measured, priors, rng=np.random.default_rng(SEED), typical_overlap=typical_overlap,
        radius_class=radius_classes(tracks.radius),
    )  # fmt: skip
    if not found.applied:
        # A noise stated far too small makes detection miss contacts, whatever the errors of the centres.
        factor = found.noise_factor if found.noise_factor > EXCESSIVE_NOISE else 1.0
        return replace(tracks, sigma=held_once(factor * tracks.sigma)), walls, found
    better = found.correct(measured)
    remaining = np.full(tracks.grain_count, found.position_sd(0.0))
    corrected = replace(
        tracks,
        radius=better.radius,
        position=better.position,
        sigma=held_once(found.noise_factor * tracks.sigma),
        centre_sigma=remaining,
    )
    return corrected, replace(walls, endpoints=better.endpoints), found


def own_gap_error(found: Calibration, size_class: NDArray[np.int64] | None = None) -> float:
    """Compute the rms part of a gap [m] that was corrected as errors of single grains.

    Where the grains hardly move against each other, such errors look like overlaps, which are corrected with them.

    Parameters
    ----------
    found : Calibration
    size_class : (n,), optional
        Stated size of each grain, from 0: an error that FEWEST or more grains of a size share is none of a single one.
    """
    own = found.radius - np.median(found.radius)
    if size_class is not None:
        for rows in (size_class == each for each in np.unique(size_class)):
            if rows.sum() >= FEWEST:
                own[rows] = found.radius[rows] - np.median(found.radius[rows])
    return float(np.sqrt(2.0 * (np.mean(found.offset**2) + np.mean(own**2))))


def known_radii(radius: Array) -> Array | None:
    """Find the different radii (q,) [m] among the radii (n,) [m], ascending; None where there are no classes."""
    classes = radius_classes(radius)
    return None if classes is None else radius[np.unique(classes, return_index=True)[1]]


def radius_classes(radius: Array) -> NDArray[np.int64] | None:
    """Find the class of each grain (n,) by its radius (n,) [m]; None where there are no classes."""
    ordered = np.sort(radius)
    new = np.concatenate([[True], np.diff(ordered) > SAME * ordered[1:]])
    if new.sum() > MOST_CLASSES:
        return None
    return np.searchsorted(ordered[new], radius * (1.0 + SAME), side="right") - 1
