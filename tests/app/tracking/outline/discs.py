"""Synthetic photographs of discs without paint: plain bright or dark ones, and photoelastic ones with fringes."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from rodsight.solver.bodies.grains import Array

FINE = 3  # sub-pixels a side


@dataclass(frozen=True, slots=True)
class Light:
    """Grey levels, noise and blur of a kind of discs."""

    inside: float
    outside: float
    fringes: float = 0.0  # [grey] greatest deviation from the inside
    noise: float = 2.0
    blur: float = 0.8  # [px]


WHITE = Light(200.0, 20.0)
BLACK = Light(30.0, 190.0)
TRANSPARENT = Light(70.0, 60.0, fringes=90.0)
KINDS = {"white on black": WHITE, "black on white": BLACK, "fringes": TRANSPARENT}


def photograph_discs(
    light: Light, shape: tuple[int, int], x: Array, y: Array, radius: Array, force: Array, seed: int
) -> np.ndarray:
    """Draw discs x, y, radius, force (n,) in a photograph (h, w) float32: fringes start at three contacts of each."""
    height, width = shape
    picture = np.full((height * FINE, width * FINE), light.outside, np.float32)
    contacts = np.random.default_rng(99).uniform(0.0, 2.0 * np.pi, (len(x), 3))  # where they are pressed
    for k in range(len(x)):
        low, high = (max(int((at - radius[k] - 1) * FINE), 0) for at in (x[k], y[k]))
        part = np.s_[high : int((y[k] + radius[k] + 2) * FINE), low : int((x[k] + radius[k] + 2) * FINE)]
        row, column = np.mgrid[part].astype(np.float64)
        dx, dy = (column + 0.5) / FINE - 0.5 - x[k], (row + 0.5) / FINE - 0.5 - y[k]
        if dx.size == 0:
            continue
        phase = np.zeros_like(dx)
        for angle in contacts[k]:
            away = np.hypot(dx - radius[k] * np.cos(angle), dy - radius[k] * np.sin(angle)) / radius[k]
            phase += force[k] / (0.15 + away)
        level = light.inside + light.fringes * np.sin(phase) ** 2 if light.fringes else light.inside
        inside = np.hypot(dx, dy) < radius[k]
        picture[part][inside] = np.broadcast_to(level, dx.shape)[inside]
    small = cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA)
    small = cv2.GaussianBlur(small, (0, 0), light.blur)
    return (small + np.random.default_rng(seed).normal(0.0, light.noise, small.shape)).astype(np.float32)


def lay_row_by_row(columns: int, rows: int, radii: tuple[float, float], seed: int = 0) -> tuple[Array, Array, Array]:
    """Lay discs x, y, radius (n,) [px] that nearly touch, in rows of alternating sizes."""
    rng = np.random.default_rng(seed)
    step = radii[0] + radii[1] + 0.6
    column, row = np.meshgrid(np.arange(columns), np.arange(rows))
    x = 2.5 * step + step * column.ravel() + rng.uniform(-0.2, 0.2, columns * rows)
    y = 2.5 * step + step * row.ravel() + rng.uniform(-0.2, 0.2, columns * rows)
    return x, y, np.array(radii)[(column + row).ravel() % 2].astype(np.float64)
