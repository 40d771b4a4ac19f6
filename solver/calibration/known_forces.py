"""Constant errors of grains, once the forces are known: what overlaps by force is no error.

Where nothing is known of forces, a pair that always bears much looks like two grains that are told too large, and its
overlap is explained away. Motion tells the forces of every frame that it leads to, whatever the gaps say; with them
each gap is error, noise and overlap in proportion to its force. What is left may be told for every pair.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.bodies.grains import Array
from solver.calibration.derivatives import Derivatives
from solver.calibration.equations import GapEquations
from solver.calibration.gap_noise import GapNoise
from solver.calibration.gaps import GapRows, MeasuredSequence
from solver.calibration.normal_equations import Couplings, NormalEquations
from solver.calibration.weights import FINAL_SCALE, NORMAL_MEDIAN

ROUNDS = 6  # of weights and noise
LEAST_NOISE = 0.5  # times that stated: fewer gaps than unknowns fit too well
DRAWS = 100  # behind every standard deviation: known to 7 %


@dataclass(frozen=True, slots=True)
class GrainErrors:
    """What a sequence with known forces tells of its grains. Add the corrections to what was measured."""

    offset: Array  # (n, 2) [m] from measured to true centre, turning with the grain
    radius: Array  # (n,) [m] from given to true radius
    overlap: float  # [m/N] of a pair, by the force that it bears
    draws: Array  # (d, 3 n) [m] of what is left: offsets, then radii

    def gap_deviation(self, sequence: MeasuredSequence, rows: GapRows) -> Array:
        """Standard deviation (m,) [m] of what is left in the gaps of `rows`, noise of their frame apart."""
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
    """Find the constant errors of centres and radii from gaps of pairs that bear known forces.

    rows: such pairs and frames (m); force (m,) [N] normal forces; centre, radius [m]: standard deviations of the errors
    beforehand, zero: exact. Errors: ValueError without rows, or where both are zero.
    """
    equations = GapEquations(sequence)
    n, unknowns = sequence.grain_count, np.zeros(equations.layout.count)
    prior = np.concatenate([np.full(2 * n, centre), np.full(n, radius)])
    free = prior > 0.0
    if rows.count == 0 or not free.any():
        raise ValueError("no gap with a known force, or nothing that could be wrong")
    unit = float(np.mean(force))
    geometry = equations.measure(rows, unknowns)
    gap = geometry.gap
    of_grains = _of_grains(equations, rows, unknowns)
    matrix = of_grains._replace(
        column=np.zeros((rows.count, 1), np.int64), value=force[:, None] / unit, shared_count=1
    )  # fmt: skip
    with np.errstate(divide="ignore"):
        penalty = np.append(prior**-2.0, 0.0)  # infinite of what is exact
    matrix, couplings = matrix.of_unknowns(np.isfinite(penalty)), Couplings.of(n, of_grains.first, of_grains.second)
    stated = _stated_noise(sequence, rows)
    factor, step = 1.0, _Step.of(matrix, couplings, gap, penalty, stated**-2.0)
    for _ in range(ROUNDS - 1):
        factor = max(float(np.median(np.abs(step.left) / stated)) / NORMAL_MEDIAN, LEAST_NOISE)
        noise = factor * stated
        weight = (1.0 + (step.left / (2.0 * FINAL_SCALE * noise)) ** 2) ** -2.0  # a pair with a wrong force says little
        step = _Step.of(matrix, couplings, gap, penalty, weight / noise**2)
    noise_of_gaps = GapNoise(sequence, rows, geometry.normal, factor)
    errors = step.draw(np.array([noise_of_gaps.draw(rng) for _ in range(DRAWS)]), rng)
    offset, radii = step.found[: 2 * n].reshape(n, 2), step.found[2 * n : -1]
    return GrainErrors(offset, radii, float(step.found[-1]) / unit, errors[:, :-1])


@dataclass(frozen=True, slots=True)
class _Step:
    """Penalised least squares of one round: |gap + A x|² by precision, |x|² by penalty."""

    matrix: Derivatives  # A (m, u)
    penalty: Array  # (u,)
    precision: Array  # (m,)
    normal: NormalEquations
    found: Array  # x (u,)
    left: Array  # (m,) [m]

    @classmethod
    def of(cls, matrix: Derivatives, couplings: Couplings, gap: Array, penalty: Array, precision: Array) -> _Step:
        normal = NormalEquations(matrix, couplings, precision, penalty)
        found = normal.solve(-matrix.transposed_times(precision * gap))
        return cls(matrix, penalty, precision, normal, found, gap + matrix.times(found))

    def draw(self, noise: Array, rng: np.random.Generator) -> Array:
        """Draw errors of x (d, u) from errors of the gaps (d, m) and what was thought beforehand."""
        before = np.sqrt(np.where(np.isfinite(self.penalty), self.penalty, 0.0))
        draws = []
        for each in noise:
            right = self.matrix.transposed_times(self.precision * each) + before * rng.standard_normal(len(before))
            draws.append(self.normal.solve(right))
        return np.array(draws)


def _of_grains(equations: GapEquations, rows: GapRows, unknowns: Array) -> Derivatives:
    """Derivatives (m, 3 n) of the gaps by offsets and radii."""
    every = equations.derive(rows, equations.measure(rows, unknowns), np.zeros(equations.layout.count, np.bool_))
    return every._replace(column=every.column[:, :0], value=every.value[:, :0], shared_count=0)


def _stated_noise(sequence: MeasuredSequence, rows: GapRows) -> Array:
    """Standard deviation of the gaps (m,) [m] by the noise of positions."""
    n = sequence.grain_count
    second = np.where(rows.with_wall(n), 0.0, sequence.sigma[rows.frame, rows.second_grain(n)])
    return np.hypot(sequence.sigma[rows.frame, rows.i], second)
