"""Detection of the grains of the first photograph: centre and radius with subpixel accuracy.

Candidate circles are found by the slope along rings of every radius. Each is then tested by its own outline at full
resolution: edges towards the dark between the grains, wherever there is dark. Contacts have no edge and are ignored.
The common displacement of all edges (the blur's definition of an edge, the mean shading of the rims) is measured over
all grains and removed where the radii are known, so that an outline seen on one side does not bias the centre.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ...experiment.pictures.image import Image
from ...solver.bodies.grains import Array
from ...solver.robust_scale import SD_OVER_MAD
from ..correlation.edge_width import SharpCopy, sharpest_copy
from .circles.circle_measurement import CircleMeasurer, MeasuredCircle
from .discs import find_discs
from .faint_grains import CLEAR, find_faint_grains
from .judge_circles import CLEAN_QUALITY, TOUCHING, judge_circles, judge_discs, rough_circles, search_window
from .rings import beside, find_circles, radius_steps

ROUGH_SIGMA = 0.15  # [px] standard deviation of the error that a narrow gap adds to the steepest points' centre

# Greatest standard deviation of a centre [px], or as a fraction of the radius, of any circle and of a small one.
MAX_SIGMA = 1.0
MAX_RELATIVE_SIGMA = 0.05
MAX_RELATIVE_SIGMA_SMALL = 0.1
# Least quality after the close measurement, as a fraction of the least quality before: of noise it is zero.
CLOSE_FRACTION = 1.0 / 3.0

# Default range of the radii [px], and the largest as a fraction of the photograph's shorter side.
RADIUS_RANGE = (8.0, 160.0)
LARGEST_FRACTION = 0.3

MIN_RADIUS = 4.0  # [px] least default one of bright discs, which at smaller sizes are like paint and noise
# Discs that cover this fraction of a photograph's bright area are its grains.
CLEAN_COVER = 0.93
MAX_LIGHT_RANGE = 0.2  # greatest range of the light on such discs, as a fraction of the contrast: more is texture

LEAST_ON_COPY = 8.0  # [px] least radius on a copy of a soft photograph: smaller ones are not shrunk any further

# Fraction of an outline that is seen of a circle that may be accidental, of which noise shows a third, and the least
# number of clear circles by which such a one is judged.
FAINT, FEWEST_CLEAR = 0.35, 20

# Search for missed grains: least slope along a ring at full resolution, where coarse paint shows no slope on a shrunk
# copy; greatest overlap of such a ring with a found grain before it is measured, as a fraction of the smaller radius;
# distance of its centre from a place [radii]; found grains by which blur and shading of the rims are known; greatest
# relative difference of a measured radius from the size.
FINE_SCORE, FINE_OVERLAP, NEAR_PLACE, REFERENCE_GRAINS, SAME_SIZE = 0.08, 0.1, 3.0, 60, 0.05


@dataclass(frozen=True, slots=True)
class DetectionSettings:
    """Known properties of the grains, and thresholds. Lengths in pixels."""

    radii: tuple[float, ...] = ()  # [px] the radius classes; empty: unknown
    radius_range: tuple[float, float] | None = None  # [px] searched when the classes are unknown; None: RADIUS_RANGE
    min_score: float = 0.15  # least slope along a ring of a candidate, as a fraction of a full edge
    min_quality: float = 0.3  # least fraction of a grain's outline with an edge on the circle

    def __post_init__(self) -> None:
        if any(not radius > 3.0 for radius in self.radii):
            listed = ", ".join(f"{radius:.3g}" for radius in self.radii)
            raise ValueError(f"are {listed} px at this pixel_size, but must exceed 3 px: correct one of both")
        if self.radius_range is not None and not 3.0 < self.radius_range[0] < self.radius_range[1]:
            raise ValueError(f"radius_range must ascend and exceed 3 px, not {self.radius_range}")


@dataclass(frozen=True, slots=True)
class Detection:
    """n grains of one photograph, from top to bottom."""

    x: Array  # (n,) [px] column
    y: Array  # (n,) [px] row, down
    radius: Array  # (n,) [px]; a class, where classes are known
    sigma: Array  # (n,) [px] standard deviation of a component of the centre
    quality: Array  # (n,) fraction of the outline in view with an edge on the circle

    @property
    def count(self) -> int:
        return len(self.x)

    @property
    def seen_area(self) -> float:
        """Area of the grains over π, weighted by the visible part of their outlines [px²]."""
        return float(self.quality @ self.radius**2)

    def select(self, rows: NDArray[np.bool_] | NDArray[np.intp]) -> Detection:
        """Return some of the grains, or all in another order."""
        return Detection(self.x[rows], self.y[rows], self.radius[rows], self.sigma[rows], self.quality[rows])

    def join(self, other: Detection) -> Detection:
        """Return these grains and others, from top to bottom."""
        both = [np.concatenate([getattr(each, name) for each in (self, other)]) for name in self.__slots__]
        order = np.lexsort((both[0], both[1]))
        return Detection(*(column[order] for column in both))


def detect_grains(image: Image, settings: DetectionSettings | None = None) -> Detection:
    """Find the grains of a photograph (H, W) [grey]; where its edges are soft, on a copy where they are sharp."""
    settings = settings if settings is not None else DetectionSettings()
    copy = sharpest_copy(image, _most_shrunk(settings))
    return _on_photograph(_detect(copy.image, _for_copy(settings, copy.factor)), copy, settings.radii)


def _most_shrunk(settings: DetectionSettings) -> float:
    """Return the greatest factor by which a photograph may be shrunk; the default range is one of the copy."""
    if settings.radii:
        return min(settings.radii) / LEAST_ON_COPY
    return np.inf if settings.radius_range is None else settings.radius_range[0] / MIN_RADIUS


def _for_copy(settings: DetectionSettings, factor: float) -> DetectionSettings:
    if factor == 1.0:
        return settings
    ends = settings.radius_range
    return replace(
        settings,
        radii=tuple(radius / factor for radius in settings.radii),
        radius_range=None if ends is None else (ends[0] / factor, ends[1] / factor),
    )


def _on_photograph(found: Detection, copy: SharpCopy, classes: tuple[float, ...] = ()) -> Detection:
    """Convert what was found on a copy; known radii keep their exact values."""
    if copy.factor == 1.0:
        return found
    x, y = copy.from_copy(found.x, found.y)
    radius, known = copy.factor * found.radius, np.array(sorted(classes))
    if len(known) and found.count:
        radius = known[np.abs(known[:, None] - radius).argmin(axis=0)]
    return Detection(x, y, radius, copy.factor * found.sigma, found.quality)


def _detect(image: Image, settings: DetectionSettings) -> Detection:
    known = bool(settings.radii)
    radii = (
        np.array(sorted(set(settings.radii))) if known else radius_steps(settings.radius_range or _default_range(image))
    )
    smallest = MIN_RADIUS if settings.radius_range is None else settings.radius_range[0]
    measurer = CircleMeasurer(image, float(radii.max()))
    table, complete = np.empty((0, 4)), False
    whole = find_discs(measurer.level, table, min(smallest, MIN_RADIUS)) if not known else None
    if whole is not None and whole.covered > CLEAN_COVER and whole.light_range < MAX_LIGHT_RANGE:
        # Without paint a small part of an outline suffices, and gaps may be arbitrarily narrow.
        measurer.plain = True
        first_discs = whole if smallest <= MIN_RADIUS else None
        table, complete = judge_discs(measurer, table, smallest, CLEAN_QUALITY * settings.min_quality, first_discs)
    if not complete:
        rough = find_circles(image, radii, min_score=settings.min_score)
        table = judge_circles(measurer, rough, table, known, settings.min_quality)
        count = len(table)
        if not known:
            # Grains that were hidden by rings of their neighbours' outlines, or smaller than the range.
            table, _ = judge_discs(measurer, table, smallest, settings.min_quality)
        if len(table) > count and smallest < radii[0]:
            rough = find_circles(image, radius_steps((smallest, radii[0])), min_score=settings.min_score)
            table = judge_circles(measurer, rough, table, known, settings.min_quality)
        least = settings.min_score, settings.min_quality
        measurer, table = find_faint_grains(image, measurer, table, settings.radii, least)
    found = _refine(measurer, table[:, 0], table[:, 1], table[:, 2], fixed_radius=known)
    order = np.lexsort((found.x, found.y))
    good = _measured_closely(found, settings.min_quality)
    if not known:
        good &= (found.radius > 0.9 * smallest) & (found.radius < 1.1 * radii[-1])
        good &= ~_accidental(found.radius, found.quality, good)
    return found.select(order[good[order]])


def _measured_closely(found: Detection, min_quality: float) -> NDArray[np.bool_]:
    """Mark circles (n,) that could be measured closely: others are no grains, or too little of them is in view."""
    most = np.minimum(MAX_SIGMA, MAX_RELATIVE_SIGMA_SMALL * found.radius)
    good = found.sigma < np.maximum(most, MAX_RELATIVE_SIGMA * found.radius)
    return good & (found.quality > CLOSE_FRACTION * min_quality)


def _accidental(radius: Array, quality: Array, good: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mark circles (n,) of which as little is seen as of accidental ones, and whose size no clear circle has.

    The paint of a bar has such circles. Where few circles are clear, nothing is marked.
    """
    clear = good & (quality > CLEAR)
    if clear.sum() < FEWEST_CLEAR:
        return np.zeros(len(radius), np.bool_)
    same_size = (radius > 0.9 * radius[clear].min()) & (radius < 1.1 * radius[clear].max())
    return (quality < FAINT) & ~same_size


