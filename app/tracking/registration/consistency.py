"""What was found is doubted where it fits badly, is not unique, or contradicts what was found beside it."""

from __future__ import annotations

import numpy as np

from solver.bodies.grains import Array

from ...tracks import TrackStatus
from .neighbours import local_motion, overlaps
from .registration import Registration


def refit_poor(registration: Registration) -> None:
    """Refit robustly what fits worse than noise explains, and doubt what is no better then."""
    findings = registration.findings
    registration.judge_residuals()
    poor = np.flatnonzero(findings.poor & (findings.status != TrackStatus.ROBUST))
    registration.refit_hidden(poor, findings.pose[poor])
    findings.doubt(np.flatnonzero(findings.poor & (findings.status != TrackStatus.ROBUST)))


def doubt_inconsistent(registration: Registration, radius: Array) -> None:
    """Mark what is not unique, and what contradicts its neighbours or overlaps them unless its ZNCC is high.

    radius (n,) [px] of the grains.
    """
    findings, last, settings = registration.findings, registration.last, registration.settings
    rows = np.flatnonzero(findings.accepted)
    if len(rows) == 0:
        return
    moved = findings.pose[rows, :2] - last[rows, :2]
    predicted, scatter = local_motion(last[rows, :2], moved, last[rows, :2], itself=True)
    # Grains do move against their neighbours, by a share of a radius between photographs.
    deviation = np.linalg.norm(moved - predicted, axis=1)
    odd = deviation > 6.0 * scatter + 0.25 * radius[rows]
    certain = findings.zncc[rows] > np.maximum(findings.accepted_zncc[rows], 0.8)
    findings.doubt(rows[odd & ~certain])
    # A grain that another place resembles nearly as well may be there.
    findings.doubt(rows[findings.second_zncc[rows] > findings.zncc[rows] - settings.margin])
    pairs = rows[overlaps(findings.pose[rows, :2], radius[rows], settings.overlap_allowed)]
    trust = np.where(findings.status == TrackStatus.GIVEN, np.inf, findings.zncc)
    for i, j in pairs:
        findings.doubt(np.array([i if trust[i] < trust[j] else j]))
