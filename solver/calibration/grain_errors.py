"""Constant errors of grains from gaps with known forces, which separate errors from overlap.

Without forces, a pair that always bears much looks like two grains with too large radii, and its overlap would be
corrected as an error. The motion determines the forces of every frame that it leads to, independently of the gaps; with
them each gap is the sum of constant errors, noise, and an overlap in proportion to its force.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..bodies.grains import Array
from ..robust_scale import NORMAL_MEDIAN
from .derivatives import Derivatives
from .equations import GapEquations
from .gap_error_draws import GapErrorDraws
from .gaps import GapRows, MeasuredSequence
from .normal_equations import Couplings, NormalEquations
from .weights import FINAL_SCALE

ROUNDS = 6  # of weights and noise
MIN_NOISE_FACTOR = 0.5  # lower limit: fewer gaps than unknowns fit too well
DRAWS = 100  # for every standard deviation: accurate to 7 %


@dataclass(frozen=True, slots=True)
class GrainErrors:
    """Constant errors of grains from known forces. Add the corrections to the measured values."""

    offset: Array  # (n, 2) [m] from measured to true centre, turning with the grain
    radius: Array  # (n,) [m] from given to true radius
    overlap: float  # [m/N] overlap per force
    draws: Array  # (d, 3 n) [m] draws of the remaining errors: offsets, then radii

    def gap_sd(self, sequence: MeasuredSequence, rows: GapRows) -> Array:
        """Compute the standard deviation (m,) [m] of gaps by the remaining constant errors, without noise."""
        equations = GapEquations(sequence)
        derivatives = _of_grains(equations, rows, np.zeros(equations.layout.count))
        return np.sqrt(np.mean([derivatives.times(each) ** 2 for each in self.draws], axis=0))


def find_grain_errors(
    sequence: MeasuredSequence,
    rows: GapRows,
    force: Array,
    *,
    centre: float,
    radius: float,
    rng: np.random.Generator,
) -> GrainErrors:
    """Estimate the constant errors of centres and radii from gaps of pairs with known forces.

    Parameters
    ----------
    sequence : MeasuredSequence
        Measured positions, rotations and radii.
    rows : GapRows
        Pairs and frames (m) with known forces.
    force : array (m,)
        Their normal forces f [N].
    centre, radius : float
        Prior standard deviations [m] of the errors; zero: exact.
    rng : numpy.random.Generator
        Random numbers of the draws.

    Raises
    ------
    ValueError
        Without rows, or if both standard deviations are zero.

    Notes
    -----
    With A the derivatives of the gaps g with respect to offsets o and radii δR, x = (o, δR), κ the overlap per force,

        min Σ p (g + A x + κ f)² + Σ x²/σ_x²,   p = (1 + (r/(4 σ))²)⁻²/σ²,

    in six rounds, the first with p = σ⁻² and the stated σ. r is the residual of the round before and σ the stated noise
    of the gap times max(median|r/σ_stated|/0.6745, 0.5). Draws as in `_Step.draw`.
    """
    equations = GapEquations(sequence)
    n, unknowns = sequence.grain_count, np.zeros(equations.layout.count)
    prior = np.concatenate([np.full(2 * n, centre), np.full(n, radius)])
    free = prior > 0.0
    if rows.count == 0 or not free.any():
        raise ValueError("no gap has a known force, or both prior standard deviations are zero")
    unit = float(np.mean(force))
    geometry = equations.measure(rows, unknowns)
    gap = geometry.gap
    of_grains = _of_grains(equations, rows, unknowns)
    matrix = of_grains._replace(
        column=np.zeros((rows.count, 1), np.int64), value=force[:, None] / unit, shared_count=1
    )  # fmt: skip
    with np.errstate(divide="ignore"):
        penalty = np.append(prior**-2.0, 0.0)  # infinite: exact
    matrix, couplings = matrix.restrict_to(np.isfinite(penalty)), Couplings.of(n, of_grains.first, of_grains.second)
    stated = _stated_noise(sequence, rows)
    factor, step = 1.0, _Step.of(matrix, couplings, gap, penalty, stated**-2.0)
    for _ in range(ROUNDS - 1):
        factor = max(float(np.median(np.abs(step.residual) / stated)) / NORMAL_MEDIAN, MIN_NOISE_FACTOR)
        noise = factor * stated
        weight = (1.0 + (step.residual / (2.0 * FINAL_SCALE * noise)) ** 2) ** -2.0  # less weight for wrong forces
        step = _Step.of(matrix, couplings, gap, penalty, weight / noise**2)
    gap_errors = GapErrorDraws(sequence, rows, geometry.normal, factor)
    errors = step.draw(np.array([gap_errors.draw(rng) for _ in range(DRAWS)]), rng)
    offset, radii = step.found[: 2 * n].reshape(n, 2), step.found[2 * n : -1]
    return GrainErrors(offset, radii, float(step.found[-1]) / unit, errors[:, :-1])


@dataclass(frozen=True, slots=True)
class _Step:
    """Penalised least squares of one round: minimise Σ precision (gap + A x)² + Σ penalty x²."""

    matrix: Derivatives  # A (m, u)
    penalty: Array  # (u,)
    precision: Array  # (m,)
    normal: NormalEquations
    found: Array  # x (u,)
    residual: Array  # (m,) [m]

    @classmethod
    def of(cls, matrix: Derivatives, couplings: Couplings, gap: Array, penalty: Array, precision: Array) -> _Step:
        normal = NormalEquations(matrix, couplings, precision, penalty)
        found = normal.solve(-matrix.transposed_times(precision * gap))
        return cls(matrix, penalty, precision, normal, found, gap + matrix.times(found))

    def draw(self, noise: Array, rng: np.random.Generator) -> Array:
        """Draw errors (d, u) of x: (AᵀPA + D)⁻¹ (AᵀP e + D^½ ξ), with errors e (d, m) of the gaps and ξ ~ N(0, I)."""
        root_penalty = np.sqrt(np.where(np.isfinite(self.penalty), self.penalty, 0.0))
        draws = []
        for each in noise:
            right = self.matrix.transposed_times(self.precision * each) + root_penalty * rng.standard_normal(
                len(root_penalty)
            )
            draws.append(self.normal.solve(right))
        return np.array(draws)


def _of_grains(equations: GapEquations, rows: GapRows, unknowns: Array) -> Derivatives:
    """Compute the derivatives (m, 3 n) of the gaps with respect to offsets and radii."""
    every = equations.derive(rows, equations.measure(rows, unknowns), np.zeros(equations.layout.count, np.bool_))
    return every._replace(column=every.column[:, :0], value=every.value[:, :0], shared_count=0)


def _stated_noise(sequence: MeasuredSequence, rows: GapRows) -> Array:
    """Compute the standard deviation (m,) [m] of the gaps by the stated noise of positions."""
    n = sequence.grain_count
    second = np.where(rows.with_wall(n), 0.0, sequence.sigma[rows.frame, rows.second_grain(n)])
    return np.hypot(sequence.sigma[rows.frame, rows.i], second)
