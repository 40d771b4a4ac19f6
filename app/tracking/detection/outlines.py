"""Measure one circle after another in a photograph: its edges, and the circle through them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array

from ...experiment.photographs import Image
from ..correlation.noise import image_noise
from ..correlation.splines import spline_coefficients
from .edges import DENSITY, Circle, Outline, fit_circle, trace_outline
from .rim_profile import locate_edges
from .rings import local_contrast, tile_size

# An edge is one where the light falls by this share of the local contrast per pixel,
EDGE_SLOPE = 0.08
# to a level that exceeds the darkest met around the grain by no more than this share: where grains nearly
# touch, the gap's dark is not reached, which shifts an edge but does not make it less of one.
DARK_EXCESS = 0.12
DARK_EXCESS_JUDGED = 0.3
# What is brighter than this share of the way from the dark about a grain to its light is paint, not a gap.
DARK_HALF = 0.5
# Contrast below this many standard deviations of the noise [1] is none.
NOISE_CONTRAST = 12.0
# A circle that has left the window in which its points were looked for, by this many times, is none of theirs.
ASTRAY = 2.5
# Points this close to the circle [px] count as its outline.
ON_CIRCLE = 0.7
# Fewer points do not make a circle (of a small one this share of its rays will do, but no fewer than that;
# the other two where grains are plain); less
# of the outline in view does not make a grain.
LEAST_POINTS = 12
LEAST_SHARE, FEWEST_POINTS = 0.3, 8
PLAIN_SHARE, PLAIN_FEWEST = 0.2, 6
LEAST_VIEW = 0.35
# A small circle is none if its points lie on one side: a chipped rim has as many. Half a circle's have 0.64.
ONE_SIDED = 0.55
# And more of it must be in view: the light part of something larger looks like one where the picture ends.
LEAST_VIEW_SMALL = 0.75

# The radius [px] of a small circle.
SMALL = 12.0

# Widths of the blur that are tried [px], and the one assumed where no outline tells.
BLUR_WIDTHS = np.arange(0.3, 2.2, 0.3)
BLUR_STEPS = np.array([-0.3, -0.2, -0.1, 0.0, 0.1, 0.2, 0.3])
TYPICAL_BLUR = 0.7
# The estimate begins with what a blur of this width [px] would show of a ray, and is repeated with its own.
BLUR_EXTENT = 1.0
BLUR_ROUNDS = 2

# What the model of the rim leaves of its shading's effect on the centre, in parts of what it takes out.
SHADING_LEFT = 1.2


@dataclass(frozen=True, slots=True)
class Measured:
    """One circle."""

    x: float  # [px]
    y: float  # [px]
    radius: float  # [px]
    sigma: float  # [px] standard deviation of a component of the centre, NaN where it was not measured
    quality: float  # share of the outline in view that is seen as an edge on the circle

    @property
    def circle(self) -> tuple[float, float, float]:
        return self.x, self.y, self.radius


class Outliner:
    """Measures circles in one photograph."""

    def __init__(self, image: Image, radius: float) -> None:
        """radius [px]: of the largest grain, for the size of what counts as local."""
        # Whether the grains are plain bright discs: nothing painted on them can then be mistaken for an edge.
        self.plain = False
        self._image = image
        self._coefficients = spline_coefficients(image)
        # An edge must stand out from the noise too, or a photograph of nothing is full of edges.
        self._dark, contrast = local_contrast(image, tile_size(radius))
        self._contrast = np.maximum(contrast, NOISE_CONTRAST * image_noise(image))

    def level(self) -> Image:
        """Light of every pixel (H, W): 0 where it is the dark about it, 1 where it is the bright."""
        return np.asarray((self._image - self._dark) / self._contrast, dtype=np.float32)

    def narrow(self, radius: float) -> bool:
        """Whether gaps about a circle of that radius [px] may be narrower than two pixels.

        An outline between neighbours may then be too short for its rays to be fitted one by one.
        """
        return self.plain or radius <= SMALL

    def measure(self, x: float, y: float, radius: float, window: float, shift: float, scatter: float) -> Measured:
        """The circle through the steepest points within `window` [px] of radius + shift [px].

        scatter [px]: by how much the radius may differ; infinite: it is free.
        """
        outline = trace_outline(self._coefficients, x, y, radius + shift, window, narrow=self.narrow(radius))
        seen, local = self._edges(outline, x, y, DARK_HALF if self.plain else DARK_EXCESS_JUDGED)
        if seen.sum() < self._least_points(outline) or outline.in_view.mean() < self._least_view(radius):
            return Measured(x, y, radius, np.nan, 0.0)
        circle = fit_circle(
            x, y, radius + shift, outline.angle[seen], outline.distance[seen],
            np.minimum(outline.strength[seen] / (0.3 * local), 1.0) ** 2, radius_scatter=scatter, scale_least=0.1,
        )  # fmt: skip
        moved = np.hypot(circle.x - x, circle.y - y) + abs(circle.radius - radius - shift)
        if not moved < ASTRAY * window:
            return Measured(x, y, radius, np.nan, 0.0)
        if radius <= SMALL and _one_sidedness(circle, outline.angle[seen]) > ONE_SIDED:
            return Measured(x, y, radius, np.nan, 0.0)
        return _measured(circle, outline, shift)

    def measure_closely(
        self, x: float, y: float, radius: float, width: float, shift: float, scatter: float
    ) -> Measured:
        """The circle through edges from the fitted profile of the rim, blurred by `width` [px]."""
        outline = trace_outline(self._coefficients, x, y, radius + shift, 2.0, narrow=self.narrow(radius))
        seen, local = self._edges(outline, x, y, DARK_EXCESS)
        if seen.sum() < self._least_points(outline) or outline.in_view.mean() < self._least_view(radius):
            return Measured(x, y, radius, np.nan, 0.0)
        steepest = fit_circle(
            x, y, radius + shift, outline.angle[seen], outline.distance[seen],
            np.minimum(outline.strength[seen] / (0.3 * local), 1.0) ** 2, radius_scatter=np.inf, scale_least=0.1,
        )  # fmt: skip
        edge, level, _, dark = _fit_profiles(outline, seen, width, width)
        good = np.isfinite(edge)
        if good.sum() < self._least_points(outline):
            return Measured(x, y, radius, np.nan, 0.0)
        excess = (dark[good] - np.percentile(dark[good], 10.0)) / (DARK_EXCESS * local)
        weight = (np.minimum(level[good] / (0.6 * local), 1.0) * np.clip(1.0 - excess, 0.05, 1.0)) ** 2
        circle = fit_circle(
            x, y, radius + shift, outline.angle[good], edge[good], weight, radius_scatter=scatter, scale_least=0.05
        )
        moved = np.hypot(circle.x - steepest.x, circle.y - steepest.y) / np.sqrt(2.0)
        found = _measured(circle, outline, shift)
        sigma = float(np.hypot(circle.sigma, SHADING_LEFT * moved))
        return Measured(found.x, found.y, found.radius, sigma, found.quality)

    def estimate_blur(self, circles: Sequence[Measured], *, most: int = 60) -> float:
        """Width of the photograph's blur [px]: the one with which the profiles of some grains fit best."""
        good = [one for one in circles if one.quality > 0.0]
        good = good[:: max(len(good) // most, 1)]
        outlines = []
        for one in good:
            outline = trace_outline(self._coefficients, *one.circle, 2.0, narrow=self.narrow(one.radius))
            outlines.append((outline, self._edges(outline, one.x, one.y, DARK_EXCESS)[0]))
        if sum(int(seen.sum()) for _, seen in outlines) < LEAST_POINTS:
            return TYPICAL_BLUR
        width = _best_width(outlines, BLUR_WIDTHS, BLUR_EXTENT)
        for _ in range(BLUR_ROUNDS):
            width = _best_width(outlines, width + BLUR_STEPS, width)
        return width

    def _edges(self, outline: Outline, x: float, y: float, excess: float) -> tuple[NDArray[np.bool_], float]:
        """Which rays meet an edge, and the local contrast [grey]."""
        height, width = self._contrast.shape
        place = min(max(int(y), 0), height - 1), min(max(int(x), 0), width - 1)
        local = float(self._contrast[place])
        seen = np.isfinite(outline.distance) & (outline.strength > EDGE_SLOPE * local)
        seen &= outline.beyond < float(self._dark[place]) + DARK_HALF * local
        if seen.any():
            # The tenth-darkest part, not the single darkest ray: noise makes that one.
            dark = float(np.percentile(outline.beyond[seen], 10.0))
            seen &= outline.beyond < dark + excess * local
        return seen, local

    def _least_view(self, radius: float) -> float:
        return LEAST_VIEW if self.plain or radius > SMALL else LEAST_VIEW_SMALL

    def _least_points(self, outline: Outline) -> int:
        share, fewest = (PLAIN_SHARE, PLAIN_FEWEST) if self.plain else (LEAST_SHARE, FEWEST_POINTS)
        return max(min(LEAST_POINTS, round(share * len(outline.angle))), fewest)


def _best_width(outlines: list[tuple[Outline, NDArray[np.bool_]]], widths: Array, extent: float) -> float:
    # A ray that cannot be fitted at all speaks against a width, or the widest would win with the few it fits.
    total = np.full(len(widths), np.inf)
    for k, width in enumerate(widths):
        if not width > 0.2:
            continue
        misfits = [_fit_profiles(outline, seen, width, extent)[2][seen] for outline, seen in outlines]
        total[k] = np.median(np.nan_to_num(np.concatenate(misfits), nan=np.inf))
    best = int(np.argmin(total))
    if not np.isfinite(total[best]):
        return TYPICAL_BLUR
    if not 0 < best < len(widths) - 1 or not np.isfinite(total[best - 1 : best + 2]).all():
        return float(widths[best])
    before, at, after = total[best - 1 : best + 2]
    step, bend = float(widths[1] - widths[0]), before - 2.0 * at + after
    return float(widths[best] + (0.5 * step * (before - after) / bend if bend > 0.0 else 0.0))


def _fit_profiles(
    outline: Outline, seen: NDArray[np.bool_], width: float, extent: float
) -> tuple[Array, Array, Array, Array]:
    start = np.where(seen, outline.distance, np.nan)
    return locate_edges(outline.rays, outline.first, 1.0 / DENSITY, start, outline.angle, width, extent=extent)


def _one_sidedness(circle: Circle, angle: Array) -> float:
    """How much the points on the circle lie on one side of it: 0 all about, 1 in one place."""
    on = angle[np.abs(circle.residual) < ON_CIRCLE]
    return float(np.hypot(np.cos(on).mean(), np.sin(on).mean())) if len(on) else 1.0


def _measured(circle: Circle, outline: Outline, shift: float) -> Measured:
    on = (np.abs(circle.residual) < ON_CIRCLE).sum()
    return Measured(circle.x, circle.y, circle.radius - shift, circle.sigma, float(on / outline.in_view.sum()))
