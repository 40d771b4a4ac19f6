"""Predictions of poses by the grain's own motion and by its neighbours' motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...solver.bodies.grains import Array
from ...tracks import TrackStatus
from .poses import FramePoses
from .registration import Registration


def last_known(history: Sequence[FramePoses], first: FramePoses) -> Array:
    """Return the most recent pose of every grain (n, 3): x, y [px], rotation [rad]."""
    last = history[-1].pose
    for frame in reversed([first, *history[:-1]]):
        missing = ~np.isfinite(last[:, 0])
        if not missing.any():
            break
        last[missing] = frame.pose[missing]
    return last


def fit_from_own_motion(registration: Registration, history: Sequence[FramePoses]) -> None:
    """Fit every grain from its extrapolated motion, and from its last pose where that fails."""
    results = registration.results
    visible = np.isfinite(history[-1].x)
    guess = history[-1].pose
    if len(history) > 1:
        step = history[-1].pose - history[-2].pose
        guess = np.where(np.isfinite(step), guess + step, guess)
    rows = np.flatnonzero(visible & results.missing)
    registration.fit_and_accept(rows, guess[rows], TrackStatus.OK)
    rows = np.flatnonzero(visible & results.missing)
    if len(history) > 1 and len(rows):
        registration.fit_and_accept(rows, registration.last[rows], TrackStatus.OK)


def fit_from_neighbour_motion(registration: Registration) -> None:
    """Fit the missing grains from their neighbours' motion, repeatedly, until no further grain is found."""
    results = registration.results
    while True:
        rows = results.predict_from_neighbours(registration.last)
        before = results.accepted.sum()
        if len(rows):
            registration.fit_and_accept(rows, results.predicted[rows], TrackStatus.OK)
        if results.accepted.sum() == before:
            return
