"""Poses that a user tells are where the tracker begins, and stand where it finds nothing better."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.bodies.grains import Array

from ...tracks import TrackStatus
from ..correlation.correlator import Rows, SearchRange
from .registration import Registration

# What a hand and an eye are trusted with [px], where correlation finds nothing there.
HAND_SIGMA = 1.0

# How far from a told place the angle that was not told is looked for [px].
HAND_REACH = 3.0


@dataclass(frozen=True, slots=True)
class ManualPoses:
    """Poses of m grains in one photograph, told by hand."""

    row: Rows  # (m,) of the tracker's grains
    pose: Array  # (m, 3) x, y [px], NaN: the grain is not to be seen; rotation [rad] of the picture, NaN: not told

    @property
    def lost(self) -> Rows:
        return self.row[np.isnan(self.pose[:, 0])]


def settle_manual_poses(registration: Registration, told: ManualPoses) -> None:
    """Fit every told grain from its told pose and settle it, before anything else is looked for.

    A fit that correlates as it should is taken, plain or robust. Where there is none the told pose itself is, with the
    status of one that was given: a person has looked.
    """
    findings, last = registration.findings, registration.last
    findings.close(told.lost)
    seen = np.isfinite(told.pose[:, 0])
    rows, pose = told.row[seen], told.pose[seen].copy()
    usable = registration.patches.usable[rows]
    untold = np.isnan(pose[:, 2])
    for k in np.flatnonzero(untold & usable):
        pose[k] = _find_angle(registration, rows[k : k + 1], pose[k])
    pose[untold & ~usable, 2] = last[rows[untold & ~usable], 2]
    fitted, start = rows[usable], pose[usable]
    if len(fitted):
        registration.take_fits(fitted, start, TrackStatus.OK)
        left = findings.open[fitted]
        registration.refit_hidden(fitted[left], start[left])
    stubborn = ~findings.accepted[rows]
    findings.give(rows[stubborn], pose[stubborn], HAND_SIGMA)
    findings.close(rows[stubborn])


def _find_angle(registration: Registration, row: Rows, pose: Array) -> Array:
    """The pose whose angle correlates best at a told place (3,)."""
    middle = np.array([[pose[0], pose[1], registration.last[row[0], 2]]])
    within = SearchRange(middle, np.full(1, HAND_REACH), np.pi)
    best = registration.correlator.search(registration.photograph, row, within, 1)[0, 0]
    return best[:3].copy() if best[3] > 0.0 else middle[0]
