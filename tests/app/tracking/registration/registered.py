"""A registration whose results are given instead of fitted."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
from rodsight.tracking.correlation import kernels
from rodsight.tracking.correlation.correlator import Fits
from rodsight.tracking.registration.registration_results import RegistrationResults
from rodsight.tracking.settings import TrackingSettings
from rodsight.tracks import TrackStatus

PITCH, RADIUS = 50.0, 20.0  # [px]
CONTRAST = 30.0  # [grey]
PIXELS = 900


def grid(columns: int, rows: int) -> np.ndarray:
    """Positions (n, 2) [px] of grains on a grid, the middle one at n // 2 for odd numbers."""
    column, row = np.meshgrid(np.arange(columns), np.arange(rows))
    return PITCH * np.stack([column.ravel(), row.ravel()], axis=1).astype(np.float64)


def patches_at(centre: np.ndarray, accidental_zncc: float = 0.3) -> Any:
    """Patches with the same contrast and accidental ZNCC everywhere."""
    n = len(centre)
    return SimpleNamespace(
        centre=centre, usable=np.ones(n, bool), norm=np.full(n, CONTRAST * np.sqrt(PIXELS)), mean=np.full(n, 100.0),
        pixel_count=np.full(n, PIXELS), accidental_zncc=np.full(n, accidental_zncc), radius=np.full(n, RADIUS),
    )  # fmt: skip


def results_at(last: np.ndarray, accidental_zncc: float = 0.3) -> RegistrationResults:
    """Results without any pose."""
    return RegistrationResults(patches_at(last, accidental_zncc), TrackingSettings())


def registered(last: np.ndarray, moved: np.ndarray, zncc: float, accidental_zncc: float = 0.3) -> Any:
    """A registration in which all grains were found at last + moved (n, 2) [px] with one ZNCC."""
    results = results_at(last, accidental_zncc)
    results.pose[:] = np.column_stack([last + moved, np.zeros(len(last))])
    results.zncc[:] = zncc
    results.status[:] = TrackStatus.OK
    pose = np.column_stack([last, np.zeros(len(last))])
    return SimpleNamespace(results=results, last=pose, settings=results.settings)


def fits_of(pose: np.ndarray, zncc: np.ndarray, residual: float = 4.0, kept: float = 1.0, code: int = 0) -> Fits:
    """Fits (m,) with given poses (m, 3) and quality; code: `kernels.CONVERGED` by default."""
    m = len(pose)
    assert kernels.CONVERGED == 0
    return Fits(
        pose, np.asarray(zncc, float), np.full(m, residual), np.full(m, 2.0 * CONTRAST * np.sqrt(PIXELS)),
        np.full(m, 150.0), np.full(m, kept), np.full(m, code, np.uint8), np.tile(1e-4 * np.eye(3), (m, 1, 1)),
    )  # fmt: skip
