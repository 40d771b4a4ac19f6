"""Roughness and elastic overlap of touching surfaces."""

from __future__ import annotations

from ..bodies.grains import Array

SURFACE = 3e-4  # typical overlap or roughness of touching surfaces in mean diameters


def typical_overlap(radius: Array) -> float:
    """Typical overlap or separation of touching surfaces by elasticity and roughness.

    A missed contact costs far more than a false one, so the value is rather too large than too small.

    Parameters
    ----------
    radius : ndarray, shape (n,)
        Radii of the grains [m].

    Returns
    -------
    float
        3e-4 mean diameters [m].
    """
    return SURFACE * 2.0 * float(radius.mean())
