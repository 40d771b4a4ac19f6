"""Photographs so close together that noise hides the sliding from one to the next."""

from __future__ import annotations

import numpy as np

from ...solver.detection.displacement import displacement_scale
from ...solver.even_subset import even_subset
from ...solver.part_settings import SLIP_SIGMAS
from ...tracks import Tracks

HIDDEN = 0.5  # displacement over the noise of a sliding: below it most of what is read is noise
VISIBLE = 1.5  # the same over the span that is chosen
MAX_SPAN = 8  # r(f_n) is flat around VISIBLE, from three to five photographs; wider spans miss events
SAMPLES = 5  # intervals from which a displacement is read
LEAST_INTERVALS = 4  # of the chosen length in the sequence


def choose_span(tracks: Tracks) -> tuple[int, str]:
    """Choose over how many photographs sliding is read, where noise hides it from one to the next.

    Returns
    -------
    int
        Photographs m; 1: they are far enough apart, or too few.
    str
        A sentence for the user; empty: m is 1.

    Notes
    -----
    s(m), the median rms non-affine displacement of a grain over m photographs, against the noise 2.8 σ of a sliding:
    where s(1) < 0.5 · 2.8 σ, chosen is the least m with s(m) ≥ 1.5 · 2.8 σ, else the widest if s(m) ≥ 2.8 σ. Errors of
    one photograph enter the sliding over any interval once, but sliding grows with its length. Smoothing the positions
    instead would make the errors of neighbouring photographs alike.
    """
    present, frames = tracks.present, tracks.frame_count
    if frames < 2 * LEAST_INTERVALS or not present.any():
        return 1, ""
    noise = SLIP_SIGMAS * float(np.sqrt(np.mean(tracks.sigma[present] ** 2)))
    first = _displacement(tracks, 1)
    if not first < HIDDEN * noise:
        return 1, ""
    widest = min(MAX_SPAN, (frames - 1) // LEAST_INTERVALS)
    for span in range(2, widest + 1):
        moved = _displacement(tracks, span)
        if moved >= VISIBLE * noise or (span == widest and moved >= noise):
            return span, (
                "photographs follow one another so closely that noise hides the sliding between them "
                f"({1e6 * first:.0f} µm where noise is {1e6 * noise:.0f} µm): it is read over {span} photographs"
            )
    return 1, ""


def count_alike(tracks: Tracks) -> int:
    """Count the photographs so close together that one estimate from positions serves them all.

    Parameters
    ----------
    tracks : Tracks

    Returns
    -------
    int
        1 where grains do not move that far in any span: forces may change without motion.

    Notes
    -----
    The least m with s(m) ≥ 1.5 · 2.8 σ, as in `choose_span`, also where sliding is read from one to the next: within m
    photographs grains move less than the noise of a sliding lets one see well.
    """
    present, frames = tracks.present, tracks.frame_count
    if frames < 2 * LEAST_INTERVALS or not present.any():
        return 1
    limit = VISIBLE * SLIP_SIGMAS * float(np.sqrt(np.mean(tracks.sigma[present] ** 2)))
    widest = min(MAX_SPAN, (frames - 1) // LEAST_INTERVALS)
    return next((m for m in range(1, widest + 1) if _displacement(tracks, m) >= limit), 1)


def _displacement(tracks: Tracks, span: int) -> float:
    """Median displacement scale [m] over several intervals of so many photographs; NaN: none can be read."""
    position = np.where(tracks.present[..., None], tracks.position, np.nan)
    sigma = np.where(tracks.present, tracks.sigma, 0.0)
    begins = even_subset(tracks.frame_count - span, SAMPLES)
    scales = []
    for k in begins.tolist():
        both = np.isfinite(position[k, :, 0]) & np.isfinite(position[k + span, :, 0])
        if np.count_nonzero(both) > 1:
            mean = np.sqrt(0.5 * (sigma[k] ** 2 + sigma[k + span] ** 2))
            scales.append(displacement_scale(position[k], position[k + span], mean))
    return float(np.median(scales)) if scales else np.nan
