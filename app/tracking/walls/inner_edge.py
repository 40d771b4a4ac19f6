"""The inner edge of a bar, found near a line that was drawn by hand, touched by rods or seen a photograph earlier."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates

from ...experiment.pictures.image import Image
from ...solver.bodies.grains import Array
from ...solver.even_subset import even_subset
from ...solver.robust_scale import NORMAL_MEDIAN

BLUR = 1.5  # [px] standard deviation of the smoothing: paint is finer than a bar
SPACING = 3.0  # [px] between profiles along a line
STEP = 0.25  # [px] along a profile
OUTLIER = 2.0  # [px] distance from the line beyond which an edge belongs to something else: a rod, paint
MOST_CHANCE = 0.9  # of the fraction that agrees by chance, over a short search
MIN_SLOPE = 0.3  # of an edge, over the strongest slopes
BORDER = 6.0  # [px] beside the profiles that their smoothing needs
CENTRED = 3.5  # [px] half width of the slopes whose centre is the edge
CENTRED_PASSES = 5
MAX_SDS, LEAST_CUT = 2.0, 0.5  # standard deviations and [px] beyond which a centre is that of something else
MIN_CONTRAST = 0.5  # of an edge that is measured, over the strongest ones: between rods the bar borders on the dark
MIN_PROFILES = 4
ENDS = np.array([[1.0, -0.5], [1.0, 0.5]])  # offsets of a line's ends by that of its middle and their difference
LEAST_SEEN = 0.34  # fraction of the profiles that must agree


@dataclass(frozen=True, slots=True)
class Edge:
    """The edge of a bar in one photograph."""

    line: Array  # (2, 2) its points beside the ends of the given line [px]; that line where there is no edge
    fraction: float  # of the profiles that agree with it, beyond those that would by chance
    sigma: Array  # (2,) standard deviations of its ends along the normal [px]
    contrast: float  # [grey] between the bar and the dark inside, where rods do not hide it

    @property
    def is_seen(self) -> bool:
        """Whether enough of the profiles agree: noise and the rims of rods do not."""
        return self.fraction >= LEAST_SEEN and self.contrast > 0.0


def find_edge(image: Image, line: Array, max_shift: float) -> Edge:
    """Find the edge of a bar near a line.

    The packing lies on the left of the line in the world, y up. The edge is the innermost transition from the bright
    bar to the dark between the rods.

    Parameters
    ----------
    image : (H, W) array
        The photograph [grey].
    line : (2, 2) array
        End points x, y [px].
    max_shift : float
        Greatest distance of the edge from the line [px].

    Notes
    -----
    A line through the greatest slopes of profiles across the edge is found by consensus. The edge of each profile near
    it is then the centre of its slopes, Σ s x / Σ s, which no pixel attracts as the greatest slope is. The errors of
    profiles beside each other depend on one another: their number counts over 1 + 2 Σ ρ, ρ the correlation of the
    residuals until it first vanishes.
    """
    given = np.asarray(line, np.float64)
    margin = max_shift + CENTRED + OUTLIER + BORDER
    corner = np.maximum(np.floor(given.min(axis=0) - margin), 0.0).astype(np.int64)
    stop = np.maximum(np.ceil(given.max(axis=0) + margin).astype(np.int64) + 1, 0)
    part = np.asarray(image[corner[1] : stop[1], corner[0] : stop[0]], np.float32)
    none = Edge(given, 0.0, np.full(2, np.nan), 0.0)
    if not part.size:
        return none
    smooth: Array = gaussian_filter(part, BLUR)
    count = max(int(np.linalg.norm(given[1] - given[0]) / SPACING), 8)
    place = np.linspace(0.02, 0.98, count) - 0.5  # along the line, over its length
    offset, slope = _slopes(smooth, given - corner, place, max_shift)
    best, strength = slope.argmax(axis=1), slope.max(axis=1)
    edge = offset[best] + subpixel_peak(slope, best) * STEP
    strong = strength > MIN_SLOPE * np.percentile(strength, 90)
    if strong.sum() < MIN_PROFILES:
        return none
    fit = _most_agreed(place[strong], edge[strong])
    agree = float((strong & (np.abs(edge - fit[0] - fit[1] * place) < OUTLIER)).mean())
    chance = min(OUTLIER / max_shift, MOST_CHANCE)
    fraction = max(agree - chance, 0.0) / (1.0 - chance)
    rough = move_inward(given, ENDS @ fit)
    offset, slope = _slopes(smooth, rough - corner, place, CENTRED + OUTLIER)
    fit, sigma, contrast = _centre(place, offset, np.maximum(slope, 0.0))
    return Edge(move_inward(rough, ENDS @ fit), fraction, sigma, contrast)


def _slopes(smooth: Array, line: Array, place: Array, reach: float) -> tuple[Array, Array]:
    """Slopes (p, o) of profiles across a line at offsets (o,) [px] towards the packing; the bar is bright."""
    offset = np.arange(-reach, reach + STEP, STEP)
    middle = line.mean(axis=0) + place[:, None] * (line[1] - line[0])
    points = middle[:, None] + offset[None, :, None] * inward_normal(line)
    profile = map_coordinates(smooth, [points[..., 1], points[..., 0]], order=1, mode="nearest")
    return offset, -np.gradient(profile, STEP, axis=1)


def inward_normal(line: Array) -> Array:
    """Unit normal (2,) of a line (2, 2) [px], y down, towards its left in the world."""
    along = line[1] - line[0]
    return np.array([along[1], -along[0]]) / max(float(np.hypot(*along)), 1e-9)


def move_inward(line: Array, by: Array) -> Array:
    """Move the ends of a line (2, 2) towards the packing by two distances (2,) [px]."""
    return np.asarray(line + by[:, None] * inward_normal(line))


def _centre(place: Array, offset: Array, slope: Array) -> tuple[Array, Array, float]:
    """Fit the line through the centres of slopes (p, o) near offset 0; also return its ends' sd, and the contrast."""
    fit, sigma, median = np.zeros(2), np.full(2, np.nan), 0.0
    for _ in range(CENTRED_PASSES):
        expected = fit[0] + fit[1] * place
        away = offset[None] - expected[:, None]
        weight = np.where(np.abs(away) <= CENTRED, slope, 0.0)
        contrast = STEP * weight.sum(axis=1)
        shift = STEP * (weight * away).sum(axis=1) / np.where(contrast > 0.0, contrast, 1.0)
        seen = contrast > MIN_CONTRAST * np.percentile(contrast, 90)
        spread = np.median(np.abs(shift[seen])) / NORMAL_MEDIAN  # about the last line
        seen &= np.abs(shift) < min(max(MAX_SDS * float(spread), LEAST_CUT), OUTLIER)
        if seen.sum() < MIN_PROFILES:
            return fit, sigma, 0.0
        median = float(np.median(contrast[seen]))
        design = np.column_stack([np.ones(int(seen.sum())), place[seen]])
        change, *_ = np.linalg.lstsq(design, shift[seen])
        fit = fit + change
        residual = shift[seen] - design @ change
        variance = float(residual @ residual) / max(len(residual) - 2, 1) * _correlated_count(residual)
        sigma = np.sqrt(variance * np.einsum("ea,ab,eb->e", ENDS, np.linalg.inv(design.T @ design), ENDS))
    return fit, sigma, median


