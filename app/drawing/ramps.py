"""Ramps of colours, even in OKLab, and those of the normal force on dark and on white backgrounds.

A ramp is a path through OKLab divided into steps of equal length, so that equal differences of force look equally
different. OKLab: B. Ottosson, "A perceptual color space for image processing" (2020).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..solver.bodies.grains import Array

# Cone responses (cubed) from OKLab, and linear sRGB from cone responses: Ottosson (2020).
_CONES_FROM_LAB = np.array(
    [[1.0, 0.3963377774, 0.2158037573], [1.0, -0.1055613458, -0.0638541728], [1.0, -0.0894841775, -1.2914855480]]
)
_RGB_FROM_CONES = np.array(
    [
        [4.0767416621, -3.3077115913, 0.2309699292],
        [-1.2684380046, 2.6097574011, -0.3413193965],
        [-0.0041960863, -0.7034186147, 1.7076147010],
    ]
)

# Lightness, chroma, hue [°] along the path: deep red, vermilion, orange, yellow, cream.
_FORCE_PATH = ((0.46, 0.150, 20.0), (0.60, 0.195, 34.0), (0.74, 0.165, 60.0), (0.87, 0.155, 92.0), (0.97, 0.06, 106.0))
# The same hues on white, where the strongest must be darkest: amber, vermilion, deep red, maroon, nearly black.
_FORCE_PATH_ON_WHITE = (
    (0.80, 0.155, 78.0), (0.66, 0.185, 45.0), (0.50, 0.170, 26.0), (0.32, 0.110, 12.0), (0.16, 0.040, 350.0),
)  # fmt: skip
RAMP_LEVELS = 64


def lab_from_lch(path: tuple[tuple[float, float, float], ...]) -> Array:
    """Convert lightness, chroma and hue [°] (k, 3) to OKLab (k, 3)."""
    lightness, chroma, hue = np.array(path).T
    return np.stack([lightness, chroma * np.cos(np.radians(hue)), chroma * np.sin(np.radians(hue))], axis=1)


def linear_srgb(lab: Array) -> Array:
    """Convert OKLab (k, 3) to linear sRGB (k, 3), not clipped: outside 0 … 1 a screen cannot show it."""
    return (lab @ _CONES_FROM_LAB.T) ** 3 @ _RGB_FROM_CONES.T


def even_path(corners: Array, count: int) -> Array:
    """Return points (count, 3) at equal distances along the polyline through OKLab corners (k, 3)."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    at = np.linspace(0.0, length[-1], count)
    return np.stack([np.interp(at, length, corners[:, axis]) for axis in range(3)], axis=1)


def make_ramp(path: tuple[tuple[float, float, float], ...]) -> NDArray[np.uint8]:
    """Return a ramp (RAMP_LEVELS, 4) of opaque sRGB colours along a path through OKLab."""
    linear = np.clip(linear_srgb(even_path(lab_from_lch(path), RAMP_LEVELS)), 0.0, 1.0)
    srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    ramp = np.full((RAMP_LEVELS, 4), 255, np.uint8)
    ramp[:, :3] = np.round(255.0 * srgb)
    return ramp


FORCE_RAMP = make_ramp(_FORCE_PATH)
FORCE_RAMP_ON_WHITE = make_ramp(_FORCE_PATH_ON_WHITE)
