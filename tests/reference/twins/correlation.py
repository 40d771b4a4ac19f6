"""Correlation of one patch with arrays: tables, fits and the exhaustive search."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from rodsight.solver.bodies.grains import Array

from tests.reference.twins.splines import values


def pixels_within(cx: float, cy: float, reach: float) -> list[tuple[int, int]]:
    """Whole pixels (x, y) of a disc, row by row."""
    across = range(int(np.floor(cx - reach)), int(np.ceil(cx + reach)) + 1)
    down = range(int(np.floor(cy - reach)), int(np.ceil(cy + reach)) + 1)
    return [(x, y) for y in down for x in across if (x - cx) ** 2 + (y - cy) ** 2 <= reach**2]


@dataclass(frozen=True, slots=True)
class PlainPatch:
    """A patch of the reference: f of zero mean and unit norm, and its steepest descent images J beside f and a 1."""

    dx: Array
    dy: Array
    f: Array
    descent: Array  # (p, 3)
    norm: float
    mean: float
    correlation_length: float  # [px²]


def cut_patch(image: Array, coefficients: Array, cx: float, cy: float, reach: float) -> PlainPatch:
    pixels = pixels_within(cx, cy, reach)
    dx, dy = np.array(pixels, float).T - np.array([[cx], [cy]])
    grey = np.array([float(image[y, x]) for x, y in pixels])
    slope_x, slope_y = (values(coefficients, dx + cx, dy + cy, 3, along) for along in ((1, 0), (0, 1)))
    centred = grey - grey.mean()
    norm = float(np.linalg.norm(centred))
    f = centred / norm
    descent = np.stack([slope_x, slope_y, slope_y * dx - slope_x * dy], axis=1) / norm
    known = np.stack([f, np.full(len(f), len(f) ** -0.5)], axis=1)  # orthonormal
    descent = descent - known @ (known.T @ descent)
    power = 0.5 * float(np.sum(slope_x**2 + slope_y**2))
    return PlainPatch(dx, dy, f, descent, norm, float(grey.mean()), norm**2 / power)


def read(coefficients: Array, patch: PlainPatch, pose: Array, degree: int) -> Array:
    c, s = np.cos(pose[2]), np.sin(pose[2])
    x, y = pose[0] + c * patch.dx - s * patch.dy, pose[1] + s * patch.dx + c * patch.dy
    return values(coefficients, x, y, degree)


def compose(pose: Array, step: Array, reach: float) -> Array:
    """W ∘ W(step)⁻¹, the step limited to 1.5 pixels at the centre or the rim."""
    longest = max(np.hypot(step[0], step[1]), reach * abs(step[2]))
    step = step * min(1.0, 1.5 / longest) if longest > 0 else step
    angle = pose[2] - step[2]
    rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return np.array([*(pose[:2] - rotation @ step[:2]), angle])


def fit_plainly(
    coefficients: Array, patch: PlainPatch, reach: float, pose: Array, *, tolerance: float = 1e-3, limit: int = 60
) -> tuple[Array, float, float, float, float]:
    """Converged Gauss-Newton fit: pose, ZNCC, residual variance, gain and offset."""
    for _ in range(limit):
        g = read(coefficients, patch, pose, 5)
        gain = float(g @ patch.f)
        step = np.linalg.lstsq(patch.descent, g - g.mean() - gain * patch.f, rcond=None)[0] / gain
        pose = compose(pose, step, reach)
        if np.hypot(step[0], step[1]) + reach * abs(step[2]) < tolerance:
            break
    g = read(coefficients, patch, pose, 5)
    gain, spread = float(g @ patch.f), float(np.sum((g - g.mean()) ** 2))
    return pose, gain / np.sqrt(spread), (spread - gain**2) / (len(g) - 5), gain, float(g.mean())


def tukey_fixed_point(
    coefficients: Array, patch: PlainPatch, pose: Array, gain: float, offset: float, noise: float
) -> tuple[Array, Array, float, float, float, float]:
    """One full Tukey-weighted Gauss-Newton step from a fit: step (3,), covariance (3, 3), gain, offset, kept, residual.

    At the end of a robust fit the step is small and gain and offset are what went in.
    """
    g = read(coefficients, patch, pose, 5)
    misfit = np.abs(g - gain * patch.f - offset)
    scale = max(float(np.quantile(misfit, 0.35)) / 0.4538, noise)
    weight = np.clip(1.0 - (misfit / (4.685 * scale)) ** 2, 0.0, None) ** 2
    design = np.column_stack([gain * patch.descent, patch.f, np.ones(len(g))])
    inverse = np.linalg.inv(design.T @ (weight[:, None] * design))
    answer = inverse @ (design.T @ (weight * g))
    residual = float(weight @ misfit**2) / max(float(weight.sum()) - 5.0, 1.0)
    return answer[:3], inverse[:3, :3] * residual, answer[3], answer[4], float(weight.mean()), residual


def search_plainly(
    reference: Array,
    image: Array,
    origin: tuple[float, float],
    reach: float,
    places: list[tuple[int, int]],
    angles: Array,
    *,
    parts: bool,
) -> Array:
    """ZNCC (angles, places) of the disc or, with `parts`, of its best half over √2 if greater."""  # fmt: skip
    disc = [(x, y) for x, y in pixels_within(0.0, 0.0, reach)]
    dx, dy = np.array(disc).T
    quarter = np.array([(0 if x >= 0 else 1) if y >= 0 else (2 if x < 0 else 3) for x, y in disc])
    scores = np.empty((len(angles), len(places)))
    for k, angle in enumerate(angles):
        c, s = np.cos(angle), np.sin(angle)
        template = values(reference, origin[0] + c * dx + s * dy, origin[1] - s * dx + c * dy, 3)
        for m, (px, py) in enumerate(places):
            there = image[py + dy, px + dx].astype(np.float64)
            scores[k, m] = _zncc(template, there)
            for half in range(4 if parts else 0):
                chosen = (quarter == half) | (quarter == (half + 1) % 4)
                scores[k, m] = max(scores[k, m], _zncc(template[chosen], there[chosen]) / np.sqrt(2.0))
    return scores


def _zncc(a: Array, b: Array) -> float:
    """ZNCC of two arrays; 0 below one grey level of contrast."""
    if np.sum((b - b.mean()) ** 2) <= len(b):
        return 0.0
    return float(np.corrcoef(a, b)[0, 1])


def best_places(
    scores: Array, places: list[tuple[int, int]], angles: Array, sectors: int, spacing: float, count: int
) -> list[tuple[float, float, float, float]]:
    """The highest local maxima (x, y, angle, score) that are distinct in place or angle."""
    maxima = []
    at = {place: m for m, place in enumerate(places)}
    for sector in range(sectors):
        own = [k for k in range(len(angles)) if k * sectors // len(angles) == sector]
        peak = scores[own].max(axis=0)
        best = np.array(own)[scores[own].argmax(axis=0)]
        for (x, y), m in at.items():
            around = [at[x + a, y + b] for a in (-1, 0, 1) for b in (-1, 0, 1) if (x + a, y + b) in at]
            if peak[m] > 0.0 and peak[m] >= max(peak[n] for n in around):
                maxima.append((float(x), float(y), float(angles[best[m]]), float(peak[m])))
    taken: list[tuple[float, float, float, float]] = []
    for each in sorted(maxima, key=lambda one: -one[3]):
        close = [np.hypot(each[0] - t[0], each[1] - t[1]) < spacing and _alike(each[2], t[2]) for t in taken]
        if not any(close):
            taken.append(each)
    return taken[:count]


def _alike(one: float, other: float) -> bool:
    apart = abs(one - other) % (2.0 * np.pi)
    return min(apart, 2.0 * np.pi - apart) < 0.5
