"""The circle of a grain near one that a person has drawn or clicked."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...experiment.pictures.image import Image
from .detect import DetectionSettings, detect_grains, refine_grains

Circle = tuple[float, float, float]  # x, y, radius [px]

AROUND = 3.0  # [radii] about a clicked grain in which its rim is searched
SEEN = 0.2  # fraction of an outline of any radius that is seen, at least
DRAWN = 1.3  # greatest ratio of the drawn radius and that of the rim, or its inverse
BESIDE = 0.5  # [radii] between the click and the middle of the grain
SMALLEST = 3.5  # [px] radius that is looked for


def fit_clicked(image: Image, drawn: Circle, sizes: Sequence[float] = ()) -> Circle | None:
    """Fit the circle of a grain to its visible rim.

    Parameters
    ----------
    image : (H, W)
        The photograph [grey].
    drawn : tuple of float
        Centre and radius as drawn [px].
    sizes : sequence of float
        Radii that the grain can have [px]; empty: about the drawn one.

    Returns
    -------
    tuple of float, or None
        Centre and radius [px]; None where no rim is seen. A circle drawn by hand can miss the rim by more than the
        refinement corrects, above all on a large photograph: it is then detected around the click.
    """
    x, y = drawn[:2]
    radius = min(drawn[2], float(max(image.shape)))
    around = AROUND * max([radius, *sizes])
    left, top = (max(int(each - around), 0) for each in (x, y))
    part = image[top : int(y + around) + 1, left : int(x + around) + 1]
    if min(part.shape) < 2:
        return None
    here = x - left, y - top, radius
    refined = _refined(part, here, sizes) if sizes else _refined_freely(part, here)
    fitted = refined or _detected(part, here, sizes)
    if fitted is not None and refined is None and not sizes:
        fitted = _refined_freely(part, fitted) or fitted
    return None if fitted is None else (fitted[0] + left, fitted[1] + top, fitted[2])


def _refined(image: Image, drawn: Circle, sizes: Sequence[float]) -> Circle | None:
    x, y, _ = drawn
    tried = [refine_grains(image, np.array([x]), np.array([y]), np.array([size])) for size in sizes]
    best = max(tried, key=lambda each: float(each.quality[0]))
    if best.quality[0] > 0.0 and np.isfinite(best.sigma[0]):
        return float(best.x[0]), float(best.y[0]), float(best.radius[0])
    return None


def _refined_freely(image: Image, drawn: Circle) -> Circle | None:
    x, y, radius = drawn
    free = refine_grains(image, np.array([x]), np.array([y]), np.array([radius]), fixed_radius=False)
    found = float(free.radius[0])
    if free.quality[0] > SEEN and np.isfinite(free.sigma[0]) and 1.0 / DRAWN < found / radius < DRAWN:
        return float(free.x[0]), float(free.y[0]), found
    return None


def _detected(image: Image, drawn: Circle, sizes: Sequence[float]) -> Circle | None:
    x, y, radius = drawn
    looked = tuple(size for size in sizes if size >= SMALLEST)
    if radius < SMALLEST or (sizes and not looked):
        return None
    bounds = max(radius / DRAWN, SMALLEST), DRAWN * radius
    found = detect_grains(image, DetectionSettings(looked) if looked else DetectionSettings(radius_range=bounds))
    away = np.hypot(found.x - x, found.y - y)
    near = np.flatnonzero(away < BESIDE * found.radius)
    if not len(near):
        return None
    best = near[found.quality[near].argmax()]
    return float(found.x[best]), float(found.y[best]), float(found.radius[best])
