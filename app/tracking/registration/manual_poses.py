"""Poses given by hand: starts of fits, kept where no fit is found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...solver.bodies.grains import Array
from ...tracks import TrackStatus
from ..correlation.correlator import Rows, SearchRange
from .registration import Registration

# Standard deviation of a pose that is set by hand and eye [px], where correlation finds nothing.
MANUAL_SIGMA = 1.0

# Half width [px] of the search for an angle that is not given.
MANUAL_WINDOW = 3.0


@dataclass(frozen=True, slots=True)
class ManualPoses:
    """Poses of m grains in one photograph, given by hand."""

    row: Rows  # (m,) of the tracker's grains
    pose: Array  # (m, 3) x, y [px], NaN: the grain is not visible; rotation [rad] of the picture, NaN: not given

    @property
    def lost(self) -> Rows:
        return self.row[np.isnan(self.pose[:, 0])]


def apply_manual_poses(registration: Registration, given: ManualPoses) -> None:
    """Fit every corrected grain from its given pose, before any other grain is fitted.

    An acceptable fit is stored, plain or robust. Where there is none the given pose is stored with the status
    `TrackStatus.GIVEN`.
    """
    results, last = registration.results, registration.last
    results.exclude(given.lost)
    visible = np.isfinite(given.pose[:, 0])
    rows, pose = given.row[visible], given.pose[visible].copy()
    usable = registration.patches.usable[rows]
    without_angle = np.isnan(pose[:, 2])
    for k in np.flatnonzero(without_angle & usable):
        pose[k] = _find_angle(registration, rows[k : k + 1], pose[k])
    pose[without_angle & ~usable, 2] = last[rows[without_angle & ~usable], 2]
    fitted, start = rows[usable], pose[usable]
    if len(fitted):
        registration.fit_and_accept(fitted, start, TrackStatus.OK)
        missing = results.missing[fitted]
        registration.refit_occluded(fitted[missing], start[missing])
    not_fitted = ~results.accepted[rows]
    results.set_given(rows[not_fitted], pose[not_fitted], MANUAL_SIGMA)
    results.exclude(rows[not_fitted])


def _find_angle(registration: Registration, row: Rows, pose: Array) -> Array:
    """The pose (3,) with the angle that correlates best near a given place."""
    middle = np.array([[pose[0], pose[1], registration.last[row[0], 2]]])
    within = SearchRange(middle, np.full(1, MANUAL_WINDOW), np.pi)
    best = registration.correlator.search(registration.photograph, row, within, 1)[0, 0]
    return best[:3].copy() if best[3] > 0.0 else middle[0]
