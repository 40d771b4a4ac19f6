"""Detection of a round wall's inner edge, from a circle drawn by hand near it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates

from ...experiment.pictures.image import Image
from ...solver.bodies.grains import Array
from .inner_edge import BLUR, OUTLIER, SPACING, STEP, subpixel_peak

PASSES = 6  # of the robust fit
MIN_WINDOW = 1.0  # [px] half width of the last searches
TRIPLES = 300  # circles through three edges, of which the one with most agreement is the first estimate
MIN_PROFILES = 12  # profiles that must contain an edge
STRONG_FRACTION = 0.3  # least slope of an edge, as a fraction of the strongest slopes
MIN_AGREEMENT = 0.34  # fraction of the profiles that must agree


def snap_to_rim(
    image: Image, circle: tuple[float, float, float], max_shift: float, *, inside: bool
) -> tuple[tuple[float, float, float], float]:
    """Move a circle onto the wall's edge near it.

    The edge is the transition from the bright wall to the dark between the rods, as along a bar.

    Parameters
    ----------
    image : (H, W) array
        The photograph [grey].
    circle : tuple
        x, y, radius [px].
    max_shift : float
        Greatest distance of the edge from the circle [px].
    inside : bool
        The packing is within the circle.

    Returns
    -------
    circle : tuple
        x, y, radius [px]; the given circle where less than a third of the profiles agree.
    fraction : float
        Fraction of the profiles within the photograph that agree with the circle.
    """
    x, y, radius = circle
    smooth = gaussian_filter(np.asarray(image, np.float32), BLUR)
    angle = np.linspace(0.0, 2.0 * np.pi, max(int(2.0 * np.pi * radius / SPACING), 60), endpoint=False)
    out = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    here = np.array([x, y]) + radius * out
    within = (here >= max_shift).all(axis=1)
    within &= (here[:, 0] < image.shape[1] - max_shift) & (here[:, 1] < image.shape[0] - max_shift)
    out = out[within]
    if len(out) < MIN_PROFILES:
        return circle, 0.0
    offset = np.arange(-max_shift, max_shift + STEP, STEP)  # of the radius
    points = np.array([x, y]) + (radius + offset[None, :, None]) * out[:, None]
    profile = map_coordinates(smooth, [points[..., 1], points[..., 0]], order=1, mode="nearest")
    slope = np.gradient(profile, STEP, axis=1) * (1.0 if inside else -1.0)  # the wall is bright
    model = np.column_stack([np.ones(len(out)), out])  # changes of the radius and of the centre
    fit, window, fraction = np.zeros(3), max_shift, 0.0
    for k in range(PASSES):
        expected = model @ fit
        slope_in_window = np.where(np.abs(offset[None] - expected[:, None]) <= window, slope, 0.0)
        best, strength = slope_in_window.argmax(axis=1), slope_in_window.max(axis=1)
        edge = offset[best] + subpixel_peak(slope_in_window, best) * STEP
        strong = strength > STRONG_FRACTION * np.percentile(strength, 90)
        if strong.sum() < MIN_PROFILES:
            return circle, 0.0
        if k == 0:
            fit = _consensus(model[strong], edge[strong])
        agree = strong & (np.abs(edge - model @ fit) < OUTLIER)
        fraction = float(agree.mean()) if k == 0 else fraction  # in the later, narrow windows noise agrees as well
        if agree.sum() >= MIN_PROFILES:
            fit = np.linalg.lstsq(model[agree], edge[agree], rcond=None)[0]
        window = max(window / 2.5, MIN_WINDOW)
    if fraction < MIN_AGREEMENT:
        return circle, fraction
    return (x + float(fit[1]), y + float(fit[2]), radius + float(fit[0])), fraction


def _consensus(model: Array, edge: Array) -> NDArray:
    """The circle with most edges on it, of many through three of them."""
    rng = np.random.default_rng(0)
    best, most = np.zeros(3), -1
    for _ in range(TRIPLES):
        rows = rng.choice(len(edge), 3, replace=False)
        if abs(np.linalg.det(model[rows])) < 1e-3:
            continue
        tried = np.linalg.solve(model[rows], edge[rows])
        agree = int((np.abs(edge - model @ tried) < OUTLIER).sum())
        if agree > most:
            best, most = tried, agree
    return best
