"""The scale of a sequence: a wrong pixel size and wrong radii of whole classes, found before anything finer.

Touching grains of two classes have one gap: measured with the true scale and radii, zero less the elastic overlap.
So the gaps of each pair of classes pile up at one value, on a tail of pairs that do not touch, and where they pile up
tells an error that all of these pairs share,

    gap = −overlap − ε (R_a + R_b) + 2 ω + δR_a + δR_b,

with ε the relative error of the pixel size, ω one that all radii share, as where a rim is seen too far in, and δR those
of the classes. A pixel size is easily wrong by half a per cent, rims are seen true or well inside, and machined rods
are true to a thousandth unless a class was mistaken altogether: ε has a Gaussian prior, ω and every δR an exponential
one on both sides, so that the fewest causes that explain all gaps are found. Rods of one size cannot tell ε from ω.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.bodies.wall_shapes import all_sides, reach_of_wall
from solver.calibration.gaps import MeasuredSequence, find_gap_rows, measure_gaps
from solver.calibration.priors import CalibrationPriors

REACH = 0.06  # of a mean diameter: gaps beyond are not looked at
COARSE = 1.5e-3  # of a mean diameter: width of the kernel that finds the pile, then reduced to the pile's own
FINEST = 2e-4  # of a mean diameter: no narrower kernel
KERNEL_STEPS = 30  # mean-shift steps
LEAST_PAIRS = 6  # distinct pairs in a pile: fewer tell nothing of their classes
FRAMES = 20  # photographs that are looked at, evenly spread
OVERLAP_DOUBT = 0.5  # the typical overlap is known to this share …
TAIL_DOUBT = 0.1  # … and the tail of open gaps may draw the pile aside by this share of its width
NORMAL_MEDIAN = 0.6745  # median of |N(0, 1)|
TOLD = 3.0  # standard deviations beyond which an error is surely there
DECISIVE = 20.0  # gain in twice the log likelihood, priors included, from which on the given scale is given up
REWEIGHTINGS = 60  # of the exponential priors
NEGLIGIBLE = 1e-3  # of a prior: an error of a class below this is none


@dataclass(frozen=True, slots=True)
class ScaleErrors:
    """Errors that whole classes of lengths share. Add them to what was given."""

    pixel_size: float  # relative; true distances are (1 + pixel_size) times the measured ones
    pixel_size_sd: float
    radius_class: Array  # (c,) [m] from given to true radius, beside radius_offset
    radius_class_sd: Array  # (c,) [m]
    walls_follow: bool  # the walls were measured with the same pixel size
    found: bool  # False: all of it is zero
    radius_offset: float = 0.0  # [m] from given to true radius, of all grains
    radius_offset_sd: float = 0.0
    told_apart: bool = True  # whether the gaps tell the pixel size from the offset of the radii

    def correct(self, sequence: MeasuredSequence, radius_class: NDArray[np.integer] | None) -> MeasuredSequence:
        """Apply them. radius_class (n,): the class of each grain, as they were found with."""
        if not self.found:
            return sequence
        scale = 1.0 + self.pixel_size
        classes = np.zeros(sequence.grain_count, np.int64) if radius_class is None else radius_class
        return replace(
            sequence,
            radius=sequence.radius + self.radius_offset + self.radius_class[classes],
            position=scale * sequence.position,
            endpoints=scale * sequence.endpoints if self.walls_follow else sequence.endpoints,
        )


@dataclass(frozen=True, slots=True)
class _Piles:
    """Where the gaps of each pair of classes pile up."""

    first: NDArray[np.int64]  # (p,) class
    second: NDArray[np.int64]  # (p,) class
    distance: Array  # (p,) [m] sum of the given radii
    excess: Array  # (p,) [m] gap beyond contact
    sd: Array  # (p,) [m] by the scatter of the pairs
    doubt: float  # [m] that all share


def find_scale(
    sequence: MeasuredSequence,
    priors: CalibrationPriors,
    overlap: float,
    radius_class: NDArray[np.integer] | None = None,
) -> ScaleErrors:
    """Find the errors of the pixel size and of radius classes, as far as `priors` allows either.

    overlap [m]: mean elastic overlap of a touching pair; radius_class (n,) int: class 0, 1, … of each grain.
    """
    classes = np.zeros(sequence.grain_count, np.int64) if radius_class is None else radius_class.astype(np.int64)
    count = int(classes.max(initial=0)) + 1
    nothing = ScaleErrors(
        0.0, priors.pixel_size, np.zeros(count), np.full(count, priors.radius_class),
        walls_follow=False, found=False, radius_offset_sd=priors.radius_offset,
    )  # fmt: skip
    if priors.pixel_size == 0.0 and priors.radius_class == 0.0 and priors.radius_offset == 0.0:
        return nothing
    piles = _find_piles(sequence.thinned(FRAMES), classes, overlap)
    if piles is None:
        return nothing
    errors, sd, gain = _explain(piles, count, priors)
    # Each with all that the other may be: one of them has to be sure.
    apart = bool(np.any(np.abs(errors[:2]) > TOLD * sd[:2])) or 0.0 in (priors.pixel_size, priors.radius_offset)
    if gain < DECISIVE:
        return replace(
            nothing, pixel_size_sd=float(sd[0]), radius_offset_sd=float(sd[1]), told_apart=apart, radius_class_sd=sd[2:]
        )
    found = ScaleErrors(
        float(errors[0]), float(sd[0]), errors[2:], sd[2:], walls_follow=False, found=True,
        radius_offset=float(errors[1]), radius_offset_sd=float(sd[1]), told_apart=apart,
    )  # fmt: skip
    return replace(found, walls_follow=_walls_follow(sequence.thinned(FRAMES), found, radius_class))


def _find_piles(sequence: MeasuredSequence, classes: NDArray[np.int64], overlap: float) -> _Piles | None:
    diameter = 2.0 * float(sequence.radius.mean())
    rows = find_gap_rows(sequence, REACH * diameter, wall_reach=-np.inf)
    gap = measure_gaps(rows, sequence.position, sequence.endpoints, sequence.radius, cell=sequence.cell).gap
    pair_class = np.sort(np.stack([classes[rows.i], classes[rows.j]], axis=1), axis=1)
    piles = []
    for first, second in np.unique(pair_class, axis=0):
        chosen = (pair_class == (first, second)).all(axis=1)
        place, width, pairs = _pile(gap[chosen], rows.pair[chosen], diameter)
        if pairs >= LEAST_PAIRS:
            distance = float(np.mean(sequence.radius[rows.i[chosen]] + sequence.radius[rows.j[chosen]]))
            piles.append((first, second, distance, place + overlap, width / np.sqrt(pairs), width))
    if not piles:
        return None
    first, second, distance, excess, sd, width = (np.array(column) for column in zip(*piles, strict=True))
    doubt = np.hypot(OVERLAP_DOUBT * overlap, TAIL_DOUBT * np.median(width))
    return _Piles(first.astype(np.int64), second.astype(np.int64), distance, excess, sd, float(doubt))


def _pile(gap: Array, pair: NDArray[np.int32], diameter: float) -> tuple[float, float, int]:
    """Place and width [m] of the densest gaps, and how many distinct pairs are there."""
    within = np.abs(gap) < REACH * diameter
    gap, pair = gap[within], pair[within]
    if len(gap) == 0:
        return 0.0, 0.0, 0
    place = _densest(gap, COARSE * diameter)
    depth = place - gap[(gap < place) & (gap > place - 0.5 * REACH * diameter)]
    width = float(np.median(depth)) / NORMAL_MEDIAN if len(depth) else 0.0
    width = max(width, FINEST * diameter)
    for _ in range(KERNEL_STEPS):
        weight = np.exp(-0.5 * ((gap - place) / width) ** 2)
        place = float(weight @ gap / weight.sum())
    return place, width, len(np.unique(pair[np.abs(gap - place) < 2.0 * width]))


def _densest(gap: Array, kernel: float) -> float:
    bins = np.arange(gap.min() - 4.0 * kernel, gap.max() + 5.0 * kernel, 0.25 * kernel)
    count = np.histogram(gap, bins)[0]
    smooth = np.convolve(count, np.exp(-0.5 * (0.25 * np.arange(-12, 13)) ** 2), mode="same")
    return float(bins[np.argmax(smooth)] + 0.125 * kernel)


def _explain(piles: _Piles, count: int, priors: CalibrationPriors) -> tuple[Array, Array, float]:
    """The most probable errors (2 + c,), ε, ω and δR, their standard deviations, and what is gained over none."""
    rows = np.arange(len(piles.first))
    matrix = np.zeros((len(rows), 2 + count))
    matrix[:, 0] = piles.distance
    matrix[:, 1] = -2.0
    np.add.at(matrix, (rows, 2 + piles.first), -1.0)
    np.add.at(matrix, (rows, 2 + piles.second), -1.0)
    precision = np.linalg.inv(np.diag(piles.sd**2) + piles.doubt**2)
    target = -piles.excess
    limit = np.concatenate([[priors.pixel_size, priors.radius_offset], np.full(count, priors.radius_class)])
    free = limit > 0.0
    gaussian = (np.arange(2 + count) < 1)[free]
    matrix, limit = matrix[:, free], limit[free]
    variance = limit**2
    normal = matrix.T @ precision @ matrix
    right = matrix.T @ precision @ target
    errors = np.zeros(len(limit))
    for _ in range(REWEIGHTINGS):
        errors = np.linalg.solve(normal + np.diag(1.0 / variance), right)
        # An exponential prior of scale λ weighs like a Gaussian one of variance λ |δ|.
        variance = np.where(gaussian, limit**2, limit * np.maximum(np.abs(errors), NEGLIGIBLE * limit))
    residual = target - matrix @ errors
    cost = np.where(gaussian, (errors / limit) ** 2, 2.0 * np.abs(errors) / limit).sum()
    gain = target @ precision @ target - residual @ precision @ residual - cost
    spread = np.where(gaussian, limit**2, np.maximum(variance, limit**2))
    all_errors, sd = np.zeros(2 + count), np.zeros(2 + count)
    all_errors[free] = errors
    sd[free] = np.sqrt(np.diag(np.linalg.inv(normal + np.diag(1.0 / spread))))
    return all_errors, sd, float(gain)


def _walls_follow(sequence: MeasuredSequence, found: ScaleErrors, radius_class: NDArray[np.integer] | None) -> bool:
    """Whether the walls fit the grains better when the pixel size changes them, too."""
    if sequence.wall_count == 0:
        return False
    stay, follow = (
        _misfit(replace(found, walls_follow=choice).correct(sequence, radius_class)) for choice in (False, True)
    )
    return follow < stay


def _misfit(sequence: MeasuredSequence) -> float:
    """How far the walls stand off their nearest grains, or cut into them [m], summed over the walls."""
    side = all_sides(sequence.side, sequence.wall_count)
    depth, _ = reach_of_wall(sequence.endpoints[:, None], side, sequence.position[:, :, None])
    gap = depth - sequence.radius[:, None]
    gap = np.where(sequence.present[..., None], gap, np.inf)
    return float(np.abs(np.median(gap.min(axis=1), axis=0)).sum())
