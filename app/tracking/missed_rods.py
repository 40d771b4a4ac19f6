"""Rods that were not found in a photograph: wide places between those found that look as these do.

What a packing lacks among its rods is a hole, or a rod that detection missed. A rod that is missed looks like the
others, a hole like the narrow pores between them. Where pores look like rods, as between photoelastic discs on a dark
ground, the two cannot be distinguished.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ..experiment.experiment import Experiment, GrainGuess
from ..experiment.photographs import Photographs
from ..experiment.pictures.image import Image, ImageSelection
from ..experiment.plausibility import neighbour_spacing, rim_points
from ..solver.bodies.grains import Array
from ..solver.boundary.size_classes import find_common_sizes
from ..solver.even_subset import even_subset
from ..solver.robust_scale import SD_OVER_MAD
from .detection.appearance import INSIDE, appearance
from .detection.detect import MIN_RADIUS, Detection, DetectionSettings, MissedGrainSearch, detect_grains
from .detection.judge_circles import TOUCHING
from .detection.rings import beside

SMALLEST = 0.05  # quantile of the radii below which nothing is looked for
FITS = 0.85  # of the smallest radius: a place so wide may hold a rod that others hide in part
DRAWN = 10.0  # [px] of the smallest radius in the picture in which distances are measured
RIM_POINTS = 32  # of a disc, for the area that all enclose
PORE = 0.12, 0.5  # of the smallest radius: widths of the pores that are compared …
NARROWEST = 3.0  # [px] … and at least
INSIDE_PORE = 0.7  # of a radius: the part of a pore that is looked at
MOST, MOST_PORES = 50, 400  # places and pores
ALIKE = 4.0  # robust standard deviations of brightness and contrast within which a place looks like a rod
LEAST_SD = np.array([3.0, 0.1])  # of brightness [grey] and of the logarithm of the contrast
UNDECIDED = 0.5  # fraction of the pores that look like rods beyond which nothing is reported
FEWEST = 5  # rods, and pores
# Parts of the area of all circles that the smallest ones may have, fraction of a radius below which circles are smaller
# than the others, and their least number over that of all: dots of paint in rods that were missed are many, but small.
SMALL_AREA, SMALLER, MANY = (0.3, 0.15, 0.05), 0.85, 0.02
# Standard deviation within circles over the contrast of the photograph, below which they are plain; of so many of them.
PLAIN, LOOKED_AT = 0.1, 200
LARGER = 1.5  # greatest radius that is looked for instead, over the largest found
WIDE_RIMS = 0.03  # of the sum of two radii: soft discs overlap by less under any load
ROUNDS = 8  # of the search: every rod that is found shows the places beside it better


def detect_rods(image: Image, settings: DetectionSettings | None = None) -> Detection:
    """Detect the rods of a photograph, and those that were missed at first.

    Parameters
    ----------
    image : (H, W)
        The photograph [grey].
    settings : DetectionSettings, optional

    Notes
    -----
    Where radii are unknown and many circles are small, as dots of coarse paint, larger ones are looked for as well: of
    both detections the one counts that covers more area.

    Near places that look like rods, circles of the known sizes are searched for once more at full resolution: on a
    shrunk copy coarse paint hides the rims. They must pass the tests of all others and look like rods. Unknown sizes
    are those of nearly all rods that were found; without distinct sizes nothing is added. Circles of other sizes may
    be paint: those that a rod of these sizes covers are left out, unless the rods are plain.

    The rims of thick discs show their sides as well. Where neighbours would overlap by `WIDE_RIMS` by their rims, all
    radii are reduced until they touch.
    """
    settings = settings if settings is not None else DetectionSettings()
    found = detect_grains(image, settings)
    if settings.radii:
        return _with_missed(image, found, settings, plain=False)
    plain = _are_plain(image, found)
    found = found if plain else _prefer_larger(image, found, settings)
    return _reduced_to_touch(_with_missed(image, found, settings, plain=plain))


def _reduced_to_touch(found: Detection) -> Detection:
    """Reduce radii by one factor until neighbours touch, where their outlines overlap by far."""
    spacing = neighbour_spacing(np.column_stack([found.x, found.y]), found.radius)
    middle = float(np.median(spacing)) if len(spacing) >= FEWEST else 1.0
    return replace(found, radius=found.radius * middle) if middle < 1.0 - WIDE_RIMS else found


def _with_missed(image: Image, found: Detection, settings: DetectionSettings, *, plain: bool) -> Detection:
    """Add the rods that were missed, and leave out circles that may be their paint."""
    search: MissedGrainSearch | None = None
    radii, odd = _sizes(found.radius, settings)
    if len(radii) == 0:
        return found
    odd &= not plain
    found, others = found.select(~odd), found.select(odd)
    for _ in range(ROUNDS):
        places = find_missed_rods(image, found.x, found.y, found.radius)
        if len(places) == 0:
            break
        search = MissedGrainSearch(image, radii, settings) if search is None else search
        new = search.find_near(found, places[:, :2])
        looks = _looks_of(image, _circles(found))
        assert looks is not None  # of too few rods there are no places
        new = new.select(_are_alike(image, _circles(new), INSIDE, looks))
        if new.count == 0:
            break
        found = found.join(new)
    return found.join(others.select(beside(_circles(others), _circles(found), allowed=TOUCHING)))


def _are_plain(image: Image, found: Detection) -> bool:
    """Whether the circles bear no paint, which could look like circles itself."""
    look = appearance(image, _circles(found)[even_subset(found.count, LOOKED_AT)], INSIDE)[:, 1]
    dark, bright = np.percentile(image, [3.0, 95.0])
    return bool(np.nanmedian(np.append(np.expm1(look), np.inf)) < PLAIN * (bright - dark)) if found.count else True


def _prefer_larger(image: Image, found: Detection, settings: DetectionSettings) -> Detection:
    """Detect again without the small circles as long as the others then cover more area: the small ones were paint."""
    for _ in range(ROUNDS):
        larger = _find_larger(image, found, settings)
        if larger is None:
            break
        found = larger
    return found


def _find_larger(image: Image, found: Detection, settings: DetectionSettings) -> Detection | None:
    """Detect without circles that have some part of the area; None: no part without which the others cover more."""
    radius = np.sort(found.radius)
    area = np.cumsum(radius**2)
    parts = SMALL_AREA if len(radius) >= FEWEST else ()
    smallest = [SMALLER * float(radius[np.searchsorted(area, part * area[-1])]) for part in parts]
    low, high = settings.radius_range or (MIN_RADIUS, np.inf)
    for least in dict.fromkeys(smallest):
        if least > low and (radius < least).mean() >= MANY:
            ends = least, min(LARGER * float(radius[-1]), high)
            larger = detect_grains(image, replace(settings, radius_range=ends))
            if float(np.sum(larger.radius**2)) > area[-1]:
                return larger
    return None


def _circles(found: Detection) -> Array:
    return np.column_stack([found.x, found.y, found.radius])


def _sizes(radius: Array, settings: DetectionSettings) -> tuple[Array, NDArray[np.bool_]]:
    """Return the sizes (k,), none without distinct ones, and the rods (n,) of another size, which may be paint."""
    common = (np.array(settings.radii), np.zeros(len(radius), np.bool_)) if settings.radii else None
    common = find_common_sizes(radius) if common is None else common
    return (np.empty(0), np.zeros(len(radius), np.bool_)) if common is None else common


def describe_missed_rods(experiment: Experiment, rods: GrainGuess) -> list[str]:
    """Return a sentence about the rods that a first photograph shows beside the given ones; none where it shows none.

    Raises
    ------
    InputError
        If the photograph cannot be read.
    """
    section = experiment.config.photographs
    assert section is not None
    file = experiment.photographs().files[0]
    stat = file.stat()
    given = np.array([rods.x, rods.y, rods.radius], np.float64).tobytes()
    places = _missed_of_file(
        file, stat.st_mtime_ns, stat.st_size, section.max_pixels, experiment.selection(file), given
    )
    if not places:
        return []
    (x, y), count = places[0], len(places)
    least = "At least " if count == MOST else ""
    subject = "1 place looks like a rod" if count == 1 else f"{least}{count} places look like rods"
    return [
        f"{subject} between the others and {'was' if count == 1 else 'were'} not found, the widest at column {x:.0f}, "
        f"row {y:.0f}: mark what is missing, give the known radii, or try another channel."
    ]


@lru_cache(maxsize=4)
def _missed_of_file(
    file: Path, _changed: int, _size: int, max_pixels: int, selection: ImageSelection, given: bytes
) -> list[tuple[float, float]]:
    """Columns and rows of the missed rods; a photograph is read once as long as it and the rods are the same."""
    image = Photographs([file], max_pixels=max_pixels, selection=selection)[0]
    return [(x, y) for x, y, _ in find_missed_rods(image, *np.frombuffer(given).reshape(3, -1)).tolist()]


def find_missed_rods(image: Image, x: Array, y: Array, radius: Array) -> Array:
    """Find places that look like rods that were not found.

    Parameters
    ----------
    image : (H, W)
        The photograph [grey].
    x, y, radius : (n,)
        The rods that were found [px].

    Returns
    -------
    (m, 3)
        x, y and radius of the widest disc [px] at every such place, the widest first; none where pores look like rods,
        and at most 50.

    Notes
    -----
    Places lie in the convex hull of the rods. A place looks like a rod where the mean grey level within .8 of its
    radius and the logarithm of its standard deviation are both within four robust standard deviations of those of the
    rods.
    """
    if len(radius) < FEWEST:
        return np.empty((0, 3))
    rods = np.column_stack([x, y, radius])
    smallest = float(np.quantile(radius, SMALLEST))
    free, scale, corner = _free_area(rods, smallest)
    pores = _find_pores(free, scale, corner, smallest)
    places = _find_places(free, scale, corner, smallest, float(radius.max()))
    if len(places) == 0 or len(pores) < FEWEST:
        return np.empty((0, 3))
    looks = _looks_of(image, rods)
    if looks is None or _are_alike(image, pores, INSIDE_PORE, looks).mean() > UNDECIDED:
        return np.empty((0, 3))
    return places[_are_alike(image, places, INSIDE, looks)]


def _looks_of(image: Image, rods: Array) -> tuple[Array, Array] | None:
    """Return median and robust standard deviation (2,) of the appearance of rods (n, 3); None of too few."""
    look = appearance(image, rods, INSIDE)
    look = look[np.isfinite(look).all(axis=1)]
    if len(look) < FEWEST:
        return None
    middle = np.median(look, axis=0)
    return middle, SD_OVER_MAD * np.median(np.abs(look - middle), axis=0) + LEAST_SD


def _are_alike(image: Image, discs: Array, part: float, looks: tuple[Array, Array]) -> NDArray[np.bool_]:
    """Mark the discs (n, 3) a part of which looks as rods do."""
    middle, sd = looks
    away = np.abs(appearance(image, discs, part) - middle) / sd
    return np.nan_to_num(away, nan=np.inf).max(axis=1, initial=0.0) < ALIKE


def _free_area(rods: Array, smallest: float) -> tuple[NDArray[np.uint8], float, Array]:
    """Draw the area between the rods (h, w), not zero where it is free; pixels per pixel, and the corner [px]."""
    rims = rim_points(rods[:, :2], rods[:, 2], RIM_POINTS)
    scale = min(DRAWN / smallest, 1.0)
    # A margin: the transform measures distances to pixels that are not free, not to the border of the picture.
    corner, far = rims.min(axis=0) - 3.0 / scale, rims.max(axis=0) + 3.0 / scale
    width, height = np.ceil((far - corner) * scale).astype(int) + 1
    free = np.zeros((height, width), np.uint8)
    hull = cv2.convexHull(((rims - corner) * scale).astype(np.float32))
    cv2.fillConvexPoly(free, np.rint(hull).astype(np.int32), 255)
    for px, py, r in np.column_stack([(rods[:, :2] - corner) * scale, rods[:, 2] * scale]):
        cv2.circle(free, (round(px), round(py)), round(r), 0, cv2.FILLED)
    return free, scale, corner


def _find_places(free: NDArray[np.uint8], scale: float, corner: Array, smallest: float, largest: float) -> Array:
    """Places (m, 3) where a rod fits [px], one after the other, the widest first."""
    left, found = free.copy(), []
    while len(found) < MOST:
        distance = cv2.distanceTransform(left, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        row, column = np.unravel_index(int(distance.argmax()), distance.shape)
        radius = float(distance[row, column]) / scale
        if radius < FITS * smallest:
            break
        radius = min(radius, largest)
        found.append((column / scale + corner[0], row / scale + corner[1], radius))
        cv2.circle(left, (int(column), int(row)), max(round(radius * scale), 1), 0, cv2.FILLED)
    return np.array(found).reshape(-1, 3)


def _find_pores(free: NDArray[np.uint8], scale: float, corner: Array, smallest: float) -> Array:
    """Widest discs (m, 3) in the narrow pores [px]."""
    distance = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    radius = distance / scale
    low, high = PORE[0] * smallest, PORE[1] * smallest
    highest = (distance == cv2.dilate(distance, np.ones((3, 3), np.uint8))) & (radius < high)
    row, column = np.nonzero(highest & (radius >= max(low, NARROWEST)))
    chosen = even_subset(len(row), MOST_PORES)
    row, column = row[chosen], column[chosen]
    place = np.column_stack([column, row]) / scale + corner
    return np.column_stack([place, radius[row, column].astype(np.float64)])
