"""Motion of rigid bars whose ends are given as corners, where bars meet, instead of points of the bar.

As the packing dilates, a corner slides along the bar, so that the distance of two corners changes; that of two points
of a bar cannot. Grains that roll on the wall without sliding move with the bar and determine the fraction of the change
that happens at each end.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array
from ..bodies.wall_shapes import STRAIGHT, all_sides, outward_normals
from ..calibration.gaps import MeasuredSequence
from ..part_settings import SLIP_SIGMAS
from ..quantity import Quantity

MAX_STRETCH_SDS = 4.0  # standard deviations of a length: smaller changes are noise …
MIN_STRETCH = 1e-5  # … and of the length
FEWEST_CHANGES = 3  # of the slope of a length over time, from which its noise is read, …
UNCERTAIN_SLOPE = 3.0  # … times this, as few changes determine it badly
TOUCHING = 4.0  # standard deviations of a gap, and …
WALL_TOLERANCE = 1e-2  # … mean radii: half the width of the gaps of touching grains
COMMON_ERROR = 5e-2  # mean radii: error of the given wall and of all radii together, at most
FEWEST_TOUCHING = 10  # poses of touching grains from which the motion of a bar is read
END_FRACTIONS = np.linspace(-0.5, 1.5, 201)  # trial fractions of the change of length at end 0
HINGE_AGREEMENT = 0.97  # of the best agreement: from here on a fraction of 0 or 1 is preferred


@dataclass(frozen=True, slots=True)
class Bars:
    """Motion of the given ends of walls along the bars."""

    slip: Annotated[
        Array,
        Quantity(
            "sliding of the given ends along the bar since the frame before, mean of both, towards end 1", "m",
            "frame wall", since=2, path="walls/slip",
        ),
    ]  # fmt: skip
    corner: Annotated[
        NDArray[np.bool_], Quantity("whether the given ends slide along the bar", dims="wall", since=2, absent=False)
    ]
    stretch: Annotated[Array, Quantity("greatest change of the given length, over the length", dims="wall", since=2)]
    end_fraction: Annotated[
        Array,
        Quantity(
            "fraction of the change of length that happens at end 0; NaN: none, or unknown", dims="wall", since=2,
            path="boundary/bars/share",
        ),
    ]  # fmt: skip


def find_wall_bars(sequence: MeasuredSequence, noise: float, end_kind: NDArray[np.int8]) -> tuple[Bars, Array]:
    """Find which ends are corners, how they slide along the bars, and points of the bars.

    Parameters
    ----------
    sequence : MeasuredSequence
    noise : float
        Standard deviation [m] of an end along the wall.
    end_kind : int array (w,)
        1: corners; 0: points of the bar; −1: unspecified, corners if the length changes significantly.

    Returns
    -------
    bars : Bars
        Sliding of the ends.
    points : array (f, w, 2, 2)
        Points [m] of the bars in place of corners; other ends as given.

    Notes
    -----
    A length changes significantly if max |ℓ − ℓ_0| > max(4 σ, 10⁻⁵ ⟨ℓ⟩), σ the noise of a length: √2 noise, or less
    where its slope over time changes by less from photograph to photograph. Ends of a simulation have none, and at rest
    a packing may move no more than their corners do.
    """
    ends = sequence.endpoints
    length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
    stretch = np.abs(length - length[:1]).max(axis=0) / length.mean(axis=0)
    limit = np.maximum(MAX_STRETCH_SDS * _length_noise(length, noise), MIN_STRETCH * length.mean(axis=0))
    stretches = stretch * length.mean(axis=0) > limit
    corner = np.where(end_kind < 0, stretches, end_kind == 1) & (
        all_sides(sequence.side, sequence.wall_count) == STRAIGHT
    )
    points, slip, end_fraction = ends.copy(), np.zeros(length.shape), np.full(sequence.wall_count, np.nan)
    for w in np.flatnonzero(corner).tolist():
        end_fraction[w] = _first_end_fraction(sequence, w, length[:, w])
        points[:, w], slip[:, w] = _points_of_bar(ends[:, w], length[:, w], end_fraction[w])
    return Bars(slip, corner, stretch, end_fraction), points


def _length_noise(length: Array, noise: float) -> Array:
    """Standard deviations (w,) of the lengths (f, w) [m] of bars whose ends have at most this noise."""
    change = np.diff(length, 2, axis=0) / np.sqrt(6.0)  # √6: second difference of independent errors
    seen = UNCERTAIN_SLOPE * np.sqrt(np.mean(change**2, axis=0)) if len(change) >= FEWEST_CHANGES else np.inf
    return np.minimum(np.sqrt(2.0) * noise, seen)


def _first_end_fraction(sequence: MeasuredSequence, w: int, length: Array) -> float:
    """Find the fraction of the change of length at end 0 for which most grains roll on the wall.

    Notes
    -----
    The fraction a maximises ⟨1/(1 + ((d − a Δℓ)/σ)²)⟩, with d the displacement of a grain's surface along the wall
    from end 0, Δℓ the change of length meanwhile and σ its noise. 0 or 1 is taken where its mean is at least 0.97 of
    the maximum; where that holds for both, the one for which the bar moves less along itself. NaN: too few grains touch
    the wall.
    """
    moved, stretched, noise = _surface_motion(sequence, w, length)
    if len(moved) < FEWEST_TOUCHING:
        return np.nan
    left = moved[:, None] - END_FRACTIONS * stretched[:, None]
    agreement = (1.0 / (1.0 + (left / noise[:, None]) ** 2)).mean(axis=0)
    best = float(agreement.max())
    for held in _still_first(sequence.endpoints[:, w], length):  # most apparatuses have a hinge at one end
        if agreement[np.argmin(np.abs(END_FRACTIONS - held))] >= HINGE_AGREEMENT * best:
            return held
    return float(END_FRACTIONS[np.argmax(agreement)])


def _still_first(ends: Array, length: Array) -> list[float]:
    """The fractions 0 and 1 of a bar (f, 2, 2) [m], first the one for which it moves less along itself."""
    along = np.diff(ends, axis=1)[:, 0] / length[:, None]
    first = np.einsum("fk,fk->f", np.diff(ends[:, 0], axis=0), along[1:])
    return sorted((0.0, 1.0), key=lambda held: float(np.abs(first + held * np.diff(length)).sum()))


def _surface_motion(sequence: MeasuredSequence, w: int, length: Array) -> tuple[Array, Array, Array]:
    """Compute surface displacements (m,) [m] of touching grains from end 0 of the wall, its stretch, and the noise."""
    ends = sequence.endpoints[:, w]
    normal = outward_normals(ends)
    along = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
    angle = np.unwrap(np.arctan2(along[:, 1], along[:, 0]))
    offset = sequence.position - ends[:, None, 0]
    place = np.einsum("fnk,fk->fn", offset, along)
    gap = -np.einsum("fnk,fk->fn", offset, normal) - sequence.radius
    sigma = np.where(sequence.present, sequence.sigma, 0.0)
    beside = (place > 0.0) & (place < length[:, None])
    width = TOUCHING * sigma + WALL_TOLERANCE * float(sequence.radius.mean())
    near = np.abs(gap - _touching_gap(gap[beside & sequence.present], sequence.radius, width)) < width
    both = (near & beside & sequence.present)[1:] & (near & sequence.present)[:-1]
    rolled = sequence.radius * (np.diff(sequence.rotation, axis=0) - np.diff(angle)[:, None])
    motion = np.diff(place, axis=0) + rolled
    stretched = np.broadcast_to(np.diff(length)[:, None], motion.shape)
    noise = SLIP_SIGMAS * np.maximum(sigma[1:], MIN_STRETCH * float(sequence.radius.mean()))
    known = both & np.isfinite(motion)
    return motion[known], stretched[known], noise[known]


def _touching_gap(gap: Array, radius: Array, width: Array) -> float:
    """Find the gap [m] that touching grains seem to have, as radii and walls may share an error.

    Notes
    -----
    Centre of the interval of twice the width that holds the most gaps, among gaps of at most the common error.
    """
    half = float(width.max(initial=0.0))
    gap = np.sort(gap[np.abs(gap) < half + COMMON_ERROR * float(radius.mean())])
    if not len(gap):
        return 0.0
    count = np.searchsorted(gap, gap + 2.0 * half) - np.arange(len(gap))
    first = int(np.argmax(count))
    return float(np.median(gap[first : first + count[first]]))


def _points_of_bar(ends: Array, length: Array, end_fraction: float) -> tuple[Array, Array]:
    """Compute points (f, 2, 2) [m] of the bar on the line of its given ends (f, 2, 2), and the slip (f,) [m] of these.

    The bar begins at its given ends of the first frame and is extended to cover those of all frames. Where the fraction
    is unknown, the middle of the bar stays in the middle of its ends.
    """
    end_fraction = 0.5 if np.isnan(end_fraction) else end_fraction
    slid = end_fraction * (length - length[0])  # motion of the bar past end 0, towards end 1
    direction = (ends[:, 1] - ends[:, 0]) / length[:, None]
    first = min(0.0, float((-slid).min()))
    last = max(float(length[0]), float((length - slid).max()))
    points = ends[:, None, 0] + (slid[:, None] + np.array([first, last]))[:, :, None] * direction[:, None, :]
    # The bar moves past end 0 by end_fraction times the stretch, and past end 1 by end_fraction − 1 times the stretch.
    slip = -(end_fraction - 0.5) * np.diff(length, prepend=length[0])
    return points, slip
