"""Find the grains of the first photograph: centre and radius to a part of a pixel.

Circles that might be grains are found by the slope along rings of every radius, then each is judged by
its own outline at full resolution: edges towards the dark between the grains, wherever there is dark.
Contacts have no edge and are passed over. What moves all edges alike (the blur's definition of an edge,
the mean shading of the rims) is measured over all grains and taken out where the radii are known, so that
an outline seen only on one side does not pull the centre.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from solver.bodies.grains import Array
from solver.together import available_cores, work_together

from ...experiment.photographs import Image
from .discs import OVERLAP, Discs, find_discs
from .outlines import TOGETHER, Measured, Outliner
from .rings import Circles, find_circles, without_overlap

# Rings leave the centre uncertain by this much [px], besides the difference of two classes' radii.
RING_UNCERTAINTY = 3.0
# Of a small circle they leave less, in parts of its radius.
SMALL_SHARE = 0.2

# Standard deviation of what a narrow gap makes of the steepest points' centre [px].
ROUGH_SIGMA = 0.15

# A centre less certain than this [px], and than this share of the radius, is none; nor is one of a small circle that is
# less certain than the other share.
SIGMA_MOST = 1.0
SIGMA_SHARE = 0.05
SIGMA_SHARE_SMALL = 0.1
# Looked at closely, this part of the outline asked for must still be seen: noise has none of it.
CLOSE_SHARE = 1.0 / 3.0

# Radii looked for when nothing is said about them [px], and the share of the picture's shorter side that is the most.
RADIUS_RANGE = (8.0, 160.0)
LARGEST_SHARE = 0.3

# Of bright discs, smaller ones are told apart from paint and noise, too [px].
SMALLEST = 4.0
# Discs that cover this share of a photograph's bright are its grains, each where this part of the outline asked for of
# others is seen;
CLEAN, CLEAN_QUALITY = 0.93, 0.6
# they must be lit as evenly as this, as a share of the contrast, or there is texture on them.
EVEN = 0.2
# Of the bright that found grains leave, this share: in a rest there is always some of no shape.
CLEAN_REST = 0.8
DISC_PASSES = 4
# When grains have taken all but this share of the bright, all are found.
BRIGHT_LEFT = 0.01

# Circles of unknown radius are known no better than the steps in which they were looked for.
SCAN_STEP = 1.06


@dataclass(frozen=True, slots=True)
class DetectionSettings:
    """What is known of the grains. Lengths in pixels."""

    radii: tuple[float, ...] = ()  # [px] the radius classes; empty: unknown
    radius_range: tuple[float, float] | None = None  # [px] searched when the classes are unknown; None: RADIUS_RANGE
    score_least: float = 0.15  # slope along a ring, as a share of a full edge, of a circle worth a look
    quality_least: float = 0.3  # share of a grain's outline that must be seen as an edge in its place

    def __post_init__(self) -> None:
        if any(not radius > 3.0 for radius in self.radii):
            raise ValueError(f"radii must exceed 3 px, not {self.radii}")
        if self.radius_range is not None and not 3.0 < self.radius_range[0] < self.radius_range[1]:
            raise ValueError(f"radius_range must ascend and exceed 3 px, not {self.radius_range}")


@dataclass(frozen=True, slots=True)
class Detection:
    """n grains of one photograph, from top to bottom."""

    x: Array  # (n,) [px] column
    y: Array  # (n,) [px] row, down
    radius: Array  # (n,) [px]; a class, where classes are known
    sigma: Array  # (n,) [px] standard deviation of a component of the centre
    quality: Array  # (n,) share of the outline in view that is seen as an edge, 0 … 1

    @property
    def count(self) -> int:
        return len(self.x)


def detect_grains(image: Image, settings: DetectionSettings | None = None) -> Detection:
    """Find the grains of a photograph (H, W)."""
    settings = settings if settings is not None else DetectionSettings()
    known = bool(settings.radii)
    radii = np.array(sorted(set(settings.radii))) if known else _scan(settings.radius_range or _usual_range(image))
    smallest = SMALLEST if settings.radius_range is None else settings.radius_range[0]
    outliner = Outliner(image, float(radii.max()))
    table, complete = np.empty((0, 4)), False
    whole = find_discs(outliner.level, table, min(smallest, SMALLEST)) if not known else None
    if whole is not None and whole.covered > CLEAN and whole.spread < EVEN:
        # Nothing is painted on the grains, so a little of an outline tells, and gaps may be as narrow as they like.
        outliner.plain = True
        first_discs = whole if smallest <= SMALLEST else None
        table, complete = _judge_discs(outliner, table, smallest, CLEAN_QUALITY * settings.quality_least, first_discs)
    if not complete:
        rough = find_circles(image, radii, score_least=settings.score_least)
        table = _judge(outliner, rough, table, known, settings.quality_least)
        count = len(table)
        if not known:
            # What is lost among rings of its neighbours' outlines, or smaller than was looked for.
            table, _ = _judge_discs(outliner, table, smallest, settings.quality_least)
        if len(table) > count and smallest < radii[0]:
            rough = find_circles(image, _scan((smallest, radii[0])), score_least=settings.score_least)
            table = _judge(outliner, rough, table, known, settings.quality_least)
    found = _refine(outliner, table[:, 0], table[:, 1], table[:, 2], fixed_radius=known)
    order = np.lexsort((found.x, found.y))
    # What cannot be measured closely is not a grain, or too little of it is in view.
    most = np.minimum(SIGMA_MOST, SIGMA_SHARE_SMALL * found.radius)
    good = found.sigma < np.maximum(most, SIGMA_SHARE * found.radius)
    good &= found.quality > CLOSE_SHARE * settings.quality_least
    if not known:
        good &= (found.radius > 0.9 * smallest) & (found.radius < 1.1 * radii[-1])
    order = order[good[order]]
    return Detection(found.x[order], found.y[order], found.radius[order], found.sigma[order], found.quality[order])


def refine_grains(image: Image, x: Array, y: Array, radius: Array, *, fixed_radius: bool = True) -> Detection:
    """Refine rough positions x, y (n,) [px], good to two pixels, of grains of radius (n,) [px].

    fixed_radius: the radii are true; else they are estimated too. Grains keep their order. A grain whose
    outline is not seen stays where it was, with quality 0 and sigma NaN.
    """
    x, y, radius = (np.asarray(value, dtype=np.float64) for value in (x, y, radius))
    if len(x) == 0:
        return Detection(x, y, radius, np.empty(0), np.empty(0))
    return _refine(Outliner(image, float(radius.max())), x, y, radius, fixed_radius=fixed_radius)


def _refine(outliner: Outliner, x: Array, y: Array, radius: Array, *, fixed_radius: bool) -> Detection:
    if len(x) == 0:
        return Detection(x, y, radius, np.empty(0), np.empty(0))
    window = np.minimum([_window(each, True) for each in radius], 2.0)
    first = [Measured(*one) for one in outliner.measure(_rough(x, y, radius, window, np.inf)).tolist()]
    width = outliner.estimate_blur(first)
    free = _each(
        len(x), lambda k: _closer(outliner, first[k], outliner.measure_closely(*first[k].circle, width, 0.0, np.inf))
    )
    if not fixed_radius:
        return _detection(free, np.array([one.radius for one in free]))
    excess = np.array([one.radius for one in free]) - radius
    shift = float(np.median(excess))
    # The rims' shading differs from grain to grain: their radii scatter about the common shift.
    scatter = max(1.4826 * float(np.median(np.abs(excess - shift))), 0.01)
    tied = _each(
        len(x),
        lambda k: _closer(
            outliner, free[k], outliner.measure_closely(free[k].x, free[k].y, radius[k], width, shift, scatter)
        ),
    )  # fmt: skip
    return _detection(tied, radius)


def _closer(outliner: Outliner, rough: Measured, close: Measured) -> Measured:
    """The close measurement; where narrow gaps leave too little for it, the rough one with what that leaves open."""
    if not np.isfinite(rough.sigma) or not outliner.narrow(rough.radius):
        return close
    sigma = float(np.hypot(rough.sigma, ROUGH_SIGMA))
    return close if close.sigma < sigma else replace(rough, sigma=sigma)


def _judge_discs(
    outliner: Outliner, table: Array, smallest: float, quality_least: float, first: Discs | None = None
) -> tuple[Array, bool]:
    """The table x, y, radius, quality (c, 4) with the discs that prove grains, in passes over what each leaves.

    Discs that leave much of the bright uncovered are not taken for grains. first: the discs of the first pass, where
    they are known. Returns also whether next to nothing of the bright is left.
    """
    level = outliner.level
    whole, left = 0.0, np.inf
    for k in range(DISC_PASSES + 1):
        discs = first if k == 0 and first is not None else find_discs(level, table, smallest)
        whole, left = max(whole, discs.area), discs.area
        if k == DISC_PASSES or len(discs.candidates.x) == 0 or discs.covered < CLEAN_REST:
            break
        count = len(table)
        table = _judge(outliner, discs.candidates, table, False, quality_least, OVERLAP)
        if len(table) <= count:
            break
    return table, left < BRIGHT_LEFT * whole


def _judge(
    outliner: Outliner, rough: Circles, table: Array, known: bool, quality_least: float, overlap: float = 0.15
) -> Array:
    """The table x, y, radius, quality (c, 4) with those candidates that prove grains and overlap no better one.

    overlap: the share of the smaller radius that is let pass.
    """
    unjudged = np.ones(len(rough.x), dtype=np.bool_)
    judged_circles = np.full((len(rough.x), 4), np.nan)  # x, y, radius, quality of those that were measured
    tree = KDTree(np.stack([rough.x, rough.y], axis=1)) if known and len(rough.x) else None
    while True:
        left = np.flatnonzero(unjudged)
        left = left[_apart(rough.x[left], rough.y[left], rough.radius[left], table, allowed=0.6)]
        if len(left) == 0:
            return table
        # What has struck out a true circle and then proved none itself makes room for another pass; so does
        # what a better circle strikes out later.
        chosen = left[without_overlap(rough.x[left], rough.y[left], rough.radius[left], allowed=0.6)]
        unjudged[chosen] = False
        if tree is not None:  # which is the grain is told by those of the other known radii about it
            chosen = np.concatenate([_around(rough, tree, k) for k in chosen])
        new = np.unique(chosen[np.isnan(judged_circles[chosen, 0])])
        judged_circles[new] = _measure(outliner, rough, new, known, quality_least)
        judged = judged_circles[chosen]
        table = np.concatenate([table, judged[judged[:, 3] > quality_least]])
        # A longer outline is the more significant at the same share.
        table = table[np.argsort(-table[:, 3] * np.sqrt(table[:, 2]), kind="stable")]
        table = table[without_overlap(table[:, 0], table[:, 1], table[:, 2], allowed=overlap)]


def _measure(outliner: Outliner, rough: Circles, rows: NDArray[np.intp], known: bool, quality_least: float) -> Array:
    """x, y, radius, quality (c, 4) of some of the rough circles."""
    size = rough.radius[rows]
    window = np.array([_window(each, known) for each in size])
    scatter = 0.3 if known else np.inf
    found = outliner.measure(_rough(rough.x[rows], rough.y[rows], size, window, scatter))
    if not known:
        return found[:, [0, 1, 2, 4]]
    quality = 2.0 * found[:, 4]
    # Now that it is centred, a narrower view keeps paint near the rim out of it. Alone it is too easily satisfied.
    again = np.flatnonzero(quality > quality_least)
    window = np.full(len(again), 0.5 * RING_UNCERTAINTY)
    found[again] = outliner.measure(_rough(found[again, 0], found[again, 1], size[again], window, scatter))
    quality[again] = np.minimum(found[again, 4], quality[again])
    return np.column_stack([found[:, :2], size, quality])


def _rough(x: Array, y: Array, radius: Array, window: Array, scatter: float) -> Array:
    """Rough circles (c, 6) as they are measured, without a shift of their edges."""
    return np.column_stack([x, y, radius, window, np.zeros(len(x)), np.full(len(x), scatter)])


def _around(rough: Circles, tree: KDTree, k: int) -> NDArray[np.intp]:
    """The most convincing circle of every radius about circle k."""
    widest = float(rough.radius.max() - rough.radius.min())
    near = np.sort(np.asarray(tree.query_ball_point([rough.x[k], rough.y[k]], widest + RING_UNCERTAINTY)))
    distance = np.hypot(rough.x[near] - rough.x[k], rough.y[near] - rough.y[k])
    near = near[distance <= np.abs(rough.radius[near] - rough.radius[k]) + RING_UNCERTAINTY]
    # They are in the order of their score: the first of every radius is its best.
    _, first = np.unique(rough.radius[near], return_index=True)
    return near[np.sort(first)]


def _window(radius: float, known: bool) -> float:
    """How far from a rough circle its edges are looked for [px]: a small grain's neighbours are never far."""
    window = min(RING_UNCERTAINTY, max(SMALL_SHARE * radius, 0.5 * RING_UNCERTAINTY))
    return window if known else max(window, 0.6 * (SCAN_STEP - 1.0) * radius)


