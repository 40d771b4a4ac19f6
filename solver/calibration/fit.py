"""Robust one-sided least squares on the gap equations, iteratively re-weighted, with posterior draws."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.calibration.equations import GapEquations
from solver.calibration.gap_noise import GapNoise
from solver.calibration.normal_equations import Couplings, NormalEquations
from solver.calibration.priors import CalibrationPriors, Candidates, find_candidates, prior_vector, reduce_priors
from solver.calibration.weights import FINAL_SCALE, weigh_gaps, weighting_bias

ANNEALING_ROUNDS = 9  # bring s from the scale of the errors to that of the noise
REFINING_ROUNDS = 6  # at the scale of the noise; noise and priors follow the data here
ROUNDS = ANNEALING_ROUNDS + REFINING_ROUNDS
ANNEALED_VARIANCE = 0.3  # a row's variance is at least this times s²: while s is large, so is the doubt in the model
NEGLIGIBLE_WEIGHT = 1e-3  # a row that counts less is left out of its round
TOUCHING_WEIGHT = 0.5  # a row that counts more is taken for a contact
OVERLAP_FRAMES = 15  # frames over which the elastic overlap of a contact is one random number, not many
DOUBT = 0.5  # the typical overlap, between grains and at walls apart, and the bias of the weights: known to this share
# Which pairs touch is not certain either, which the draws cannot know. Against simulated truths the errors
# are 0.57 to 1.16 times the standard deviations once these carry this factor.
SD_FACTOR = 1.2
PRIOR_SAMPLES = 8  # posterior draws that estimate a mean variance


@dataclass(frozen=True, slots=True)
class GapFit:
    """The unknowns that fit the gaps best, and what is needed to judge them."""

    unknowns: Array  # (u,) in the order of the layout
    sd: Array  # (u,) posterior standard deviations, zero where the unknown is held
    gap_sd: float  # [m] what the constant errors that are left do to the gap of a touching pair
    priors: CalibrationPriors  # as reduced by the data
    candidates: Candidates  # with the noise as the data show it
    gap_before: Array  # (m,) [m] of the candidates
    gap_after: Array  # (m,) [m]
    touching: NDArray[np.bool_]  # (m,) taken for contacts


def fit_gaps(
    equations: GapEquations, priors: CalibrationPriors, overlap: float, samples: int, rng: np.random.Generator
) -> GapFit:
    """Solve for all constant errors.

    The priors are upper limits for grains: the widths of centre and radius errors are reduced to what the
    gaps support (evidence maximisation), so that exact input is left as it is. The stated noise is raised to
    what the corrected gaps show. overlap [m]: mean elastic overlap of a touching pair; samples: posterior
    draws behind the standard deviations.
    """
    unknowns = np.zeros(equations.layout.count)
    candidates = find_candidates(equations.sequence, priors, overlap)
    rows, limits = candidates.rows, priors
    before = equations.measure(rows, unknowns).gap
    n = equations.sequence.grain_count
    couplings = Couplings.of(n, rows.i, rows.second_grain(n))
    end = FINAL_SCALE * candidates.noise
    for number in range(ANNEALING_ROUNDS):
        annealed = number / ANNEALING_ROUNDS
        s = np.maximum(candidates.scale ** (1.0 - annealed) * end**annealed, end)
        unknowns = _LinearStep(equations, candidates, couplings, unknowns, s, priors).solution()
    step = _LinearStep(equations, candidates, couplings, unknowns, end, priors)
    for _ in range(REFINING_ROUNDS - 1):
        unknowns = step.solution()
        # Overlaps of contacts show in the estimates already: drawn again, they would widen the priors twice.
        priors = reduce_priors(limits, equations, unknowns, step.draw(PRIOR_SAMPLES, rng, surfaces=False))
        candidates = candidates.judge_noise(equations.measure(rows, unknowns).gap)
        step = _LinearStep(equations, candidates, couplings, unknowns, FINAL_SCALE * candidates.noise, priors)
    unknowns = step.solution()
    draws = SD_FACTOR * step.draw(samples, rng)
    sd = np.minimum(np.sqrt(np.mean(draws**2, axis=0)), prior_vector(equations, priors))
    after = equations.measure(rows, unknowns).gap
    return GapFit(unknowns, sd, step.gap_spread(draws), priors, candidates, before, after, step.touching)


class _LinearStep:
    """The normal equations of one round, factorised."""

    def __init__(
        self,
        equations: GapEquations,
        candidates: Candidates,
        couplings: Couplings,
        unknowns: Array,
        s: Array,
        priors: CalibrationPriors,
    ) -> None:
        rows, overlap = candidates.rows, candidates.overlap
        geometry = equations.measure(rows, unknowns)
        weight = weigh_gaps((geometry.gap + overlap) / s)
        kept = np.flatnonzero(weight > NEGLIGIBLE_WEIGHT)
        self._equations, self._candidates = equations, candidates
        self._rows, self._geometry = rows.select(kept), geometry.select(kept)
        self._prior_sd = prior_vector(equations, priors)
        self._free = self._prior_sd > 0.0
        self._weight = weight[kept]
        self.touching = weight > TOUCHING_WEIGHT
        self._precision = self._weight / np.maximum(candidates.noise[kept] ** 2, ANNEALED_VARIANCE * s[kept] ** 2)
        self._matrix = equations.derive(self._rows, self._geometry, self._free).of_unknowns(self._free)
        self._shift = weighting_bias(s[kept], candidates.position_noise[kept])
        residual = self._geometry.gap + overlap + self._shift
        self._target = self._matrix.times(unknowns) - residual
        self._normal: NormalEquations | None = None
        if np.any(self._free):
            with np.errstate(divide="ignore"):
                penalty = self._prior_sd**-2.0  # infinite of what is held
            self._normal = NormalEquations(self._matrix, couplings.select(kept), self._precision, penalty)

    def solution(self) -> Array:
        if self._normal is None:
            return np.zeros(len(self._free))
        return self._normal.solve(self._matrix.transposed_times(self._precision * self._target))

    def gap_spread(self, errors: Array) -> float:
        """Root mean square [m] of what errors (count, u) of the unknowns do to the gaps of touching pairs."""
        touching = self._weight > TOUCHING_WEIGHT
        if not np.any(touching):
            return 0.0
        matrix = self._matrix.select(touching)
        return float(np.sqrt(np.mean([np.mean(matrix.times(each) ** 2) for each in errors])))

    def draw(self, count: int, rng: np.random.Generator, *, surfaces: bool = True) -> Array:
        """Draw errors of the solution (count, u); surfaces: with what is not known of overlaps and of the weights.

        Noise of a position enters all gaps of its grain in that frame, the overlap of a contact stays for
        several frames: the errors of the rows are drawn so, not one by one.
        """
        sequence, rows, overlap = self._equations.sequence, self._rows, self._candidates.overlap
        wall = rows.with_wall(sequence.grain_count).astype(np.int64)
        episode = rows.pair.astype(np.int64) * sequence.frame_count + rows.frame // OVERLAP_FRAMES  # ascending
        block = np.cumsum(np.diff(episode, prepend=episode[:1]) != 0)
        errors = np.zeros((count, len(self._free)))
        if self._normal is None:
            return errors
        noise = GapNoise(sequence, rows, self._geometry.normal, self._candidates.noise_factor)
        freedom = np.count_nonzero(self._free)
        for row in errors:
            error = noise.draw(rng)
            if surfaces:
                error += overlap * rng.standard_normal(block.max(initial=-1) + 1)[block]
                error += DOUBT * (overlap * rng.standard_normal(2)[wall] + self._shift * rng.standard_normal())
            right = self._matrix.transposed_times(self._precision * error)
            right[self._free] += rng.standard_normal(freedom) / self._prior_sd[self._free]
            row[:] = self._normal.solve(right)
        return errors
