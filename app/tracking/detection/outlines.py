"""Measure one circle after another in a photograph: its edges, and the circle through them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.together import available_cores, work_together

from ...experiment.photographs import Image
from ..correlation.noise import image_noise
from ..correlation.splines import spline_coefficients
from .circle_kernels import DARK_HALF, ON_CIRCLE, SMALL, SURE_SLOPE, lowest_tenth, measure_circles, see_edges
from .edges import DENSITY, Circle, Outline, fit_circle, trace_outline
from .rim_profile import locate_edges
from .rings import local_contrast, tile_size

# The level beyond an edge exceeds the darkest met around the grain by no more than this share of the contrast: where
# grains nearly touch, the gap's dark is not reached, which shifts an edge but does not make it less of one.
DARK_EXCESS = 0.12
DARK_EXCESS_JUDGED = 0.3
# Contrast below this many standard deviations of the noise [1] is none.
NOISE_CONTRAST = 12.0
# Fewer points do not make a circle (of a small one this share of its rays will do, but no fewer than that;
# the other two where grains are plain); less
# of the outline in view does not make a grain.
LEAST_POINTS = 12
LEAST_SHARE, FEWEST_POINTS = 0.3, 8
PLAIN_SHARE, PLAIN_FEWEST = 0.2, 6
LEAST_VIEW = 0.35
# Of a small circle more must be in view: the light part of something larger looks like one where the picture ends.
LEAST_VIEW_SMALL = 0.75

TOGETHER = 64  # circles at least that are worth a thread of their own

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

    @cached_property
    def level(self) -> Image:
        """Light of every pixel (H, W): 0 where it is the dark about it, 1 where it is the bright."""
        return np.asarray((self._image - self._dark) / self._contrast, dtype=np.float32)

    def narrow(self, radius: float) -> bool:
        """Whether gaps about a circle of that radius [px] may be narrower than two pixels.

        An outline between neighbours may then be too short for its rays to be fitted one by one.
        """
        return self.plain or radius <= SMALL

    def measure(self, rough: Array) -> Array:
        """The circles through the steepest points about rough ones (c, 6).

        rough: x, y, radius [px]; the window [px] about radius + shift; that shift [px]; by how much the radius may
        differ [px], infinite: it is free. Returns x, y, radius, sigma, quality (c, 5) as in `Measured`; NaN and 0
        where there is no circle.
        """
        found = np.empty((len(rough), 5))
        radius = rough[:, 2]
        small, count = radius <= SMALL, len(rough)
        share, fewest = self._least_seen()
        rules = np.column_stack([
            np.full(count, DARK_HALF if self.plain else DARK_EXCESS_JUDGED), small | self.plain, np.full(count, share),
            np.full(count, fewest), np.full(count, LEAST_POINTS),
            np.where(small & (not self.plain), LEAST_VIEW_SMALL, LEAST_VIEW),
        ])  # fmt: skip
        parts = np.array_split(np.arange(count), max(min(available_cores(), count // TOGETHER), 1))
        work_together([partial(self._measure, rough, rules, found, part) for part in parts], None)
        return found

    def _measure(self, rough: Array, rules: Array, found: Array, part: NDArray[np.intp]) -> None:
        if len(part):
            rows = slice(part[0], part[-1] + 1)
            measure_circles(self._coefficients, self._dark, self._contrast, rough[rows], rules[rows], found[rows])

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
            np.minimum(outline.strength[seen] / (SURE_SLOPE * local), 1.0) ** 2, radius_scatter=np.inf, scale_least=0.1,
        )  # fmt: skip
        edge, level, _, dark = _fit_profiles(outline, seen, width, width)
        good = np.isfinite(edge)
        if good.sum() < self._least_points(outline):
            return Measured(x, y, radius, np.nan, 0.0)
        excess = (dark[good] - lowest_tenth(dark[good])) / (DARK_EXCESS * local)
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
        seen = np.zeros(len(outline.angle), np.bool_)
        local = see_edges(outline.edges, self._dark, self._contrast, x, y, excess, seen)
        return seen, local

    def _least_view(self, radius: float) -> float:
        return LEAST_VIEW if self.plain or radius > SMALL else LEAST_VIEW_SMALL

    def _least_points(self, outline: Outline) -> int:
        share, fewest = self._least_seen()
        return max(min(LEAST_POINTS, round(share * len(outline.angle))), fewest)

    def _least_seen(self) -> tuple[float, int]:
        """Share and least number of the rays that must see an edge."""
        return (PLAIN_SHARE, PLAIN_FEWEST) if self.plain else (LEAST_SHARE, FEWEST_POINTS)


def _best_width(outlines: list[tuple[Outline, NDArray[np.bool_]]], widths: Array, extent: float) -> float:
    # A ray that cannot be fitted at all speaks against a width, or the widest would win with the few it fits.
    total = np.full(len(widths), np.inf)
    for k, width in enumerate(widths):
        if not width > 0.2:
            continue
        misfits = work_together([partial(_misfits, *one, float(width), extent) for one in outlines], None)
        total[k] = np.median(np.nan_to_num(np.concatenate(misfits), nan=np.inf))
    best = int(np.argmin(total))
    if not np.isfinite(total[best]):
        return TYPICAL_BLUR
    if not 0 < best < len(widths) - 1 or not np.isfinite(total[best - 1 : best + 2]).all():
        return float(widths[best])
    before, at, after = total[best - 1 : best + 2]
    step, bend = float(widths[1] - widths[0]), before - 2.0 * at + after
    return float(widths[best] + (0.5 * step * (before - after) / bend if bend > 0.0 else 0.0))


def _misfits(outline: Outline, seen: NDArray[np.bool_], width: float, extent: float) -> Array:
    """How badly each ray that sees an edge is fitted by a profile of this width."""
    return _fit_profiles(outline, seen, width, extent)[2][seen]


def _fit_profiles(
    outline: Outline, seen: NDArray[np.bool_], width: float, extent: float
) -> tuple[Array, Array, Array, Array]:
    start = np.where(seen, outline.distance, np.nan)
    return locate_edges(outline.rays, outline.first, 1.0 / DENSITY, start, outline.angle, width, extent=extent)


def _measured(circle: Circle, outline: Outline, shift: float) -> Measured:
    on = (np.abs(circle.residual) < ON_CIRCLE).sum()
    return Measured(circle.x, circle.y, circle.radius - shift, circle.sigma, float(on / outline.in_view.sum()))
