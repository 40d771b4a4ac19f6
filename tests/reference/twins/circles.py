"""One circle measured in plain numpy, twin of `app/tracking/detection/circles/circle_kernels.py`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from rodsight.experiment.pictures.image import Image
from rodsight.solver.bodies.grains import Array
from rodsight.tracking.detection.circles.edges import fit_circle, trace_outline


class FittedCircle(NamedTuple):
    """A circle through edge points [px]."""

    x: float
    y: float
    radius: float
    sigma: float
    residual: Array


def fitted_circle(rough, angle, distance, weight, *, radius_sd, min_scale) -> FittedCircle:
    """The compiled fit about a rough circle x, y, radius."""
    x, y, radius = rough
    shift, sigma, residual = fit_circle(angle, distance, weight, radius, radius_sd, min_scale)
    return FittedCircle(x + shift[0], y + shift[1], radius + shift[2], sigma, residual)


def measured(coefficients: Image, dark: Image, contrast: Image, rough: Array, rules: Array) -> list[float]:
    """x, y, radius, sigma, quality of the circle about x, y, radius, window, shift, scatter (6,)."""
    x, y, radius, window, shift, scatter = rough
    excess, narrow, share, fewest, enough, least_view = rules
    none = [x, y, radius, np.nan, 0.0]
    outline = trace_outline(coefficients, x, y, radius + shift, window, narrow=narrow == 1.0)
    height, width = contrast.shape
    place = min(max(int(y), 0), height - 1), min(max(int(x), 0), width - 1)
    local, beyond = float(contrast[place]), outline.edges[:, 2].astype(np.float32)
    seen = np.isfinite(outline.distance) & (outline.strength > 0.08 * local)
    seen &= beyond < float(dark[place]) + 0.5 * local
    if seen.any():
        seen &= beyond < float(np.percentile(beyond[seen], 10.0)) + excess * local
    if seen.sum() < max(min(enough, round(share * len(seen))), fewest) or outline.in_view.mean() < least_view:
        return none
    angle, distance = outline.angle[seen], outline.distance[seen]
    weight = np.minimum(outline.strength[seen] / (0.3 * local), 1.0) ** 2
    circle = fitted_circle((x, y, radius + shift), angle, distance, weight, radius_sd=scatter, min_scale=0.1)
    moved = np.hypot(circle.x - x, circle.y - y) + abs(circle.radius - radius - shift)
    if not moved < 2.5 * window:
        return none
    on = np.abs(circle.residual) < 0.7
    if radius <= 12.0 and (not on.any() or abs(np.exp(1j * angle[on]).mean()) > 0.55):
        return none
    return [circle.x, circle.y, circle.radius - shift, circle.sigma, float(on.sum() / outline.in_view.sum())]
