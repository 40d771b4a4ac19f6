"""Poses that a user tells are where the tracker begins, and stand where it finds nothing better."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.bodies.grains import Array

from ..tracks import TrackStatus
from .correlation.correlator import Correlator, Rows
from .correlation.splines import Pyramid
from .findings import Findings
from .rescue import leash, refit_hidden

# What a hand and an eye are trusted with [px], where correlation finds nothing there.
HAND_SIGMA = 1.0

# How far from a told place the angle that was not told is looked for [px].
HAND_REACH = 3.0


@dataclass(frozen=True, slots=True)
class Corrections:
    """Poses of m grains in one photograph, told by hand."""

    row: Rows  # (m,) of the tracker's grains
    pose: Array  # (m, 3) x, y [px], NaN: the grain is not to be seen; rotation [rad] of the picture, NaN: not told

    @property
    def lost(self) -> Rows:
        return self.row[np.isnan(self.pose[:, 0])]


def apply_corrections(
    correlator: Correlator, photograph: Pyramid, findings: Findings, told: Corrections, last: Array, noise: float
) -> None:
    """Fit every told grain from its told pose and settle it, before anything else is looked for.

    last (n, 3): the grains' most recent poses. A fit that correlates as it should is taken, plain or robust. Where
    there is none the told pose itself is, with the status of one that was given: a person has looked.
    """
    findings.close(told.lost)
    seen = np.isfinite(told.pose[:, 0])
    rows, pose = told.row[seen], told.pose[seen].copy()
    usable = correlator.patches.usable[rows]
    untold = np.isnan(pose[:, 2])
    for k in np.flatnonzero(untold & usable):
        pose[k] = _find_angle(correlator, photograph, rows[k : k + 1], pose[k], last[rows[k], 2])
    pose[untold & ~usable, 2] = last[rows[untold & ~usable], 2]
    fitted, start = rows[usable], pose[usable]
    if len(fitted):
        findings.take(fitted, correlator.fit(photograph, fitted, start, leash(correlator, fitted)), TrackStatus.OK)
        left = findings.open[fitted]
        refit_hidden(correlator, photograph, findings, fitted[left], start[left], noise)
    stubborn = ~findings.accepted[rows]
    findings.give(rows[stubborn], pose[stubborn], HAND_SIGMA)
    findings.close(rows[stubborn])


def _find_angle(correlator: Correlator, photograph: Pyramid, row: Rows, pose: Array, before: float) -> Array:
    """The pose whose angle correlates best at a told place (3,)."""
    middle = np.array([[pose[0], pose[1], before]])
    best = correlator.search(photograph, row, middle, np.full(1, HAND_REACH), np.pi, 1)[0, 0]
    return best[:3].copy() if best[3] > 0.0 else middle[0]
