"""Synthetic photographs like those of a laboratory: brown rods with scratches and pencil lines, dim and soft.

There is no speckle: an end face has a fine texture of its own, a few flaws, and one line.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from rodsight.solver.bodies.grains import Array
from scipy.ndimage import gaussian_filter

FINE = 3  # sub-pixels a side
BROWN = np.array([0.62, 0.80, 1.0])  # blue, green, red: of a face, as OpenCV stores colours


@dataclass(frozen=True, slots=True)
class Laboratory:
    """Light, texture, blur and noise of the photograph. Grey levels are 0 … 255."""

    face: float = 125.0  # [grey] mean of a face
    face_scatter: float = 0.2  # ± relative difference between faces
    grain: float = 9.0  # [grey] standard deviation of the material's texture
    grain_size: float = 1.2  # [px] its standard deviation
    gap: float = 8.0  # [grey]
    light: float = 0.3  # ± across the picture
    blur: float = 1.1  # [px]
    noise: float = 2.0  # [grey]
    lathe: float = 0.0  # [grey] amplitude of nearly concentric turning marks
    highlight: float = 0.0  # [grey] of a soft reflex that stays on its side while the rod rotates
    shadow: float = 0.0  # fraction of the light that the rim on the lower right has lost
    jpeg: int = 0  # quality; 0: not compressed


def brown_photograph(
    laboratory: Laboratory, width: int, height: int, x: Array, y: Array, radius: Array, rotation: Array, *,
    pattern_seed: int, noise_seed: int,
) -> np.ndarray:  # fmt: skip
    """The photograph (height, width, 3) uint8 of n rods; turn (n,) [rad] from x towards y (down)."""
    fine = np.full((height * FINE, width * FINE), laboratory.gap, np.float32)
    for k in range(len(x)):
        _draw(fine, laboratory, x[k], y[k], radius[k], rotation[k], np.random.default_rng([pattern_seed, k]))
    # Sub-pixel s of pixel p lies at p + (s − 1)/3.
    grey = gaussian_filter(fine, laboratory.blur * FINE)
    grey = grey.reshape(height, FINE, width, FINE).mean(axis=(1, 3))
    across = np.linspace(-1.0, 1.0, width)[None, :] + 0.5 * np.linspace(-1.0, 1.0, height)[:, None]
    grey = grey * (1.0 + laboratory.light * across / 1.5)
    noise = np.random.default_rng(noise_seed).normal(0.0, laboratory.noise, (height, width, 3))
    image = np.clip(np.rint(grey[:, :, None] * BROWN + noise), 0, 255).astype(np.uint8)
    if laboratory.jpeg:
        _, content = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, laboratory.jpeg])
        image = np.asarray(cv2.imdecode(content, cv2.IMREAD_COLOR), dtype=np.uint8)
    return image


def _draw(
    fine: np.ndarray, laboratory: Laboratory, x: float, y: float, r: float, rotation: float, paint: np.random.Generator
) -> None:
    """Draw one rod: its texture lies on its own fixed grid and is interpolated at each sub-pixel."""
    side = int(np.ceil(r * FINE)) + 3
    size = 2 * side + 1
    texture = gaussian_filter(paint.standard_normal((size, size)), laboratory.grain_size * FINE)
    face = laboratory.face * (1.0 + laboratory.face_scatter * paint.uniform(-1.0, 1.0))
    skin = face + laboratory.grain * texture / texture.std()
    v, u = np.mgrid[-side : side + 1, -side : side + 1].astype(np.float64)
    for _ in range(paint.integers(2, 6)):  # pits and inclusions
        px, py = paint.uniform(-0.8, 0.8, 2) * r * FINE
        spot = np.hypot(u - px, v - py) < paint.uniform(0.03, 0.1) * r * FINE
        skin[spot] += paint.choice([-50.0, 45.0])
    for _ in range(3):  # two scratches and the pencil
        angle, off, breadth = (
            paint.uniform(0, np.pi),
            paint.uniform(-0.5, 0.5) * r * FINE,
            paint.uniform(0.3, 0.9) * FINE,
        )
        line = np.abs(u * np.sin(angle) - v * np.cos(angle) - off) < breadth
        skin[line] += paint.choice([-25.0, 18.0])
    if laboratory.lathe:
        ex, ey = paint.normal(0.0, 0.04, 2) * r * FINE
        pitch, phase = paint.uniform(2.2, 4.5) * FINE, paint.uniform(0.0, 2.0 * np.pi)
        skin += laboratory.lathe * np.sin(2.0 * np.pi * np.hypot(u - ex, v - ey) / pitch + phase)
    cx, cy = x * FINE + 1.0, y * FINE + 1.0  # of the sub-pixel grid
    top, left = int(np.floor(cy)) - side, int(np.floor(cx)) - side
    rows = np.arange(max(top, 0), min(top + size + 1, fine.shape[0]))
    columns = np.arange(max(left, 0), min(left + size + 1, fine.shape[1]))
    if len(rows) == 0 or len(columns) == 0:
        return
    dy, dx = np.meshgrid(rows - cy, columns - cx, indexing="ij")
    bu = np.cos(rotation) * dx + np.sin(rotation) * dy + side
    bv = -np.sin(rotation) * dx + np.cos(rotation) * dy + side
    iu, iv = np.clip(bu.astype(int), 0, size - 2), np.clip(bv.astype(int), 0, size - 2)
    fu, fv = bu - iu, bv - iv
    value = (
        (1 - fv) * ((1 - fu) * skin[iv, iu] + fu * skin[iv, iu + 1])
        + fv * ((1 - fu) * skin[iv + 1, iu] + fu * skin[iv + 1, iu + 1])
    )  # fmt: skip
    distance = np.hypot(dx, dy)
    # The light does not rotate with the rod.
    reflex = (dx + 0.3 * r * FINE) ** 2 + (dy + 0.35 * r * FINE) ** 2
    value = value + laboratory.highlight * np.exp(-reflex / (2.0 * (0.25 * r * FINE) ** 2))
    lower_right = np.clip((dx + dy) / np.sqrt(2.0) / np.maximum(distance, 1.0), 0.0, 1.0)
    depth = np.maximum(r - distance / FINE, 0.0)  # [px] inside the rim
    value = value * (1.0 - laboratory.shadow * lower_right * np.exp(-depth / 2.0))
    coverage = np.clip(r * FINE - distance + 0.5, 0.0, 1.0)
    region = fine[np.ix_(rows, columns)]
    fine[np.ix_(rows, columns)] = (1 - coverage) * region + coverage * value
