"""Robust one-sided least squares on the gap equations, with priors whose width the sequence itself may reduce."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu

from solver.calibration_equations import GapEquations, GapRows, MeasuredSequence, find_gap_rows
from solver.grains import Array

ANNEALING_ROUNDS = 9  # bring s from the scale of the errors to that of the noise
REFINING_ROUNDS = 6  # at the scale of the noise; the priors follow the data here
LEAST_EXCESS = 0.1  # of the noise: constant errors below this cannot be told from none
ROUNDS = ANNEALING_ROUNDS + REFINING_ROUNDS
REACH = 4.0  # candidate pairs: gap below this many times the scale of the errors
REACH_OF_NOISE = 6.0  # … plus this many standard deviations of the noise
FINAL_SCALE = 2.0  # final s over the noise of a gap: below, noise above the contact is cut off and gaps turn too wide
ANNEALED_VARIANCE = 0.3  # a row's variance is at least this times s²: while s is large, so is the doubt in the model
NEGLIGIBLE_WEIGHT = 1e-3  # a row that counts less is left out of its round
OVERLAP_FRAMES = 15  # frames over which the elastic overlap of a contact is one random number, not many
DOUBT = 0.5  # the typical overlap, between grains and at walls apart, and the bias of the weights: known to this share
# Which pairs touch is not certain either, which the draws cannot know. Against simulated truths the errors
# are 0.75 to 1.2 times the standard deviations once these carry this factor.
SD_FACTOR = 1.2
PRIOR_SAMPLES = 8  # posterior draws that estimate a mean variance
FINEST_SURFACE = 1e-5  # of the mean radius: below this no real grain is round


@dataclass(frozen=True, slots=True)
class CalibrationPriors:
    """Standard deviations of the constant errors before the gaps are looked at. Zero: known exactly."""

    centre: float  # [m] of each component of a centre
    radius: float  # [m] of a radius, independent from grain to grain
    wall: float = 0.0  # [m] of a wall along its normal
    pixel_size: float = 0.0  # relative
    radius_class: float = 0.0  # [m] of the error that all grains of a class share

    def __post_init__(self) -> None:
        if not min(self.centre, self.radius, self.wall, self.pixel_size, self.radius_class) >= 0.0:
            raise ValueError("a prior standard deviation is negative or not a number")


@dataclass(frozen=True, slots=True)
class Candidates:
    """Rows whose pair may touch once it is corrected."""

    rows: GapRows
    scale: Array  # (m,) [m] what the constant errors may do to the gap: the initial s
    noise: Array  # (m,) [m] standard deviation of a touching gap by noise and overlap


@dataclass(frozen=True, slots=True)
class GapFit:
    """The unknowns that fit the gaps best, and what is needed to judge them."""

    unknowns: Array  # (u,) in the order of the layout
    sd: Array  # (u,) posterior standard deviations, zero where the unknown is held
    gap_sd: float  # [m] what the constant errors that are left do to the gap of a touching pair
    priors: CalibrationPriors  # as reduced by the data
    rows: GapRows
    gap_before: Array  # (m,) [m]
    gap_after: Array  # (m,) [m]
    noise: Array  # (m,) [m] standard deviation of a touching gap by noise and overlap
    rounds: int


def contact_width(gap: Array, overlap: float) -> float:
    """Estimate the standard deviation of the gaps of touching pairs, from their overlapping side alone [m].

    Open gaps lie on the other side and do not count. gap (m,) [m]; overlap [m] is the typical elastic one.
    """
    depth = -(gap + overlap)
    depth = depth[depth > 0.0]
    return float(np.median(depth)) / 0.6745 if len(depth) else 0.0  # 0.6745: median of |N(0, 1)|


def fit_gaps(
    equations: GapEquations, priors: CalibrationPriors, overlap: float, samples: int, rng: np.random.Generator
) -> GapFit:
    """Solve for all constant errors.

    The priors are upper limits for grains: the widths of centre and radius errors are reduced to what the
    gaps support (evidence maximisation), so that exact input is left as it is. overlap [m]: mean elastic
    overlap of a touching pair; samples: posterior draws behind the standard deviations.
    """
    sequence = equations.sequence
    unknowns = np.zeros(equations.layout.count)
    candidates = find_candidates(sequence, priors, overlap)
    rows, start, noise = candidates.rows, candidates.scale, candidates.noise
    before = equations.measure(rows, unknowns).gap
    limits = priors
    end = FINAL_SCALE * noise
    for number in range(ANNEALING_ROUNDS):
        annealed = number / ANNEALING_ROUNDS
        s = np.maximum(start ** (1.0 - annealed) * end**annealed, end)
        unknowns = _LinearStep(equations, rows, unknowns, s, noise, overlap, priors).solution()
    step = _LinearStep(equations, rows, unknowns, end, noise, overlap, priors)
    for _ in range(REFINING_ROUNDS - 1):
        unknowns = step.solution()
        priors = _reduce_priors(limits, priors, equations, unknowns, step.draw(PRIOR_SAMPLES, rng))
        step = _LinearStep(equations, rows, unknowns, end, noise, overlap, priors)
    unknowns = step.solution()
    draws = SD_FACTOR * step.draw(samples, rng)
    sd = np.minimum(np.sqrt(np.mean(draws**2, axis=0)), prior_vector(equations, priors))
    after = equations.measure(rows, unknowns).gap
    return GapFit(unknowns, sd, step.gap_spread(draws), priors, rows, before, after, noise, ROUNDS)


def narrow_priors(
    equations: GapEquations, limits: CalibrationPriors, overlap: float
) -> tuple[CalibrationPriors, float]:
    """Limit the priors of centres and radii to what the overlaps between grains allow.

    Returns the priors and the width of the errors that the overlaps suggest over the width that `limits`
    allow: above 1 the limits are narrower than the data.
    """
    given = np.sqrt(2.0) * np.hypot(limits.centre, limits.radius)
    candidates = find_candidates(equations.sequence, limits, overlap)
    between = ~candidates.rows.with_wall(equations.sequence.grain_count)
    if given == 0.0 or not np.any(between):
        return limits, 0.0
    gap = equations.measure(candidates.rows, np.zeros(equations.layout.count)).gap
    noise = float(np.sqrt(np.mean(candidates.noise[between] ** 2)))
    excess = contact_width(gap[between], overlap) ** 2 - noise**2
    ratio = float(np.sqrt(max(excess, (LEAST_EXCESS * noise) ** 2))) / given
    share = min(1.0, ratio)
    narrowed = replace(limits, centre=share * limits.centre, radius=share * limits.radius)
    return narrowed, ratio


def find_candidates(sequence: MeasuredSequence, priors: CalibrationPriors, overlap: float) -> Candidates:
    """List the pairs and frames that the fit looks at. overlap [m]: mean elastic overlap of a touching pair."""
    grain = priors.centre**2 + priors.radius**2 + priors.radius_class**2
    scale = (2.0 * sequence.radius.mean() * priors.pixel_size) ** 2
    pair, wall = np.sqrt(2.0 * grain + scale), np.sqrt(grain + priors.wall**2 + scale)
    noise = np.sqrt(2.0) * float(sequence.sigma[sequence.present].max(initial=0.0)) + overlap
    rows = find_gap_rows(
        sequence, REACH * pair + REACH_OF_NOISE * noise, wall_reach=REACH * wall + REACH_OF_NOISE * noise
    )
    start = np.where(rows.with_wall(sequence.grain_count), wall, pair)
    return Candidates(rows, np.maximum(start, np.finfo(float).tiny), _gap_noise(sequence, rows, overlap))


def prior_vector(equations: GapEquations, priors: CalibrationPriors) -> Array:
    """Prior standard deviation of every unknown (u,)."""
    layout = equations.layout
    sd = np.zeros(layout.count)
    sd[layout.offset] = priors.centre
    sd[layout.radius] = priors.radius
    sd[layout.wall] = priors.wall
    sd[layout.radius_class] = priors.radius_class
    sd[layout.scale] = priors.pixel_size
    return sd


class _LinearStep:
    """The normal equations of one round, factorised."""

    def __init__(
        self,
        equations: GapEquations,
        rows: GapRows,
        unknowns: Array,
        s: Array,
        noise: Array,
        overlap: float,
        priors: CalibrationPriors,
    ) -> None:
        geometry = equations.measure(rows, unknowns)
        weight = _one_sided_weight((geometry.gap + overlap) / s)
        kept = np.flatnonzero(weight > NEGLIGIBLE_WEIGHT)
        self._equations, self._overlap = equations, overlap
        self._rows, self._geometry = rows.select(kept), geometry.select(kept)
        self._prior_sd = prior_vector(equations, priors)
        self._free = self._prior_sd > 0.0
        self._weight = weight[kept]
        self._precision = self._weight / np.maximum(noise[kept] ** 2, ANNEALED_VARIANCE * s[kept] ** 2)
        self._matrix = equations.derive(self._rows, self._geometry, unknowns)[:, self._free]
        self._shift = _weighting_bias(s[kept], noise[kept], overlap)
        residual = self._geometry.gap + overlap + self._shift
        self._target = self._matrix @ unknowns[self._free] - residual
        weighted = self._matrix.multiply(self._precision[:, None]).tocsr()
        normal = self._matrix.T @ weighted + sparse.diags_array(self._prior_sd[self._free] ** -2.0)
        # Pairs of neighbours make an almost planar graph: a direct factorisation is cheap and exact.
        self._factor: SuperLU | None = None
        if not np.any(self._free):
            return
        self._factor = splu(
            sparse.csc_matrix(normal),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )

    def solution(self) -> Array:
        unknowns = np.zeros(len(self._free))
        if self._factor is None:
            return unknowns
        unknowns[self._free] = self._factor.solve(self._matrix.T @ (self._precision * self._target))
        return unknowns

    def gap_spread(self, errors: Array) -> float:
        """Root mean square [m] of what errors (count, u) of the unknowns do to the gaps of touching pairs."""
        touching = self._weight > 0.5
        if not np.any(touching):
            return 0.0
        return float(np.sqrt(np.mean((self._matrix[touching] @ errors[:, self._free].T) ** 2)))

    def draw(self, count: int, rng: np.random.Generator) -> Array:
        """Draw errors of the solution (count, u).

        Noise of a position enters all gaps of its grain in that frame, the overlap of a contact stays for
        several frames: the errors of the rows are drawn so, not one by one.
        """
        sequence, rows, normal = self._equations.sequence, self._rows, self._geometry.normal
        n = sequence.grain_count
        k, i, grain = rows.frame, rows.i, rows.second_grain(n)
        wall = rows.with_wall(n).astype(np.int64)
        other = 1.0 - wall[:, None]
        block = np.unique(rows.pair.astype(np.int64) * sequence.frame_count + k // OVERLAP_FRAMES, return_inverse=True)[
            1
        ]
        errors = np.zeros((count, len(self._free)))
        if self._factor is None:
            return errors
        sigma = np.where(sequence.present, sequence.sigma, 0.0)[..., None]
        for row in errors:
            noise = sigma * rng.standard_normal(sequence.position.shape)
            error = np.einsum("mk,mk->m", normal, other * noise[k, grain] - noise[k, i])
            error += self._overlap * rng.standard_normal(block.max(initial=-1) + 1)[block]
            error += DOUBT * (self._overlap * rng.standard_normal(2)[wall] + self._shift * rng.standard_normal())
            right = self._matrix.T @ (self._precision * error)
            right += rng.standard_normal(len(right)) / self._prior_sd[self._free]
            row[self._free] = self._factor.solve(right)
        return errors


def _one_sided_weight(excess: Array) -> Array:
    """Weight (m,) of gaps that exceed contact by `excess` (m,) times s; an overlap is never excused."""
    return (1.0 + np.maximum(excess, 0.0) ** 2) ** -2.0


def _weighting_bias(s: Array, noise: Array, overlap: float) -> Array:
    """How far below contact the weighted mean of the gaps of touching pairs lies (m,) [m].

    Noise that opens a gap is down-weighted, noise that closes it is not: without this shift all contacts
    would be drawn apart. Only noise of positions counts, which is as often positive as negative.
    """
    sigma = np.sqrt(np.maximum(noise**2 - overlap**2, 0.0))
    relative = sigma / s
    noise_value = np.linspace(-6.0, 6.0, 241)
    density = np.exp(-0.5 * noise_value**2)
    ratio = np.linspace(0.0, 1.0 / FINAL_SCALE, 41)  # σ / s never exceeds the last value
    weighted = _one_sided_weight(ratio[:, None] * noise_value) * density
    mean = weighted @ noise_value / weighted.sum(axis=1)
    return -sigma * np.interp(relative, ratio, mean)


def _gap_noise(sequence: MeasuredSequence, rows: GapRows, overlap: float) -> Array:
    sigma, k = sequence.sigma, rows.frame
    n = sequence.grain_count
    second = np.where(rows.with_wall(n), 0.0, sigma[k, rows.second_grain(n)])
    finest = FINEST_SURFACE * sequence.radius.mean()
    return np.sqrt(sigma[k, rows.i] ** 2 + second**2 + overlap**2 + finest**2)


def _reduce_priors(
    limits: CalibrationPriors, priors: CalibrationPriors, equations: GapEquations, unknowns: Array, draws: Array
) -> CalibrationPriors:
    """One step of expectation maximisation: prior variance = mean of (estimate² + posterior variance)."""
    layout = equations.layout

    def reduce(part: slice, limit: float) -> float:
        if limit == 0.0:
            return 0.0
        second_moment = np.mean(unknowns[part] ** 2) + np.mean(draws[:, part] ** 2)
        return min(limit, float(np.sqrt(second_moment)))

    return replace(priors, centre=reduce(layout.offset, limits.centre), radius=reduce(layout.radius, limits.radius))