def _correlated_count(residual: Array) -> float:
    """Number of consecutive residuals that count as one: 1 + 2 Σ ρ until the correlation ρ first vanishes."""
    total = float(residual @ residual)
    count = 1.0
    for lag in range(1, len(residual) // 4):
        rho = float(residual[lag:] @ residual[:-lag]) / total if total > 0.0 else 0.0
        if rho <= 0.0:
            break
        count += 2.0 * rho
    return count


def subpixel_peak(slope: Array, at: NDArray[np.intp]) -> Array:
    """Return the offsets (p,) of the greatest slopes from their steps, by the parabola through three points."""
    rows = np.arange(len(at))
    middle = np.clip(at, 1, slope.shape[1] - 2)
    left, here, right = (slope[rows, middle + k] for k in (-1, 0, 1))
    bend = left - 2.0 * here + right
    return np.where((bend < 0.0) & (middle == at), 0.5 * (left - right) / np.where(bend < 0.0, bend, -1.0), 0.0)


def _most_agreed(x: Array, y: Array) -> Array:
    """Offset and slope of the line through two points that is near most points."""
    few = even_subset(len(x), 40)
    i, j = np.triu_indices(len(few), 1)
    a, b = few[i], few[j]
    slope = (y[b] - y[a]) / np.where(x[b] != x[a], x[b] - x[a], 1.0)
    offset = y[a] - slope * x[a]
    agree = (np.abs(y[None] - offset[:, None] - slope[:, None] * x[None]) < OUTLIER).sum(axis=1)
    best = int(agree.argmax())
    return np.array([offset[best], slope[best]])
