"""Nominal sizes behind readings of radii: found from the readings, and used as far as touching pairs confirm them.

Grains are often made in a few sizes. A reading from a photograph then adds its own error to the size, and the mean of
its class is better. Whether readings within a class differ by true sizes or by errors shows in the gaps: surfaces of
touching grains meet only with the true radii.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy.typing import NDArray

from ..bodies.grains import Array
from ..even_subset import even_subset
from .touching_pairs import SIGNIFICANT, count_classes, find_near_pairs, fit_touching_pairs

MIN_GAP, MAX_RANGE = 0.1, 0.12  # over the mean radius: between sizes, and of the readings of one size
CLOSE_GAP = 0.03  # between sizes that are alike, such as 7 and 8 mm read with errors of 1 %
MAX_SIZES, MIN_GRAINS = 4, 10
# Fraction of the grains, and distance over the mean radius: fewer grains so near a size are misread, not a size.
RARE, NEAR_SIZE = 0.02, 0.14
COMMON = 0.9  # fraction of the grains that have one of the common sizes
MOST_FRAMES = 8  # of which gaps are read, evenly over the sequence
FEWEST_PAIRS = 50  # in a frame


@dataclass(frozen=True, slots=True)
class SizeClasses:
    """Classes of readings, and radii that their touching pairs support."""

    size_class: Int[np.ndarray, " n"]  # from 0, ascending
    size: Float[Array, " q"]  # [m] mean reading of every class
    error_fraction: float  # of a reading's deviation from its class that is error, 0 … 1
    error_fraction_sd: float
    radius: Float[Array, " n"]  # [m]
    class_error: Float[Array, " q"]  # [m] to be added to the radii of a class, if touching surfaces just meet

    def describe(self) -> str:
        """Describe the correction in a sentence."""
        sizes = ", ".join(f"{1e3 * each:.4g}" for each in self.size)
        count = len(self.size)
        return (
            f"radii have {count} size{'s' if count > 1 else ''} ({sizes} mm); by the gaps of touching grains "
            f"{100 * self.error_fraction:.0f} ± {100 * self.error_fraction_sd:.0f} % of the readings' deviation from "
            "them is error, which was removed"
        )


def group_readings(radius: Float[Array, " n"]) -> Int[np.ndarray, " n"] | None:
    """Group readings into size classes from 0, ascending; None where there are no distinct classes.

    Notes
    -----
    Sorted readings are separated where neighbours differ by more than 0.1 of the mean, or by 0.03 where that leaves no
    classes. There are classes if no more than four remain, each with a range of at most 0.12 of its mean. Less than 2 %
    of the grains within 0.14 of the mean radius of another size, as medians of changing readings, belong to that size.
    """
    if len(radius) < MIN_GRAINS:
        return None
    found = (_group(radius, _split(radius, gap)) for gap in (MIN_GAP, CLOSE_GAP))
    return next((each for each in found if each is not None), None)


def _group(radius: Array, groups: list[NDArray[np.intp]]) -> NDArray[np.integer] | None:
    """Size class of every grain by groups of readings; None where these are no sizes."""
    common = [group for group in groups if len(group) >= RARE * len(radius)]
    if not common:
        return None
    sizes = np.array([radius[group].mean() for group in common])
    rare = [group for group in groups if len(group) < RARE * len(radius)]
    apart = [group for group in rare if np.abs(sizes - radius[group].mean()).min() > NEAR_SIZE * radius.mean()]
    groups = sorted([*common, *apart], key=lambda group: float(radius[group].mean()))
    wide = any(np.ptp(radius[group]) > MAX_RANGE * radius[group].mean() for group in groups)
    if len(groups) > MAX_SIZES or wide:
        return None
    size_class = np.full(len(radius), -1)
    for number, group in enumerate(groups):
        size_class[group] = number
    misread = size_class < 0
    sizes = np.array([radius[group].mean() for group in groups])
    size_class[misread] = np.abs(radius[misread, None] - sizes).argmin(axis=1)
    return size_class


def find_common_sizes(radius: Float[Array, " n"]) -> tuple[Float[Array, " q"], Bool[np.ndarray, " n"]] | None:
    """Find the sizes of nearly all grains, and the grains of none of them; None where there are no distinct sizes.

    Notes
    -----
    A size is the mean of the readings within 0.06 of the median of a group as of `group_readings`, if these are 2 % of
    all or more. There are at most four, with at least 0.9 of all grains together.
    """
    if len(radius) < MIN_GRAINS:
        return None
    sizes, other = [], np.ones(len(radius), np.bool_)
    for group in _split(radius):
        middle = float(np.median(radius[group]))
        near = group[np.abs(radius[group] - middle) <= 0.5 * MAX_RANGE * middle]
        if len(near) >= RARE * len(radius):
            sizes.append(float(radius[near].mean()))
            other[near] = False
    return (np.array(sizes), other) if len(sizes) <= MAX_SIZES and other.mean() <= 1.0 - COMMON else None


def _split(radius: Array, gap: float = MIN_GAP) -> list[NDArray[np.intp]]:
    """Groups of readings, ascending, that are separated by more than a gap, over the mean."""
    order = np.argsort(radius, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(radius[order]) > gap * radius.mean()) + 1)


def find_size_classes(
    position: Float[Array, "f n 2"], radius: Float[Array, " n"], boundary: Bool[np.ndarray, " n"] | None = None
) -> SizeClasses | None:
    """Find the sizes of which the radii are readings.

    Parameters
    ----------
    position : (f, n, 2)
        Positions [m], NaN where a grain is missing.
    radius : (n,)
        Readings [m].
    boundary : (n,), optional
        Grains of the boundary, of which two need not touch; None: none.

    Returns
    -------
    SizeClasses or None
        None where there are no classes, readings do not differ within them, or gaps do not show that they are wrong.

    Notes
    -----
    With d the deviation of a reading from the mean m of its class, the radius is m + (1 − e) d. The fraction e follows
    from g + e (d_i + d_j) − δ_i − δ_j = 0 over touching pairs, with g their gaps by the readings and δ the error of a
    class. It is the fraction of the variance of d that is error, whatever the sizes within a class, so that grains of
    truly different sizes keep their readings. The readings are changed where e exceeds five standard errors.
    """
    size_class = group_readings(radius)
    if size_class is None:
        return None
    size = np.bincount(size_class, radius) / np.bincount(size_class)
    deviation = radius - size[size_class]
    if not np.abs(deviation).max() > 1e-9 * radius.mean():
        return None
    rows = even_subset(len(position), MOST_FRAMES)
    gap, design = [], []
    for place in position[rows]:
        near = find_near_pairs(place, radius, boundary)
        own = count_classes(near, size_class, len(size))
        gap.append(near.gap)
        design.append(np.column_stack([deviation[near.i] + deviation[near.j], -own]))
    gaps = np.concatenate(gap)
    if len(gaps) < FEWEST_PAIRS * len(rows):
        return None
    of_class = np.arange(len(size) + 1) > 0
    found = fit_touching_pairs(gaps, np.concatenate(design), of_class, 2.0 * float(radius.mean()), len(rows))
    fraction, sd = float(np.clip(found.value[0], 0.0, 1.0)), float(found.sd[0])
    if not found.value[0] > SIGNIFICANT * sd:
        return None
    radius = size[size_class] + (1.0 - fraction) * deviation
    return SizeClasses(size_class, size, fraction, sd, radius, found.value[1:])
