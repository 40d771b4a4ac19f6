"""Drawing of rods and bars on sub-pixels, with arrays."""

from __future__ import annotations

import numpy as np
from rodsight.solver.bodies.grains import Array

FINE = 3  # sub-pixels per pixel
EDGE = 1.8  # [sub-pixel] half the width of a soft edge
PITCH = 6  # [px] of the backing's texture


def step(t: Array) -> Array:
    """∫ (1 − s²)³ ds from −1 to t over that to 1, by the polynomial's own antiderivative."""
    kernel = np.polynomial.Polynomial([1.0, 0.0, -1.0]) ** 3
    whole = kernel.integ(lbnd=-1.0)
    return whole(np.clip(t, -1.0, 1.0)) / whole(1.0)


def _grid(shape: tuple[int, int]) -> tuple[Array, Array]:
    y, x = np.indices(shape, dtype=float)
    return x, y


def _paint(shape: tuple[int, int], dots: Array) -> Array:
    """Brightness factor of painted dots (x, y, radius, strength) in sub-pixels; 1 where unpainted."""
    x, y = _grid(shape)
    left = np.ones(shape)
    for dx, dy, radius, strength in dots:
        square = (x - dx) ** 2 + (y - dy) ** 2
        left *= 1.0 - strength * step((radius**2 - square) / (2.0 * radius * EDGE))
    return left


def rod(
    shape: tuple[int, int], x: float, y: float, radius: float, angle: float, dots: Array, white: float, black: float,
    rim_shading: float, tilt: Array, rim_width: float,
) -> tuple[Array, Array]:  # fmt: skip
    """Brightness and coverage of a rod on a tile."""
    c, s = np.cos(angle), np.sin(angle)
    placed = np.array([
        (x + FINE * (c * a - s * b), y - FINE * (s * a + c * b), FINE * r, strength) for a, b, r, strength in dots
    ])  # fmt: skip
    px, py = _grid(shape)
    dx, dy = px - x, py - y
    distance = np.hypot(dx, dy)
    share = step((radius**2 - distance**2) / (2.0 * radius * EDGE))
    grey = black + (white - black) * _paint(shape, placed)
    with np.errstate(invalid="ignore"):
        side = np.where(distance > 0, (dx * tilt[0] + dy * tilt[1]) / np.where(distance > 0, distance, 1.0), 0.0)
    dark = np.minimum(1.0, rim_shading * (1.0 + side)) * step((distance - radius) / rim_width)
    grey = np.where(distance > max(0.0, radius - rim_width), grey * (1.0 - dark), grey)
    return share * grey, share


def bar(
    shape: tuple[int, int], x: float, y: float, along: Array, length: float, thickness: float, dots: Array,
    metal: float, black: float,
) -> tuple[Array, Array]:  # fmt: skip
    """Brightness and coverage of a bar on a tile, its body to the right of `along` (y goes down)."""
    inward = np.array([-along[1], along[0]])
    placed = np.array([
        (*(np.array([x, y]) + FINE * (a * along + b * inward)), FINE * r, strength) for a, b, r, strength in dots
    ])  # fmt: skip
    px, py = _grid(shape)
    s = (px - x) * along[0] + (py - y) * along[1]
    q = (px - x) * inward[0] + (py - y) * inward[1]
    share = step(q / EDGE) * step((thickness - q) / EDGE) * step(s / EDGE) * step((length - s) / EDGE)
    return share * (black + (metal - black) * _paint(shape, placed)), share


def collect(glow: Array, taps: Array) -> Array:
    """Every third sub-pixel of the picture weighted by the taps in both directions."""
    count = len(taps)
    rows, columns = ((size - count) // FINE + 1 for size in glow.shape)
    window = np.outer(taps, taps)
    return np.array([
        [np.sum(window * glow[FINE * r : FINE * r + count, FINE * c : FINE * c + count]) for c in range(columns)]
        for r in range(rows)
    ])  # fmt: skip


def with_backing(scene: Array, covered: Array, backing: Array, gap: float, texture: float, light: float) -> Array:
    x, y = _grid(scene.shape)
    j, i = (x // PITCH).astype(int), (y // PITCH).astype(int)
    u, v = (3.0 * t**2 - 2.0 * t**3 for t in (x % PITCH / PITCH, y % PITCH / PITCH))
    corner = [[backing[i + a, j + b] for b in (0, 1)] for a in (0, 1)]
    smooth = (1 - v) * ((1 - u) * corner[0][0] + u * corner[0][1]) + v * ((1 - u) * corner[1][0] + u * corner[1][1])
    behind = (1.0 - covered) * np.maximum(0.0, gap + texture * smooth)
    grey = np.where(covered > 1.0, scene / np.maximum(covered, 1.0), scene + np.where(covered < 1.0, behind, 0.0))
    half = 0.5 * max(scene.shape)
    a, b = (x - 0.5 * scene.shape[1]) / half, (y - 0.5 * scene.shape[0]) / half
    return grey * (1.0 + light * (0.6 * a - 0.3 * b + 0.1 * (1.0 - a**2 - b**2)))