class MissedGrainSearch:
    """Search at full resolution for grains of known sizes that the search of `detect_grains` missed."""

    def __init__(self, image: Image, radii: Array, settings: DetectionSettings) -> None:
        """Prepare a photograph (H, W) [grey] for grains of radii (k,) [px], which are exact where settings hold any."""
        self._settings, self._radii = settings, radii
        self._copy = sharpest_copy(image, float(radii.min()) / LEAST_ON_COPY)
        sizes = np.unique(radii) / self._copy.factor
        self._rough = find_circles(self._copy.image, sizes, min_score=FINE_SCORE, finest=True)
        self._measurer = CircleMeasurer(self._copy.image, float(sizes.max()))

    def find_near(self, found: Detection, places: Array) -> Detection:
        """Find grains within three radii of places (m, 2) [px] that pass the tests of `detect_grains` beside others."""
        least, copy, rough = self._settings.min_quality, self._copy, self._rough
        old = np.column_stack([*copy.to_copy(found.x, found.y), found.radius / copy.factor])
        away = KDTree(np.column_stack(copy.to_copy(*places.T))).query(np.column_stack([rough.x, rough.y]))[0]
        near = rough.select(away < NEAR_PLACE * rough.radius)
        near = near.select(beside(np.column_stack([near.x, near.y, near.radius]), old, allowed=FINE_OVERLAP))
        table = judge_circles(self._measurer, near, np.empty((0, 4)), True, least)
        table = table[beside(table[:, :3], old, allowed=TOUCHING)]
        reference = old[:: max(len(old) // REFERENCE_GRAINS, 1)]
        both = np.concatenate([table[:, :3], reference]) if len(table) else table[:, :3]
        refined = _refine(self._measurer, *both.T, fixed_radius=bool(self._settings.radii))
        good = _measured_closely(refined, least) & (np.arange(refined.count) < len(table))
        good &= np.abs(refined.radius / np.maximum(both[:, 2], 1.0) - 1.0) < SAME_SIZE
        return _on_photograph(refined.select(good), copy, self._settings.radii)


def refine_grains(image: Image, x: Array, y: Array, radius: Array, *, fixed_radius: bool = True) -> Detection:
    """Refine rough circles.

    Parameters
    ----------
    image : (H, W) array
        The photograph [grey].
    x, y : (n,) array
        Positions accurate to two pixels [px].
    radius : (n,) array
        Radii [px].
    fixed_radius : bool
        The radii are exact; else they are estimated as well.

    Returns
    -------
    Detection
        The grains in the given order. A grain whose outline is not detected keeps its position, with quality 0 and
        sigma NaN.
    """
    x, y, radius = (np.asarray(value, dtype=np.float64) for value in (x, y, radius))
    if len(x) == 0:
        return Detection(x, y, radius, np.empty(0), np.empty(0))
    copy = sharpest_copy(image, float(radius.min()) / LEAST_ON_COPY)
    rough = *copy.to_copy(x, y), radius / copy.factor
    measurer = CircleMeasurer(copy.image, float(rough[2].max()))
    found = _on_photograph(_refine(measurer, *rough, fixed_radius=fixed_radius), copy)
    return replace(found, radius=radius) if fixed_radius else found


def _refine(measurer: CircleMeasurer, x: Array, y: Array, radius: Array, *, fixed_radius: bool) -> Detection:
    if len(x) == 0:
        return Detection(x, y, radius, np.empty(0), np.empty(0))
    window = np.minimum([search_window(each, True) for each in radius], 2.0)
    first = [MeasuredCircle(*one) for one in measurer.measure(rough_circles(x, y, radius, window, np.inf)).tolist()]
    width = measurer.estimate_blur(first)
    rough = np.array([(*one.circle, one.sigma, one.quality) for one in first])
    free = _better(measurer, rough, measurer.measure_closely(_close(rough, 0.0, np.inf), width))
    if not fixed_radius:
        return Detection(free[:, 0], free[:, 1], free[:, 2], free[:, 3], free[:, 4])
    excess = free[:, 2] - radius
    shift = float(np.median(excess))
    # The rims' shading differs from grain to grain, so their radii deviate from the common shift.
    radius_sd = max(SD_OVER_MAD * float(np.median(np.abs(excess - shift))), 0.01)
    known = np.column_stack([free[:, :2], radius])
    tied = _better(measurer, free, measurer.measure_closely(_close(known, shift, radius_sd), width))
    return Detection(tied[:, 0], tied[:, 1], radius, tied[:, 3], tied[:, 4])


def _close(circles: Array, shift: float, radius_sd: float) -> Array:
    """Rough circles (c, 5) for `CircleMeasurer.measure_closely`."""
    return np.column_stack([circles[:, :3], np.full(len(circles), shift), np.full(len(circles), radius_sd)])


def _better(measurer: CircleMeasurer, rough: Array, close: Array) -> Array:
    """The close measurements (c, 5), or with narrow gaps the rough one if it has the smaller standard deviation."""
    sigma = np.hypot(rough[:, 3], ROUGH_SIGMA)
    narrow = np.array([measurer.narrow(each) for each in rough[:, 2].tolist()], dtype=np.bool_)
    rougher = np.isfinite(rough[:, 3]) & narrow & ~(close[:, 3] < sigma)
    return np.where(rougher[:, None], np.column_stack([rough[:, :3], sigma, rough[:, 4]]), close)


def _default_range(image: Image) -> tuple[float, float]:
    low, high = RADIUS_RANGE
    return low, max(min(high, LARGEST_FRACTION * min(image.shape)), 1.5 * low)
