"""The edge of a round wall beside the packing, from a circle drawn by hand near it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates

from solver.bodies.grains import Array

from ...experiment.photographs import Image
from .inner_edge import BLUR, NARROWEST, OUTLIER, PASSES, SPACING, STEP, peak_between

TRIPLES = 300  # circles through three edges, of which the one that most agree with is begun with
LEAST = 12  # profiles that must see an edge
STRONG = 0.3  # of the strongest slopes: what is an edge
SEEN = 0.34  # share of the profiles that must agree


def snap_to_rim(
    image: Image, circle: tuple[float, float, float], reach: float, *, inside: bool
) -> tuple[tuple[float, float, float], float]:
    """Move a circle x, y, radius [px] onto the wall's edge beside it, no farther than reach [px].

    inside: the packing is within the circle. The edge is where the bright wall ends towards the dark between the rods,
    as along a bar. Gives the circle, and the share of the profiles within the picture that agree with it: it stays as
    it was drawn where that is below a third.
    """
    x, y, radius = circle
    smooth = gaussian_filter(np.asarray(image, np.float32), BLUR)
    turn = np.linspace(0.0, 2.0 * np.pi, max(int(2.0 * np.pi * radius / SPACING), 60), endpoint=False)
    out = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    here = np.array([x, y]) + radius * out
    within = (here >= reach).all(axis=1) & (here[:, 0] < image.shape[1] - reach) & (here[:, 1] < image.shape[0] - reach)
    out = out[within]
    if len(out) < LEAST:
        return circle, 0.0
    offset = np.arange(-reach, reach + STEP, STEP)  # of the radius
    points = np.array([x, y]) + (radius + offset[None, :, None]) * out[:, None]
    profile = map_coordinates(smooth, [points[..., 1], points[..., 0]], order=1, mode="nearest")
    slope = np.gradient(profile, STEP, axis=1) * (1.0 if inside else -1.0)  # bright is the wall
    model = np.column_stack([np.ones(len(out)), out])  # a larger circle, and a shifted one
    fit, window, share = np.zeros(3), reach, 0.0
    for k in range(PASSES):
        expected = model @ fit
        weighed = np.where(np.abs(offset[None] - expected[:, None]) <= window, slope, 0.0)
        best, strength = weighed.argmax(axis=1), weighed.max(axis=1)
        found = offset[best] + peak_between(weighed, best) * STEP
        strong = strength > STRONG * np.percentile(strength, 90)
        if strong.sum() < LEAST:
            return circle, 0.0
        if k == 0:
            fit = _consensus(model[strong], found[strong])
        agree = strong & (np.abs(found - model @ fit) < OUTLIER)
        share = float(agree.mean()) if k == 0 else share  # in the narrow windows that follow noise agrees, too
        if agree.sum() >= LEAST:
            fit = np.linalg.lstsq(model[agree], found[agree], rcond=None)[0]
        window = max(window / 2.5, NARROWEST)
    if share < SEEN:
        return circle, share
    return (x + float(fit[1]), y + float(fit[2]), radius + float(fit[0])), share


def _consensus(model: Array, found: Array) -> NDArray:
    """The circle that most edges lie on, of many through three of them."""
    rng = np.random.default_rng(0)
    best, most = np.zeros(3), -1
    for _ in range(TRIPLES):
        rows = rng.choice(len(found), 3, replace=False)
        if abs(np.linalg.det(model[rows])) < 1e-3:
            continue
        tried = np.linalg.solve(model[rows], found[rows])
        agree = int((np.abs(found - model @ tried) < OUTLIER).sum())
        if agree > most:
            best, most = tried, agree
    return best
