"""Robust one-sided least squares on the gap equations, iteratively re-weighted, with posterior draws.

Notes
-----
With g(u) the corrected gaps of the candidate pairs, A their derivatives, ō the typical elastic overlap, σ the standard
deviation of a gap by noise and overlap, β(s) the bias of the weights and σ_u the priors, one round from u_0 solves

    min_u Σ p (g(u_0) + A (u − u_0) + ō + β)² + Σ u²/σ_u²,   p = W((g(u_0) + ō)/s)/max(σ², 0.3 s²),

with W by `weigh_gaps`. In the nine annealing rounds k = 0 … 8, which read at most sixteen photographs,
s = s_0^(1 − k/9) (2 σ)^(k/9), where s_0 is the standard deviation of a gap by the prior errors. In six more, s = 2 σ,
and after each the noise and the priors are updated (`priors`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array
from .equations import GapEquations
from .gap_error_draws import GapErrorDraws
from .normal_equations import Couplings, NormalEquations
from .priors import CalibrationPairs, CalibrationPriors, find_calibration_pairs, prior_vector, reduce_priors
from .weights import FINAL_SCALE, weigh_gaps, weighting_bias

ANNEALING_ROUNDS = 9  # reduce s from the scale of the errors to that of the noise
REFINING_ROUNDS = 6  # at the scale of the noise, with updates of noise and priors
ANNEALING_FRAMES = 16  # photographs that suffice to come near the solution, evenly spaced
ROUNDS = ANNEALING_ROUNDS + REFINING_ROUNDS
ANNEALED_VARIANCE = 0.3  # lower limit of a row's variance, over s²: model errors are large while s is
NEGLIGIBLE_WEIGHT = 1e-3  # rows of smaller weight are left out of a round
TOUCHING_WEIGHT = 0.5  # rows of greater weight count as contacts
OVERLAP_FRAMES = 15  # frames over which the elastic overlap of a contact is constant in the draws
SYSTEMATIC_SD = 0.5  # relative standard deviation of the typical overlaps and of the bias of the weights
# The draws do not contain the uncertainty of which pairs touch. Against simulated truths the errors are 0.57 to 1.16
# times the standard deviations with this factor.
SD_FACTOR = 1.2
PRIOR_SAMPLES = 4  # posterior draws that estimate a mean variance


@dataclass(frozen=True, slots=True)
class GapFit:
    """The best-fitting unknowns, their standard deviations, and the gaps before and after."""

    unknowns: Array  # (u,) in the order of the layout
    sd: Array  # (u,) posterior standard deviations, zero where the unknown is held
    gap_sd: float  # [m] standard deviation of a touching gap by the remaining constant errors
    priors: CalibrationPriors  # as reduced by the data
    candidates: CalibrationPairs  # with the measured noise
    gap_before: Array  # (m,) [m] of the candidates
    gap_after: Array  # (m,) [m]
    touching: NDArray[np.bool_]  # (m,) rows that count as contacts


def fit_gaps(
    equations: GapEquations, priors: CalibrationPriors, overlap: float, samples: int, rng: np.random.Generator
) -> GapFit:
    """Solve for all constant errors.

    Parameters
    ----------
    equations : GapEquations
        Gaps and derivatives of the sequence.
    priors : CalibrationPriors
        Priors; those of centres and radii are upper limits, reduced to the width that the gaps support (evidence
        maximisation), so that exact input stays as it is.
    overlap : float
        Mean elastic overlap [m] of a touching pair.
    samples : int
        Posterior draws for the standard deviations.
    rng : numpy.random.Generator
        Random numbers of the draws.

    Returns
    -------
    GapFit
        The solution; the stated noise is raised to that of the corrected gaps.

    Notes
    -----
    The equations of a round stand in the module's docstring. Standard deviations are 1.2 times the rms of the draws of
    `_LinearStep.draw`, at most the prior's.
    """
    few = equations.thinned(ANNEALING_FRAMES)
    pairs = _find_pairs(few, priors, overlap)
    unknowns = _anneal(few, *pairs, priors)
    candidates, couplings = pairs if few is equations else _find_pairs(equations, priors, overlap)
    rows, limits = candidates.rows, priors
    before = equations.measure(rows, np.zeros_like(unknowns)).gap
    step = _LinearStep(equations, candidates, couplings, unknowns, FINAL_SCALE * candidates.noise, priors)
    for _ in range(REFINING_ROUNDS - 1):
        unknowns = step.solution()
        # Overlaps of contacts are part of the estimates already: drawn again, they would widen the priors twice.
        priors = reduce_priors(limits, equations, unknowns, step.draw(PRIOR_SAMPLES, rng, with_overlaps=False))
        candidates = candidates.update_noise(equations.measure(rows, unknowns).gap)
        step = _LinearStep(equations, candidates, couplings, unknowns, FINAL_SCALE * candidates.noise, priors)
    unknowns = step.solution()
    draws = SD_FACTOR * step.draw(samples, rng)
    sd = np.minimum(np.sqrt(np.mean(draws**2, axis=0)), prior_vector(equations, priors))
    after = equations.measure(rows, unknowns).gap
    return GapFit(unknowns, sd, step.gap_rms(draws), priors, candidates, before, after, step.touching)


def _find_pairs(
    equations: GapEquations, priors: CalibrationPriors, overlap: float
) -> tuple[CalibrationPairs, Couplings]:
    """Find the candidate pairs, and the pattern of their normal equations."""
    candidates, n = find_calibration_pairs(equations.sequence, priors, overlap), equations.sequence.grain_count
    return candidates, Couplings.of(n, candidates.rows.i, candidates.rows.second_grain(n))


def _anneal(
    equations: GapEquations, candidates: CalibrationPairs, couplings: Couplings, priors: CalibrationPriors
) -> Array:
    """Approach the solution (u,) while the scale of the weights goes from that of the errors to that of the noise."""
    unknowns = np.zeros(equations.layout.count)
    end = FINAL_SCALE * candidates.noise
    for number in range(ANNEALING_ROUNDS):
        annealed = number / ANNEALING_ROUNDS
        s = np.maximum(candidates.scale ** (1.0 - annealed) * end**annealed, end)
        unknowns = _LinearStep(equations, candidates, couplings, unknowns, s, priors).solution()
    return unknowns


class _LinearStep:
    """The normal equations of one round, factorised."""

    def __init__(
        self,
        equations: GapEquations,
        candidates: CalibrationPairs,
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
        self._matrix = equations.derive(self._rows, self._geometry, self._free).restrict_to(self._free)
        self._shift = weighting_bias(s[kept], candidates.position_noise[kept])
        residual = self._geometry.gap + overlap + self._shift
        self._target = self._matrix.times(unknowns) - residual
        self._normal: NormalEquations | None = None
        if np.any(self._free):
            with np.errstate(divide="ignore"):
                penalty = self._prior_sd**-2.0  # infinite: held at zero
            self._normal = NormalEquations(self._matrix, couplings.select(kept), self._precision, penalty)

    def solution(self) -> Array:
        if self._normal is None:
            return np.zeros(len(self._free))
        return self._normal.solve(self._matrix.transposed_times(self._precision * self._target))

    def gap_rms(self, errors: Array) -> float:
        """Compute the rms change [m] of the gaps of touching pairs by errors (count, u) of the unknowns."""
        touching = self._weight > TOUCHING_WEIGHT
        if not np.any(touching):
            return 0.0
        matrix = self._matrix.select(touching)
        return float(np.sqrt(np.mean([np.mean(matrix.times(each) ** 2) for each in errors])))

    def draw(self, count: int, rng: np.random.Generator, *, with_overlaps: bool = True) -> Array:
        """Draw errors (count, u) of the solution.

        Parameters
        ----------
        count : int
            Number of draws.
        rng : numpy.random.Generator
            Random numbers.
        with_overlaps : bool
            Include the uncertainty of elastic overlaps and of the bias of the weights.

        Notes
        -----
        x = (AᵀPA + D)⁻¹ (AᵀP e + D^½ ξ), D = diag(σ_u⁻²), ξ ~ N(0, I). The errors e of the gaps are correlated: noise
        of a position enters all gaps of its grain in that frame, and the overlap of a contact is one normal number of
        standard deviation ō for 15 frames; a common error ½ ō of all gaps between grains, another of all gaps at walls,
        and a relative error ½ of the bias β are added.
        """
        sequence, rows, overlap = self._equations.sequence, self._rows, self._candidates.overlap
        wall = rows.with_wall(sequence.grain_count).astype(np.int64)
        episode = rows.pair.astype(np.int64) * sequence.frame_count + rows.frame // OVERLAP_FRAMES  # ascending
        block = np.cumsum(np.diff(episode, prepend=episode[:1]) != 0)
        errors = np.zeros((count, len(self._free)))
        if self._normal is None:
            return errors
        noise = GapErrorDraws(sequence, rows, self._geometry.normal, self._candidates.noise_factor)
        freedom = np.count_nonzero(self._free)
        for row in errors:
            error = noise.draw(rng)
            if with_overlaps:
                error += overlap * rng.standard_normal(block.max(initial=-1) + 1)[block]
                error += SYSTEMATIC_SD * (overlap * rng.standard_normal(2)[wall] + self._shift * rng.standard_normal())
            right = self._matrix.transposed_times(self._precision * error)
            right[self._free] += rng.standard_normal(freedom) / self._prior_sd[self._free]
            row[:] = self._normal.solve(right)
        return errors
