"""Checks of found poses: the fit's residual, the uniqueness of the place, and agreement with the neighbours."""

from __future__ import annotations

import numpy as np

from ...solver.bodies.grains import Array
from ...tracks import TrackStatus
from .neighbours import local_motion, overlaps
from .registration import Registration


def refit_poor(registration: Registration) -> None:
    """Refit poor fits robustly, and mark the grains as suspect that stay poor."""
    results = registration.results
    registration.flag_poor()
    poor = np.flatnonzero(results.poor & (results.status != TrackStatus.ROBUST))
    registration.refit_occluded(poor, results.pose[poor])
    results.mark_suspect(np.flatnonzero(results.poor & (results.status != TrackStatus.ROBUST)))


def flag_inconsistent(registration: Registration, radius: Array) -> None:
    """Mark ambiguous grains as suspect, and those that contradict or overlap their neighbours unless ZNCC is high.

    Parameters
    ----------
    registration : Registration
        The photograph; the status of its results is changed.
    radius : (n,) array
        Radii of the grains [px].

    Notes
    -----
    A grain is marked

    - where its displacement differs from its neighbours' local affine motion by more than 6 m + 0.25 R, m: the median
      deviation of the neighbours, R: its radius, unless its ZNCC exceeds both 0.8 and every accidental one;
    - where a second place correlates nearly as well: ZNCC₂ > ZNCC − margin;
    - where it overlaps another one and its ZNCC is the lower of the two. A pose given by hand has the lowest.
    """
    results, last, settings = registration.results, registration.last, registration.settings
    rows = np.flatnonzero(results.accepted)
    if len(rows) == 0:
        return
    known = rows[np.isfinite(last[rows, 0])]  # a grain without a reference may have its first pose here, given by hand
    moved = results.pose[known, :2] - last[known, :2]
    predicted, median_deviation = local_motion(last[known, :2], moved, last[known, :2], exclude_self=True)
    # Grains do move against their neighbours, by a fraction of a radius between photographs.
    deviation = np.linalg.norm(moved - predicted, axis=1)
    inconsistent = deviation > 6.0 * median_deviation + 0.25 * radius[known]
    certain = results.zncc[known] > np.maximum(results.accepted_zncc[known], 0.8)
    results.mark_suspect(known[inconsistent & ~certain])
    # Where a second place is nearly as similar, the grain may be there.
    results.mark_suspect(rows[results.second_zncc[rows] > results.zncc[rows] - settings.margin])
    pairs = rows[overlaps(results.pose[rows, :2], radius[rows], settings.overlap_allowed)]
    # A pose that nothing but a hand supports makes no other grain suspect.
    quality = np.where(results.status == TrackStatus.GIVEN, -1.0, results.zncc)
    for i, j in pairs:
        results.mark_suspect(np.array([i if quality[i] < quality[j] else j]))
