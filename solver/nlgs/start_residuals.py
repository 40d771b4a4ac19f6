"""Residuals of a warm start from the previous forces and of a cold start from zero forces.

Both are natural-map residuals of the problem of the last sub-step of a frame: the warm residual after one sweep from
the previous forces, the cold residuals after 1, 2, 4, … sweeps from zero forces. The distance between them, in sweeps,
is the number of sweeps that the warm start saves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..bodies.grains import Array
from .chain import ChainStep
from .problem import ContactProblem
from .solve import NlgsSettings, solve, sweeps

COLD_SWEEPS = 2 ** np.arange(10)  # up to 512


@dataclass(frozen=True, slots=True)
class StartResiduals:
    """Natural-map residuals of one frame; NaN where unknown."""

    warm: float  # after one sweep from the previous forces; NaN without any
    cold: Array  # (len(COLD_SWEEPS),) after COLD_SWEEPS sweeps from zero forces

    @property
    def sweeps_saved(self) -> float:
        """Further sweeps that a cold start needs to reach the warm residual; NaN beyond the last of COLD_SWEEPS."""
        reached = np.flatnonzero(self.cold <= self.warm)
        if len(reached) == 0:
            return float("nan")
        row = int(reached[0])
        if row == 0:
            return 0.0
        # Between two numbers of sweeps the residual is interpolated as a power of the number.
        fraction = np.log(self.cold[row - 1] / self.warm) / np.log(self.cold[row - 1] / self.cold[row])
        return float(COLD_SWEEPS[row - 1] * (COLD_SWEEPS[row] / COLD_SWEEPS[row - 1]) ** fraction - 1.0)


def measure_start_residuals(step: ChainStep, *, with_cold: bool = True) -> StartResiduals:
    """Measure the start residuals of the last sub-step of a chain, those of a cold start only on request."""
    if step.contacts.count == 0:
        return StartResiduals(np.nan, np.full(len(COLD_SWEEPS), np.nan))
    warm = np.nan
    if step.previous_force is not None:
        warm = solve(step.problem, NlgsSettings(1), guess=step.previous_force).natural_map
    return StartResiduals(warm, cold_residuals(step.problem) if with_cold else np.full(len(COLD_SWEEPS), np.nan))


def cold_residuals(problem: ContactProblem) -> Array:
    """Compute the natural-map residuals after COLD_SWEEPS sweeps from zero forces."""
    strides = np.diff(COLD_SWEEPS, prepend=0).tolist()
    return np.array([each.natural_map for each in sweeps(problem, NlgsSettings(), every=strides)])
