"""Priors of the constant errors, their reduction by the data, and the pairs and frames that are fitted."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array
from ..quantity import Quantity
from .equations import GapEquations
from .gaps import GapRows, MeasuredSequence, find_gap_rows, measure_gaps
from .weights import contact_width

REACH = 4.0  # calibration pairs have gaps below this many times the scale of the errors
REACH_OF_NOISE = 6.0  # … plus this many standard deviations of the noise
WIDEST_CENTRE = 0.1  # of the mean radius: prior of the centre of a grain whose rim is hardly seen, at most
MIN_EXCESS = 0.1  # of the noise: smaller constant errors cannot be detected
FINEST_SURFACE = 1e-5  # of the mean radius: below this no real grain is round


@dataclass(frozen=True, slots=True)
class CalibrationPriors:
    """Prior standard deviations of the constant errors. Zero: known exactly."""

    centre: Annotated[float, Quantity("prior standard deviation of a component of a centre", "m", absent=0.0)]
    radius: Annotated[float, Quantity("prior standard deviation of a radius, grain by grain", "m", absent=0.0)]
    wall: Annotated[
        float,
        Quantity(
            "prior standard deviation of a wall along its normal",
            "m",
            path="calibration/priors/wall_outward",
            formerly="calibration/priors/wall",
        ),
    ] = 0.0
    wall_tilt: Annotated[float, Quantity("prior standard deviation of a wall about its middle", "rad")] = 0.0
    pixel_size: Annotated[float, Quantity("prior standard deviation of the pixel size, relative")] = 0.0
    lens: Annotated[
        float, Quantity("prior standard deviation of the shift of the farthest corner by the lens", "m")
    ] = 0.0
    radius_class: Annotated[float, Quantity("prior standard deviation of the error that a class shares", "m")] = 0.0
    radius_offset: Annotated[
        float, Quantity("prior standard deviation of the error that all radii share", "m", since=2)
    ] = 0.0
    radius_factor: Annotated[
        float, Quantity("prior standard deviation of a factor of all radii, relative", since=2, absent=0.0)
    ] = 0.0

    def __post_init__(self) -> None:
        given = (
            self.centre, self.radius, self.wall, self.wall_tilt, self.pixel_size, self.lens, self.radius_class,
            self.radius_offset, self.radius_factor,
        )  # fmt: skip
        if not min(given) >= 0.0:
            raise ValueError("a prior standard deviation is negative or not a number")


@dataclass(frozen=True, slots=True)
class CalibrationPairs:
    """Rows whose pair may touch after the correction."""

    rows: GapRows
    scale: Array  # (m,) [m] s_0, standard deviation of the gap by the prior errors
    stated_noise: Array  # (m,) [m] standard deviation of the gap by the stated noise of positions
    overlap: float  # [m] mean elastic overlap of a touching pair
    between_grains: NDArray[np.bool_]  # (m,)
    noise_factor: float = 1.0  # true over stated noise

    @property
    def position_noise(self) -> Array:
        """Standard deviation (m,) [m] of a gap by the noise of positions."""
        return self.noise_factor * self.stated_noise

    @property
    def noise(self) -> Array:
        """Standard deviation (m,) [m] of a touching gap by noise and elastic overlap."""
        return np.hypot(self.position_noise, self.overlap)

    def update_noise(self, gap: Array) -> CalibrationPairs:
        """Update the noise from corrected gaps (m,) [m]; it is never below the stated one.

        Notes
        -----
        noise_factor² = max(1, (w² − ō²)/⟨σ²⟩), w = `contact_width` of the gaps between grains, ō the overlap, ⟨σ²⟩ the
        mean square of the stated noise of a gap.
        """
        if not np.any(self.between_grains):
            return self
        excess = contact_width(gap[self.between_grains], self.overlap) ** 2 - self.overlap**2
        stated = np.mean(self.stated_noise[self.between_grains] ** 2)
        return replace(self, noise_factor=float(np.sqrt(max(1.0, excess / stated))))


def find_calibration_pairs(sequence: MeasuredSequence, priors: CalibrationPriors, overlap: float) -> CalibrationPairs:
    """List the pairs and frames that are fitted.

    Parameters
    ----------
    sequence : MeasuredSequence
    priors : CalibrationPriors
    overlap : float
        Mean elastic overlap [m] of a touching pair.

    Notes
    -----
    With σ_g² = σ_c² + σ_r² + σ_class² of a grain, s_0² = σ_g² + σ_h² between grains g and h, and σ_g² + σ_wall² +
    (σ_tilt L/2)² + σ_lens² at a wall of the greatest length L. Pairs with gaps below 4 s_0 + 6 (√2 σ_max + ō) are
    listed.
    """
    count = sequence.grain_count
    grain = _centre_prior(sequence, priors) ** 2 + priors.radius**2 + priors.radius_class**2
    half = 0.5 * float(_wall_length(sequence).max(initial=0.0))
    of_wall = priors.wall**2 + (half * priors.wall_tilt) ** 2 + priors.lens**2
    noise = np.sqrt(2.0) * float(sequence.sigma[sequence.present].max(initial=0.0)) + overlap
    widest = float(grain.max(initial=0.0))
    rows = find_gap_rows(
        sequence, REACH * np.sqrt(2.0 * widest) + REACH_OF_NOISE * noise,
        wall_reach=REACH * np.sqrt(widest + of_wall) + REACH_OF_NOISE * noise,
    )  # fmt: skip
    with_wall = rows.with_wall(count)
    start = np.sqrt(grain[rows.i] + np.where(with_wall, of_wall, grain[rows.second_grain(count)]))
    if sequence.centre_spread is not None:
        gap = measure_gaps(
            rows, sequence.position, sequence.endpoints, sequence.radius, sequence.side, sequence.cell
        ).gap
        near = gap < REACH * start + REACH_OF_NOISE * noise
        rows, with_wall, start = rows.select(near), with_wall[near], start[near]
    start = np.maximum(start, np.finfo(float).tiny)
    first = sequence.sigma[rows.frame, rows.i]
    second = np.where(with_wall, 0.0, sequence.sigma[rows.frame, rows.second_grain(count)])
    finest = FINEST_SURFACE * float(sequence.radius.mean())
    return CalibrationPairs(rows, start, np.sqrt(first**2 + second**2 + finest**2), overlap, ~with_wall)


def narrow_priors(
    equations: GapEquations, limits: CalibrationPriors, overlap: float
) -> tuple[CalibrationPriors, float]:
    """Reduce the priors of centres and radii to the width that the overlaps between grains show.

    Returns
    -------
    priors : CalibrationPriors
        `limits`, with those of centres and radii multiplied by min(1, ratio).
    ratio : float
        Width of the errors by the overlaps over that of `limits`; above 1 the limits are narrower than the data.

    Notes
    -----
    ratio² = max(w² − σ², (0.1 σ)²)/(2 (σ_c² + σ_r²)), w = `contact_width` of the gaps between grains, σ their noise.
    """
    given = np.sqrt(2.0) * np.hypot(limits.centre, limits.radius)
    candidates = find_calibration_pairs(equations.sequence, limits, overlap)
    between = candidates.between_grains
    if given == 0.0 or not np.any(between):
        return limits, 0.0
    gap = equations.measure(candidates.rows, np.zeros(equations.layout.count)).gap
    noise = float(np.sqrt(np.mean(candidates.noise[between] ** 2)))
    excess = contact_width(gap[between], overlap) ** 2 - noise**2
    ratio = float(np.sqrt(max(excess, (MIN_EXCESS * noise) ** 2))) / given
    fraction = min(1.0, ratio)
    return replace(limits, centre=fraction * limits.centre, radius=fraction * limits.radius), ratio


def reduce_priors(
    limits: CalibrationPriors, equations: GapEquations, unknowns: Array, draws: Array
) -> CalibrationPriors:
    """Update the prior variances of centres and radii by one step of expectation maximisation.

    Parameters
    ----------
    limits : CalibrationPriors
        Upper limits.
    equations : GapEquations
    unknowns : array (u,)
        The estimate.
    draws : array (d, u)
        Draws of its error.

    Notes
    -----
    σ² = ⟨û²⟩ + ⟨draw²⟩, means over all grains (and components, and draws), each over its expected spread.
    """

    def reduce(part: slice, limit: float, spread: Array | float = 1.0) -> float:
        if limit == 0.0:
            return 0.0
        errors, drawn = unknowns[part] / spread, draws[:, part] / spread
        return min(limit, float(np.sqrt(np.mean(errors**2) + np.mean(drawn**2))))

    layout, spread = equations.layout, equations.sequence.centre_spread
    of_centres = 1.0 if spread is None else np.repeat(spread, 2)
    centre = reduce(layout.offset, limits.centre, of_centres)
    return replace(limits, centre=centre, radius=reduce(layout.radius, limits.radius))


def _centre_prior(sequence: MeasuredSequence, priors: CalibrationPriors) -> Array:
    """Prior standard deviation (n,) [m] of a component of every centre."""
    spread = np.ones(sequence.grain_count) if sequence.centre_spread is None else sequence.centre_spread
    return np.minimum(priors.centre * spread, max(priors.centre, WIDEST_CENTRE * float(sequence.radius.mean())))


def _wall_length(sequence: MeasuredSequence) -> Array:
    return np.linalg.norm(sequence.endpoints[:, :, 1] - sequence.endpoints[:, :, 0], axis=2)


def prior_vector(equations: GapEquations, priors: CalibrationPriors) -> Array:
    """Return the prior standard deviation (u,) of every unknown."""
    layout = equations.layout
    sd = np.zeros(layout.count)
    sd[layout.offset] = np.repeat(_centre_prior(equations.sequence, priors), 2)
    sd[layout.radius] = priors.radius
    sd[layout.wall] = priors.wall
    sd[layout.radius_class] = priors.radius_class
    sd[layout.wall_tilt] = priors.wall_tilt
    sd[layout.scale] = priors.pixel_size
    sd[layout.lens] = priors.lens
    return sd
