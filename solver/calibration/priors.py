"""What is thought of the constant errors before and while the gaps are looked at, and which gaps may matter then."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.bodies.quantity import Quantity
from solver.calibration.equations import GapEquations
from solver.calibration.gaps import GapRows, MeasuredSequence, find_gap_rows
from solver.calibration.weights import contact_width

REACH = 4.0  # candidate pairs: gap below this many times the scale of the errors
REACH_OF_NOISE = 6.0  # … plus this many standard deviations of the noise
LEAST_EXCESS = 0.1  # of the noise: constant errors below this cannot be told from none
FINEST_SURFACE = 1e-5  # of the mean radius: below this no real grain is round


@dataclass(frozen=True, slots=True)
class CalibrationPriors:
    """Standard deviations of the constant errors before the gaps are looked at. Zero: known exactly."""

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

    def __post_init__(self) -> None:
        given = (
            self.centre, self.radius, self.wall, self.wall_tilt, self.pixel_size, self.lens, self.radius_class,
            self.radius_offset,
        )  # fmt: skip
        if not min(given) >= 0.0:
            raise ValueError("a prior standard deviation is negative or not a number")


@dataclass(frozen=True, slots=True)
class Candidates:
    """Rows whose pair may touch once it is corrected."""

    rows: GapRows
    scale: Array  # (m,) [m] what the constant errors may do to the gap: the initial s
    stated_noise: Array  # (m,) [m] what the stated noise of positions does to the gap
    overlap: float  # [m] mean elastic overlap of a touching pair
    between_grains: NDArray[np.bool_]  # (m,)
    noise_factor: float = 1.0  # true over stated noise

    @property
    def position_noise(self) -> Array:
        """Standard deviation of a gap by the noise of positions (m,) [m]."""
        return self.noise_factor * self.stated_noise

    @property
    def noise(self) -> Array:
        """Standard deviation of the gap of a touching pair, by noise and elastic overlap (m,) [m]."""
        return np.hypot(self.position_noise, self.overlap)

    def judge_noise(self, gap: Array) -> Candidates:
        """Raise the noise where gaps (m,) [m] scatter more than stated; few photographs cannot show less."""
        if not np.any(self.between_grains):
            return self
        excess = contact_width(gap[self.between_grains], self.overlap) ** 2 - self.overlap**2
        stated = np.mean(self.stated_noise[self.between_grains] ** 2)
        return replace(self, noise_factor=float(np.sqrt(max(1.0, excess / stated))))


def find_candidates(sequence: MeasuredSequence, priors: CalibrationPriors, overlap: float) -> Candidates:
    """List the pairs and frames that the fit looks at. overlap [m]: mean elastic overlap of a touching pair."""
    grain = priors.centre**2 + priors.radius**2 + priors.radius_class**2
    half = 0.5 * float(_wall_length(sequence).max(initial=0.0))
    pair = np.sqrt(2.0 * grain)
    wall = np.sqrt(grain + priors.wall**2 + (half * priors.wall_tilt) ** 2 + priors.lens**2)
    noise = np.sqrt(2.0) * float(sequence.sigma[sequence.present].max(initial=0.0)) + overlap
    rows = find_gap_rows(
        sequence, REACH * pair + REACH_OF_NOISE * noise, wall_reach=REACH * wall + REACH_OF_NOISE * noise
    )
    with_wall = rows.with_wall(sequence.grain_count)
    start = np.maximum(np.where(with_wall, wall, pair), np.finfo(float).tiny)
    first = sequence.sigma[rows.frame, rows.i]
    second = np.where(with_wall, 0.0, sequence.sigma[rows.frame, rows.second_grain(sequence.grain_count)])
    finest = FINEST_SURFACE * float(sequence.radius.mean())
    return Candidates(rows, start, np.sqrt(first**2 + second**2 + finest**2), overlap, ~with_wall)


def narrow_priors(
    equations: GapEquations, limits: CalibrationPriors, overlap: float
) -> tuple[CalibrationPriors, float]:
    """Limit the priors of centres and radii to what the overlaps between grains allow.

    Returns the priors and the width of the errors that the overlaps suggest over the width that `limits`
    allow: above 1 the limits are narrower than the data.
    """
    given = np.sqrt(2.0) * np.hypot(limits.centre, limits.radius)
    candidates = find_candidates(equations.sequence, limits, overlap)
    between = candidates.between_grains
    if given == 0.0 or not np.any(between):
        return limits, 0.0
    gap = equations.measure(candidates.rows, np.zeros(equations.layout.count)).gap
    noise = float(np.sqrt(np.mean(candidates.noise[between] ** 2)))
    excess = contact_width(gap[between], overlap) ** 2 - noise**2
    ratio = float(np.sqrt(max(excess, (LEAST_EXCESS * noise) ** 2))) / given
    share = min(1.0, ratio)
    return replace(limits, centre=share * limits.centre, radius=share * limits.radius), ratio


def reduce_priors(
    limits: CalibrationPriors, equations: GapEquations, unknowns: Array, draws: Array
) -> CalibrationPriors:
    """One step of expectation maximisation: prior variance of centres and radii = mean (estimate² + variance).

    unknowns (u,) is the estimate, draws (d, u) are samples of its error; the result never exceeds `limits`.
    """

    def reduce(part: slice, limit: float) -> float:
        if limit == 0.0:
            return 0.0
        return min(limit, float(np.sqrt(np.mean(unknowns[part] ** 2) + np.mean(draws[:, part] ** 2))))

    layout = equations.layout
    return replace(limits, centre=reduce(layout.offset, limits.centre), radius=reduce(layout.radius, limits.radius))


def _wall_length(sequence: MeasuredSequence) -> Array:
    return np.linalg.norm(sequence.endpoints[:, :, 1] - sequence.endpoints[:, :, 0], axis=2)


def prior_vector(equations: GapEquations, priors: CalibrationPriors) -> Array:
    """Prior standard deviation of every unknown (u,)."""
    layout = equations.layout
    sd = np.zeros(layout.count)
    sd[layout.offset] = priors.centre
    sd[layout.radius] = priors.radius
    sd[layout.wall] = priors.wall
    sd[layout.radius_class] = priors.radius_class
    sd[layout.wall_tilt] = priors.wall_tilt
    sd[layout.scale] = priors.pixel_size
    sd[layout.lens] = priors.lens
    return sd
