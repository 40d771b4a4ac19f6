"""Synthetic photographs of thick plain discs, whose sides are seen beside their faces, and of textured grounds."""

from __future__ import annotations

import numpy as np
from rodsight.solver.bodies.grains import Array
from scipy.ndimage import gaussian_filter

FINE = 3  # sub-pixels a side
GAP, FACE, SIDE_LIGHT, NOISE, BLUR = 4.0, (35.0, 70.0), 1.5, 2.0, 1.0  # [grey]; of a face; [grey]; [px]


def draw_thick_discs(width: int, height: int, x: Array, y: Array, radius: Array, *, side: float, seed: int) -> Array:
    """The photograph (height, width) [grey]: discs in front of a dark ground, whose far faces are nearer to the middle.

    side: distance of both faces at the middle of the border [px].
    """
    generator = np.random.default_rng(seed)
    fine = np.full((height * FINE, width * FINE), GAP, np.float32)
    row, column = (np.mgrid[0 : height * FINE, 0 : width * FINE].astype(np.float32) + 0.5) / FINE - 0.5
    light = generator.uniform(*FACE, len(x))
    far = side * (np.column_stack([x, y]) / (0.5 * width, 0.5 * height) - 1.0)
    for k in range(len(x)):
        fine[np.hypot(column - x[k] + far[k, 0], row - y[k] + far[k, 1]) < radius[k]] = SIDE_LIGHT * light[k]
    for k in range(len(x)):
        fine[np.hypot(column - x[k], row - y[k]) < radius[k]] = light[k]
    image = gaussian_filter(fine, BLUR * FINE).reshape(height, FINE, width, FINE).mean(axis=(1, 3))
    return np.clip(np.rint(image + generator.normal(0.0, NOISE, image.shape)), 0.0, 255.0).astype(np.float32)


def with_ground(image: Array, dark: float, above: int, *, texture: float, seed: int) -> Array:
    """The photograph below `above` rows of ground, whose texture [grey] shows wherever it is darker than `dark`."""
    generator = np.random.default_rng(seed)
    ground = 20.0 + generator.normal(0.0, NOISE, (above, image.shape[1]))
    whole = np.vstack([ground, image])
    grain = gaussian_filter(generator.normal(size=whole.shape), 1.0)
    return np.where(whole < dark, whole + texture * np.abs(grain) / grain.std(), whole).astype(np.float32)
