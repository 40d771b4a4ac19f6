"""Standard deviations of forces by a formula, before they are calibrated by kind of contact (`force_intervals`)."""

from __future__ import annotations

import numpy as np

from ...bodies.grains import Array
from ..fitted import FITTED

NORMAL_SD: tuple[float, float, float] = tuple(FITTED["formula_sd"]["normal"])
TANGENTIAL_SD: tuple[float, float, float] = tuple(FITTED["formula_sd"]["tangential"])
CHAIN_SD: tuple[float, float] = tuple(FITTED["formula_sd"]["single_chain"])


def normal_sd(fn: Array, ensemble_sd: Array | None = None) -> Array:
    """Standard deviation of every normal force.

    Parameters
    ----------
    fn : ndarray, shape (c,)
        Normal forces [N].
    ensemble_sd : ndarray, shape (c,), optional
        Standard deviation of f_n among the ensemble members [N]; None: a single chain.

    Returns
    -------
    ndarray, shape (c,)
        σ [N] with σ²/⟨f⟩² = a² + b² f/⟨f⟩ + (c s/⟨f⟩)².
    """
    if ensemble_sd is None:
        return _formula(fn, np.zeros_like(fn), (*CHAIN_SD, 0.0))
    return _formula(fn, ensemble_sd, NORMAL_SD)


def tangential_sd(fn: Array, friction: Array | float, ensemble_sd: Array | None = None) -> Array:
    """Standard deviation of every tangential force; `ensemble_sd` (c,) [N] of f_t, None: μ times that of f_n."""
    if ensemble_sd is None:
        return friction * normal_sd(fn)
    return _formula(fn, ensemble_sd, TANGENTIAL_SD)


def _formula(fn: Array, ensemble_sd: Array, constants: tuple[float, float, float]) -> Array:
    bearing = fn > 0
    if not bearing.any():
        return np.zeros_like(fn)
    mean, (a, b, c) = fn[bearing].mean(), constants
    return mean * np.sqrt(a**2 + b**2 * np.maximum(fn, 0.0) / mean + (c * ensemble_sd / mean) ** 2)
