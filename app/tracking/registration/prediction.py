"""Where a grain should be: where its own motion leads, and where its neighbours' does."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from solver.bodies.grains import Array

from ...tracks import TrackStatus
from .poses import FramePoses
from .registration import Registration


def last_known(history: Sequence[FramePoses], first: FramePoses) -> Array:
    """The most recent pose of every grain (n, 3)."""
    last = history[-1].pose
    for frame in reversed([first, *history[:-1]]):
        gone = ~np.isfinite(last[:, 0])
        if not gone.any():
            break
        last[gone] = frame.pose[gone]
    return last


def follow_own_motion(registration: Registration, history: Sequence[FramePoses]) -> None:
    """Fit every grain from its own motion, and from rest where that leads nowhere."""
    findings = registration.findings
    seen = np.isfinite(history[-1].x)
    guess = history[-1].pose
    if len(history) > 1:
        step = history[-1].pose - history[-2].pose
        guess = np.where(np.isfinite(step), guess + step, guess)
    rows = np.flatnonzero(seen & findings.open)
    registration.take_fits(rows, guess[rows], TrackStatus.OK)
    rows = np.flatnonzero(seen & findings.open)
    if len(history) > 1 and len(rows):
        registration.take_fits(rows, registration.last[rows], TrackStatus.OK)


def follow_neighbours(registration: Registration) -> None:
    """Fit what is open from its neighbours' motion, as long as that finds grains."""
    findings = registration.findings
    while True:
        rows = findings.expect_from_neighbours(registration.last)
        before = findings.accepted.sum()
        if len(rows):
            registration.take_fits(rows, findings.expected[rows], TrackStatus.OK)
        if findings.accepted.sum() == before:
            return