def _apart(x: Array, y: Array, radius: Array, found: Array, *, allowed: float) -> NDArray[np.bool_]:
    """Which circles do not overlap what has been found, x, y, radius, … (c, 4), by more than the share allowed."""
    if len(found) == 0 or len(x) == 0:
        return np.ones(len(x), dtype=np.bool_)
    tree, apart = KDTree(found[:, :2]), np.ones(len(x), dtype=np.bool_)
    for count in (1, min(8, len(found))):  # most overlap the nearest one already
        rows = np.flatnonzero(apart)
        nearest = tree.query(np.stack([x[rows], y[rows]], axis=1), k=count)
        distance, index = (np.reshape(each, (len(rows), count)) for each in nearest)
        size, other = radius[rows, None], found[index, 2]
        apart[rows] = (distance >= size + other - allowed * np.minimum(size, other)).all(axis=1)
    return apart


def _each(count: int, one: Callable[[int], Measured]) -> list[Measured]:
    """What is measured of each grain, on all cores."""
    parts = np.array_split(np.arange(count), max(min(available_cores(), count // TOGETHER), 1))

    def some(part: NDArray[np.intp]) -> list[Measured]:
        return [one(k) for k in part.tolist()]

    found = work_together([partial(some, part) for part in parts], None)
    return [each for part in found for each in part]


def _detection(measured: list[Measured], radius: Array) -> Detection:
    def column(name: str) -> Array:
        return np.array([getattr(one, name) for one in measured], dtype=np.float64)

    return Detection(column("x"), column("y"), radius, column("sigma"), column("quality"))


def _usual_range(image: Image) -> tuple[float, float]:
    low, high = RADIUS_RANGE
    return low, max(min(high, LARGEST_SHARE * min(image.shape)), 1.5 * low)


def _scan(limits: tuple[float, float]) -> Array:
    steps = int(np.ceil(np.log(limits[1] / limits[0]) / np.log(SCAN_STEP)))
    return np.geomspace(limits[0], limits[1], steps + 1)
