"""Photographs so close together that noise hides the sliding between them."""

from __future__ import annotations

import numpy as np

from ...solver.convex.program import SLIP_SIGMAS
from ...solver.detection.displacement import displacement_scale
from ...tracks import Tracks

HIDDEN = 0.5  # displacement over the noise of a sliding: below it most of what is read is noise
VISIBLE = 1.0  # the same over the interval that is advised
MOST_STRIDE = 16
SAMPLES = 5  # intervals from which a displacement is read
LEAST_INTERVALS = 4  # of the advised length in the sequence


def advise_stride(tracks: Tracks) -> str:
    """Advise to solve one photograph in several, where noise hides the sliding from one to the next.

    Returns
    -------
    str
        A sentence for the user; empty: the photographs are far enough apart, or too few.
    """
    stride = sufficient_stride(tracks)
    if stride == 1:
        return ""
    return (
        "photographs follow one another so closely that noise hides the sliding between them "
        f"({1e6 * _displacement(tracks, 1):.0f} µm where noise is {1e6 * _noise(tracks):.0f} µm): compare the forces "
        f"from one photograph in {stride}, --frames ::{stride}"
    )


def sufficient_stride(tracks: Tracks) -> int:
    """Number of photographs over which sliding exceeds noise; 1: neighbouring ones do, or there are too few.

    Notes
    -----
    s(m), the median rms non-affine displacement of a grain over m photographs, against the noise 2.8 σ of a sliding:
    advised is the least m with s(m) ≥ 2.8 σ where s(1) < 1.4 σ. Errors of one photograph enter the sliding over any
    interval once, but sliding grows with its length. Smoothing the positions instead would make the errors of
    neighbouring photographs alike.
    """
    frames = tracks.frame_count
    if frames < 2 * LEAST_INTERVALS or not tracks.present.any():
        return 1
    noise = _noise(tracks)
    if not _displacement(tracks, 1) < HIDDEN * noise:
        return 1
    for stride in range(2, min(MOST_STRIDE, (frames - 1) // LEAST_INTERVALS) + 1):
        if _displacement(tracks, stride) >= VISIBLE * noise:
            return stride
    return 1


def _noise(tracks: Tracks) -> float:
    """Standard deviation of a measured sliding [m]."""
    return SLIP_SIGMAS * float(np.sqrt(np.mean(tracks.sigma[tracks.present] ** 2)))


def _displacement(tracks: Tracks, stride: int) -> float:
    """Median displacement scale [m] over several intervals of so many photographs; NaN: none can be read."""
    position = np.where(tracks.present[..., None], tracks.position, np.nan)
    sigma = np.where(tracks.present, tracks.sigma, 0.0)
    begins = np.unique(np.linspace(0, tracks.frame_count - 1 - stride, SAMPLES).astype(int))
    scales = []
    for k in begins.tolist():
        both = np.isfinite(position[k, :, 0]) & np.isfinite(position[k + stride, :, 0])
        if np.count_nonzero(both) > 1:
            mean = np.sqrt(0.5 * (sigma[k] ** 2 + sigma[k + stride] ** 2))
            scales.append(displacement_scale(position[k], position[k + stride], mean))
    return float(np.median(scales)) if scales else np.nan
