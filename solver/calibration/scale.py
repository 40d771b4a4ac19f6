"""The scale of a sequence: errors of the pixel size and of whole radius classes, estimated before any finer errors.

With the true scale and radii, touching grains of two classes have a gap of minus the elastic overlap. The distribution
of the gaps of each pair of classes therefore has a peak, beside a tail of open pairs, and the peak's position shows the
errors that all of these pairs share.

Notes
-----
The peak of classes a and b is at

    gap = −overlap − ε (R_a + R_b) + 2 ω + δR_a + δR_b,

with ε the relative error of the pixel size, ω the error that all radii share, for instance of a rim measured too far
inside, and δR those of the classes. Typical errors are half a per cent for pixel sizes, zero or large for rims, and a
thousandth for machined rods unless a class was mistaken: ε has a Gaussian prior, ω and every δR a Laplace prior, which
selects the fewest causes that explain all gaps. Rods of one size cannot separate ε from ω.

A factor 1 + ρ of all radii changes the gaps between grains as the pixel size does, with ρ = −ε. Walls separate them:
the pixel size does not change the radius of a disc that was measured by itself, nor walls that were.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array
from ..bodies.wall_shapes import OUT, STRAIGHT, Sides, all_sides, bounding_distance, circle_ends, circle_parameters
from ..robust_scale import NORMAL_MEDIAN
from .gaps import MeasuredSequence, find_gap_rows, measure_gaps
from .priors import CalibrationPriors

REACH = 0.06  # of a mean diameter: greatest gap that is used
COARSE = 1.5e-3  # of a mean diameter: initial kernel width, then reduced to the width of the peak
FINEST = 2e-4  # of a mean diameter: smallest kernel width
KERNEL_STEPS = 30  # mean-shift steps
MIN_PAIRS = 6  # distinct pairs in a peak; classes with fewer are not used
FRAMES = 20  # photographs used, evenly spaced
OVERLAP_SD = 0.5  # relative standard deviation of the typical overlap
TAIL_SD = 0.1  # standard deviation of the peak's shift by the tail of open gaps, over the peak's width
SIGNIFICANT_SDS = 3.0  # standard deviations above which an error or correction is significant, or exceeds its prior
MIN_LIKELIHOOD_GAIN = 20.0  # gain in twice the log posterior above which the given scale is corrected
REWEIGHTINGS = 60  # rounds for the Laplace priors
NEGLIGIBLE = 1e-3  # of a prior: smaller errors of a class count as zero
DISC_SD = 3e-3  # relative standard deviation of the radius of a disc of the boundary
LEAST_WALL_SD = 1e-3  # of a mean radius: standard deviation of a wall, at least
LARGEST_MISFIT = 25.0  # of a wall, squared: perhaps no grain touches it
CONCLUSIVE = 9.0  # difference in twice the log likelihood of the walls above which factor and pixel size are separated


@dataclass(frozen=True, slots=True)
class ScaleErrors:
    """Errors that whole classes of lengths share. Add them to the given values."""

    pixel_size: float  # relative; true distances are (1 + pixel_size) times the measured ones
    pixel_size_sd: float
    radius_class: Array  # (c,) [m] from given to true radius, beside radius_offset
    radius_class_sd: Array  # (c,) [m]
    walls_follow: bool  # the walls were measured with the same pixel size
    found: bool  # False: all errors are zero
    radius_offset: float = 0.0  # [m] from given to true radius, of all grains
    radius_offset_sd: float = 0.0
    separable: bool = True  # whether the gaps separate the pixel size from the offset of the radii
    radius_factor: float = 0.0  # relative; true radii are (1 + radius_factor) times the given ones, beside the others
    radius_factor_sd: float = 0.0
    walls_decide: bool = False  # rods at the walls separate the pixel size from the factor of the radii

    def correct(self, sequence: MeasuredSequence, radius_class: NDArray[np.integer] | None) -> MeasuredSequence:
        """Apply the errors; radius_class (n,): the class of each grain, as for `find_scale`."""
        if not self.found:
            return sequence
        scale = 1.0 + self.pixel_size
        return replace(
            sequence,
            radius=self.corrected_radius(sequence.radius, radius_class),
            position=scale * sequence.position,
            endpoints=scale_walls(sequence.endpoints, scale, sequence.side)
            if self.walls_follow
            else sequence.endpoints,
        )

    def corrected_radius(self, radius: Array, radius_class: NDArray[np.integer] | None) -> Array:
        """Apply the errors to given radii (n,) [m]; radius_class (n,): the class of each grain."""
        of_class = self.radius_class[0 if radius_class is None else radius_class]
        return (1.0 + self.radius_factor) * radius + self.radius_offset + of_class


def scale_walls(endpoints: Array, scale: float, side: Sides) -> Array:
    """Scale bars and the centres of circles (f, w, 2, 2) [m]; discs that grains touch from outside keep their radii."""
    scaled = scale * endpoints
    if side is None or not np.any(side == OUT):
        return scaled
    centre, radius, angle = circle_parameters(endpoints)
    return np.where((side == OUT)[:, None, None], circle_ends(scale * centre, radius, angle), scaled)


@dataclass(frozen=True, slots=True)
class _GapPeaks:
    """Peaks of the gap distributions, one for each pair of classes."""

    first: NDArray[np.int64]  # (p,) class
    second: NDArray[np.int64]  # (p,) class
    distance: Array  # (p,) [m] sum of the given radii
    excess: Array  # (p,) [m] position of the peak beyond contact
    sd: Array  # (p,) [m] by the width of the peak and its number of pairs
    common_sd: float  # [m] of an error that all peaks share


def find_scale(
    sequence: MeasuredSequence,
    priors: CalibrationPriors,
    overlap: float,
    radius_class: NDArray[np.integer] | None = None,
) -> ScaleErrors:
    """Estimate the errors of the pixel size, of all radii, and of radius classes.

    Parameters
    ----------
    sequence : MeasuredSequence
    priors : CalibrationPriors
        Scales σ_ε, λ_ω and λ_δ of the priors; zero: exact.
    overlap : float
        Mean elastic overlap ō [m] of a touching pair.
    radius_class : int array (n,), optional
        Class 0, 1, … of each grain.

    Returns
    -------
    ScaleErrors
        All zero, with standard deviations, where the evidence does not exceed MIN_LIKELIHOOD_GAIN.

    Notes
    -----
    Peaks at t_p beyond contact, of width w_p and n_p distinct pairs, minimise

        J(x) = (t + M x)ᵀ C⁻¹ (t + M x) + (ε/σ_ε)² + 2 |ω|/λ_ω + 2 Σ |δR|/λ_δ,
        C = diag(w_p²/n_p) + ((0.5 ō)² + (0.1 median w)²) 1 1ᵀ,

    over x = (ε, ω, δR), M with rows (R_a + R_b, −2, −1 for a, −1 for b), by 60 re-weighted least-squares steps in which
    a Laplace prior is a Gaussian one of variance λ |x|. The errors are applied if J(0) − J(x) ≥ 20.
    """
    classes = np.zeros(sequence.grain_count, np.int64) if radius_class is None else radius_class.astype(np.int64)
    count = int(classes.max(initial=0)) + 1
    unchanged = ScaleErrors(
        0.0, priors.pixel_size, np.zeros(count), np.full(count, priors.radius_class),
        walls_follow=False, found=False, radius_offset_sd=priors.radius_offset,
    )  # fmt: skip
    if not any((priors.pixel_size, priors.radius_class, priors.radius_offset, priors.radius_factor)):
        return unchanged
    seen = sequence.thinned(FRAMES)
    peaks = _find_peaks(seen, classes, overlap)
    if peaks is None:
        return unchanged
    pixel, pixel_gain = _of_pixel_size(seen, peaks, priors, radius_class)
    chosen, gain = pixel, pixel_gain
    if priors.radius_factor > 0.0:
        factor, factor_gain = _with_positive_radii(*_of_radius_factor(peaks, count, priors), seen, radius_class)
        by_walls = _wall_evidence(seen, factor, priors, radius_class) - _wall_evidence(
            seen, pixel, priors, radius_class
        )
        if factor_gain + by_walls > pixel_gain:
            chosen, gain = factor, factor_gain
        chosen = replace(chosen, walls_decide=abs(by_walls) > CONCLUSIVE)
    if gain >= MIN_LIKELIHOOD_GAIN:
        return chosen
    return replace(
        unchanged,
        pixel_size_sd=pixel.pixel_size_sd,
        radius_offset_sd=pixel.radius_offset_sd,
        separable=pixel.separable,
        radius_class_sd=pixel.radius_class_sd,
    )


def _of_pixel_size(
    sequence: MeasuredSequence,
    peaks: _GapPeaks,
    priors: CalibrationPriors,
    radius_class: NDArray[np.integer] | None,
) -> tuple[ScaleErrors, float]:
    """Estimate the errors with one of the pixel size; also return twice the gain in log evidence."""
    count = 1 if radius_class is None else int(radius_class.max(initial=0)) + 1
    limit = np.concatenate([[priors.pixel_size, priors.radius_offset], np.full(count, priors.radius_class)])
    errors, sd, gain = _estimate_errors(peaks, limit)
    # Each standard deviation contains the other error: one of the two has to be significant.
    separable = bool(np.any(np.abs(errors[:2]) > SIGNIFICANT_SDS * sd[:2])) or 0.0 in limit[:2]
    found = ScaleErrors(
        float(errors[0]), float(sd[0]), errors[2:], sd[2:], walls_follow=False, found=True,
        radius_offset=float(errors[1]), radius_offset_sd=float(sd[1]), separable=separable,
    )  # fmt: skip
    found, gain = _with_positive_radii(found, gain, sequence, radius_class)
    return replace(found, walls_follow=_walls_follow(sequence, found, radius_class)), gain


def _with_positive_radii(
    found: ScaleErrors, gain: float, sequence: MeasuredSequence, radius_class: NDArray[np.integer] | None
) -> tuple[ScaleErrors, float]:
    """Return errors and their gain; neither where a radius would vanish, as with meaningless positions."""
    if np.all(found.corrected_radius(sequence.radius, radius_class) > 0.0):
        return found, gain
    zeros = np.zeros_like(found.radius_class)
    return replace(found, pixel_size=0.0, radius_class=zeros, radius_offset=0.0, radius_factor=0.0), -np.inf


def _of_radius_factor(peaks: _GapPeaks, count: int, priors: CalibrationPriors) -> tuple[ScaleErrors, float]:
    """Estimate the errors with a factor of all radii in place of one of the pixel size, as `_of_pixel_size`.

    Notes
    -----
    A wide prior has less evidence: the gain is reduced by 2 ln(σ_ρ/σ_ε), unless the pixel size is exact.
    """
    limit = np.concatenate([[priors.radius_factor, priors.radius_offset], np.full(count, priors.radius_class)])
    errors, sd, gain = _estimate_errors(peaks, limit)
    found = ScaleErrors(
        0.0, 0.0, errors[2:], sd[2:], walls_follow=True, found=True, radius_offset=float(errors[1]),
        radius_offset_sd=float(sd[1]), radius_factor=-float(errors[0]), radius_factor_sd=float(sd[0]),
    )  # fmt: skip
    return found, gain - 2.0 * np.log(priors.radius_factor / (priors.pixel_size or priors.radius_factor))


def _wall_evidence(
    sequence: MeasuredSequence,
    found: ScaleErrors,
    priors: CalibrationPriors,
    radius_class: NDArray[np.integer] | None,
) -> float:
    """Return twice the log likelihood of the walls: −Σ min((g/σ)², 25), g: median gap of the nearest grain."""
    if sequence.wall_count == 0:
        return 0.0
    side = all_sides(sequence.side, sequence.wall_count)
    _, radius, _ = circle_parameters(sequence.endpoints[0])
    sd = np.hypot(
        max(priors.wall, LEAST_WALL_SD * float(sequence.radius.mean())),
        np.where(side == STRAIGHT, 0.0, DISC_SD * radius),
    )
    misfit = (_median_gaps(found.correct(sequence, radius_class)) / sd) ** 2
    return -float(np.minimum(misfit, LARGEST_MISFIT).sum())


def _find_peaks(sequence: MeasuredSequence, classes: NDArray[np.int64], overlap: float) -> _GapPeaks | None:
    diameter = 2.0 * float(sequence.radius.mean())
    rows = find_gap_rows(sequence, REACH * diameter, wall_reach=-np.inf)
    gap = measure_gaps(rows, sequence.position, sequence.endpoints, sequence.radius, cell=sequence.cell).gap
    pair_class = np.sort(np.stack([classes[rows.i], classes[rows.j]], axis=1), axis=1)
    peaks = []
    for first, second in np.unique(pair_class, axis=0):
        chosen = (pair_class == (first, second)).all(axis=1)
        place, width, pairs = _find_peak(gap[chosen], rows.pair[chosen], diameter)
        if pairs >= MIN_PAIRS:
            distance = float(np.mean(sequence.radius[rows.i[chosen]] + sequence.radius[rows.j[chosen]]))
            peaks.append((first, second, distance, place + overlap, width / np.sqrt(pairs), width))
    if not peaks:
        return None
    first, second, distance, excess, sd, width = (np.array(column) for column in zip(*peaks, strict=True))
    common_sd = np.hypot(OVERLAP_SD * overlap, TAIL_SD * np.median(width))
    return _GapPeaks(first.astype(np.int64), second.astype(np.int64), distance, excess, sd, float(common_sd))


def _find_peak(gap: Array, pair: NDArray[np.int32], diameter: float) -> tuple[float, float, int]:
    """Find position and width [m] of the peak of the gap distribution, and its number of distinct pairs."""
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


def _estimate_errors(peaks: _GapPeaks, limit: Array) -> tuple[Array, Array, float]:
    """Estimate the errors (2 + c,), ε, ω and δR, their standard deviations, and the gain J(0) − J(x).

    limit (2 + c,): standard deviation or scale of their priors.
    """
    count = len(limit) - 2
    rows = np.arange(len(peaks.first))
    matrix = np.zeros((len(rows), 2 + count))
    matrix[:, 0] = peaks.distance
    matrix[:, 1] = -2.0
    np.add.at(matrix, (rows, 2 + peaks.first), -1.0)
    np.add.at(matrix, (rows, 2 + peaks.second), -1.0)
    precision = np.linalg.inv(np.diag(peaks.sd**2) + peaks.common_sd**2)
    target = -peaks.excess
    free = limit > 0.0
    gaussian = (np.arange(2 + count) < 1)[free]
    matrix, limit = matrix[:, free], limit[free]
    variance = limit**2
    normal = matrix.T @ precision @ matrix
    right = matrix.T @ precision @ target
    errors = np.zeros(len(limit))
    for _ in range(REWEIGHTINGS):
        errors = np.linalg.solve(normal + np.diag(1.0 / variance), right)
        # A Laplace prior of scale λ has the gradient of a Gaussian one of variance λ |δ|.
        variance = np.where(gaussian, limit**2, limit * np.maximum(np.abs(errors), NEGLIGIBLE * limit))
    residual = target - matrix @ errors
    cost = np.where(gaussian, (errors / limit) ** 2, 2.0 * np.abs(errors) / limit).sum()
    gain = target @ precision @ target - residual @ precision @ residual - cost
    prior_variance = np.where(gaussian, limit**2, np.maximum(variance, limit**2))
    all_errors, sd = np.zeros(2 + count), np.zeros(2 + count)
    all_errors[free] = errors
    sd[free] = np.sqrt(np.diag(np.linalg.inv(normal + np.diag(1.0 / prior_variance))))
    return all_errors, sd, float(gain)


def _walls_follow(sequence: MeasuredSequence, found: ScaleErrors, radius_class: NDArray[np.integer] | None) -> bool:
    """Return whether the walls fit the grains better if the pixel size scales them, too."""
    if sequence.wall_count == 0:
        return False
    stay, follow = (
        _misfit(replace(found, walls_follow=choice).correct(sequence, radius_class)) for choice in (False, True)
    )
    return follow < stay


def _misfit(sequence: MeasuredSequence) -> float:
    """Sum over the walls the absolute median gap [m] of their nearest grains."""
    return float(np.abs(_median_gaps(sequence)).sum())


def _median_gaps(sequence: MeasuredSequence) -> Array:
    """Return the median over photographs of the gap (w,) [m] of the nearest grain of every wall."""
    side = all_sides(sequence.side, sequence.wall_count)
    depth, _ = bounding_distance(sequence.endpoints[:, None], side, sequence.position)
    gap = depth - sequence.radius[:, None]
    gap = np.where(sequence.present[..., None], gap, np.inf)
    return np.median(gap.min(axis=1), axis=0)
