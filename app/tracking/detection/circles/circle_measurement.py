"""Measurement of circles in a photograph: roughly by their steepest points, closely by the rim's fitted profile."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from ....experiment.pictures.image import Image
from ....solver.bodies.grains import Array
from ....solver.parallel import available_cores, parallel_map
from ...correlation.noise import image_noise
from ...correlation.splines import spline_coefficients
from ..rings import local_contrast, tile_size
from .circle_kernels import DARK_HALF, SMALL, measure_circles, measure_closely, see_edges
from .edges import DENSITY, Outline, trace_outline
from .rim_profile import locate_edges

# Greatest difference between the level beyond an edge and the darkest around the grain, as a fraction of the contrast:
# where grains nearly touch, the gap's dark is not reached, which shifts an edge but does not invalidate it.
DARK_EXCESS = 0.12
DARK_EXCESS_JUDGED = 0.3
# Least contrast, in standard deviations of the noise.
NOISE_CONTRAST = 12.0
# Least number of points of a circle. For a small one this fraction of its rays suffices, but at least the second
# number; the next two hold for plain grains. The last is the least fraction of a grain's outline in view.
MIN_POINTS = 12
MIN_RAY_FRACTION, MIN_POINTS_SMALL = 0.3, 8
MIN_FRACTION_PLAIN, MIN_POINTS_PLAIN = 0.2, 6
MIN_VIEW = 0.35
# The fraction of a small circle: at the photograph's border, the bright part of a larger object looks like one.
MIN_VIEW_SMALL = 0.75

CIRCLES_PER_THREAD = 64  # least number of circles of a thread

# Widths of the blur that are tried [px], and the one assumed without outlines.
BLUR_WIDTHS = np.arange(0.3, 2.2, 0.3)
BLUR_STEPS = np.array([-0.3, -0.2, -0.1, 0.0, 0.1, 0.2, 0.3])
TYPICAL_BLUR = 0.7
# Width of the blur [px] that first chooses the fitted part of a ray; the estimate is repeated with its own width.
BLUR_EXTENT = 1.0
BLUR_ROUNDS = 2
BLURRED_GRAINS = 60  # whose profiles are fitted


Kernel = Callable[..., None]


@dataclass(frozen=True, slots=True)
class MeasuredCircle:
    """One circle."""

    x: float  # [px]
    y: float  # [px]
    radius: float  # [px]
    sigma: float  # [px] standard deviation of a component of the centre, NaN where it was not measured
    quality: float  # fraction of the outline in view with an edge on the circle

    @property
    def circle(self) -> tuple[float, float, float]:
        return self.x, self.y, self.radius


class CircleMeasurer:
    """Measures circles in one photograph."""

    def __init__(self, image: Image, radius: float) -> None:
        """Prepare a photograph whose largest grain has `radius` [px], which sets the scale of local contrast."""
        # Whether the grains are plain bright discs, without paint that could be mistaken for an edge.
        self.plain = False
        self._image = image
        self._coefficients = spline_coefficients(image)
        # An edge must exceed the noise as well, or an empty photograph is full of edges.
        self._dark, contrast = local_contrast(image, tile_size(radius))
        least = np.float64(NOISE_CONTRAST * image_noise(image))  # of one type, or kernels are compiled for another
        self._contrast = np.maximum(contrast, least)

    @cached_property
    def level(self) -> Image:
        """Relative light of every pixel (H, W): 0 at the local dark, 1 at the local bright level."""
        return np.asarray((self._image - self._dark) / self._contrast, dtype=np.float32)

    def narrow(self, radius: float) -> bool:
        """Return whether gaps around a circle of a radius [px] may be narrower than two pixels.

        An outline between neighbours may then be too short for a fit of its single rays.
        """
        return self.plain or radius <= SMALL

    def measure(self, rough: Array) -> Array:
        """Fit circles through the steepest points near rough ones.

        Parameters
        ----------
        rough : (c, 6) array
            x, y, radius [px]; half width of the window about radius + shift [px]; that shift [px]; standard deviation
            of the radius [px], infinite: it is free.

        Returns
        -------
        (c, 5) array
            x, y, radius, sigma, quality as in `MeasuredCircle`; NaN and 0 where there is no circle.
        """
        return self._in_parts(measure_circles, rough, DARK_HALF if self.plain else DARK_EXCESS_JUDGED)

    def measure_closely(self, rough: Array, width: float) -> Array:
        """Fit circles through the edges that the fitted profile of the rim gives.

        Parameters
        ----------
        rough : (c, 5) array
            x, y, radius [px]; excess of the edges' radius over the grain's [px]; standard deviation of the radius [px],
            infinite: it is free.
        width : float
            Width of the blur [px].

        Returns
        -------
        (c, 5) array
            As from `measure`.
        """
        return self._in_parts(measure_closely, rough, DARK_EXCESS, width)

    def _in_parts(self, kernel: Kernel, rough: Array, excess: float, *further: float) -> Array:
        """Measure circles on all cores; excess: greatest one of the dark, as a fraction of the contrast."""
        found, rules = np.empty((len(rough), 5)), self._rules(rough[:, 2], excess)

        def some(part: NDArray[np.intp]) -> None:
            if len(part):
                rows = slice(part[0], part[-1] + 1)
                kernel(self._coefficients, self._dark, self._contrast, rough[rows], rules[rows], *further, found[rows])

        parts = np.array_split(np.arange(len(rough)), max(min(available_cores(), len(rough) // CIRCLES_PER_THREAD), 1))
        parallel_map([partial(some, part) for part in parts], None)
        return found

    def _rules(self, radius: Array, excess: float) -> Array:
        """The rules of `measure_circles` (c, 6) for circles of radii (c,)."""
        small, count = radius <= SMALL, len(radius)
        fraction, fewest = self._min_seen()
        return np.column_stack([
            np.full(count, excess), small | self.plain, np.full(count, fraction), np.full(count, fewest),
            np.full(count, MIN_POINTS), np.where(small & (not self.plain), MIN_VIEW_SMALL, MIN_VIEW),
        ])  # fmt: skip

    def estimate_blur(self, circles: Sequence[MeasuredCircle]) -> float:
        """Estimate the width of the photograph's blur [px]: that with the best fits of the profiles of some grains."""
        good = [one for one in circles if one.quality > 0.0]
        good = good[:: max(len(good) // BLURRED_GRAINS, 1)]
        outlines = []
        for one in good:
            outline = trace_outline(self._coefficients, *one.circle, 2.0, narrow=self.narrow(one.radius))
            outlines.append((outline, self._edges(outline, one.x, one.y, DARK_EXCESS)[0]))
        if sum(int(seen.sum()) for _, seen in outlines) < MIN_POINTS:
            return TYPICAL_BLUR
        width = _best_width(outlines, BLUR_WIDTHS, BLUR_EXTENT)
        for _ in range(BLUR_ROUNDS):
            width = _best_width(outlines, width + BLUR_STEPS, width)
        return width

    def _edges(self, outline: Outline, x: float, y: float, excess: float) -> tuple[NDArray[np.bool_], float]:
        """The rays that meet an edge, and the local contrast [grey]."""
        seen = np.zeros(len(outline.angle), np.bool_)
        local = see_edges(outline.edges, self._dark, self._contrast, x, y, excess, seen)
        return seen, local

    def _min_seen(self) -> tuple[float, int]:
        """Least fraction and number of the rays that must meet an edge."""
        return (MIN_FRACTION_PLAIN, MIN_POINTS_PLAIN) if self.plain else (MIN_RAY_FRACTION, MIN_POINTS_SMALL)


def _best_width(outlines: list[tuple[Outline, NDArray[np.bool_]]], widths: Array, extent: float) -> float:
    # A ray without a fit is an infinite misfit; otherwise the widest blur would be best with the few rays it fits.
    total = np.full(len(widths), np.inf)
    for k, width in enumerate(widths):
        if not width > 0.2:
            continue
        misfits = parallel_map([partial(_misfits, *one, float(width), extent) for one in outlines], None)
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
    """Misfit of a profile of this width on each ray that meets an edge."""
    return _fit_profiles(outline, seen, width, extent)[2][seen]


def _fit_profiles(
    outline: Outline, seen: NDArray[np.bool_], width: float, extent: float
) -> tuple[Array, Array, Array, Array]:
    start = np.where(seen, outline.distance, np.nan)
    return locate_edges(outline.rays, (outline.first, 1.0 / DENSITY), start, outline.angle, width, extent=extent)
