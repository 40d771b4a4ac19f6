"""What a frame's solve starts from: how far the former forces carry (warm), and how far none do (cold).

Both are natural-map residuals of the problem that the last sub-step of the frame's chain solved, after sweeps of
their own: the warm one after a first sweep from the former forces, the cold ones after 1, 2, 4, … sweeps from zero
forces. The distance between them, in sweeps, is what the history of a frame saves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.bodies.grains import Array
from solver.nlgs.chain import ChainStep
from solver.nlgs.problem import ContactProblem
from solver.nlgs.solve import NlgsSettings, solve

COLD_SWEEPS = 2 ** np.arange(10)  # after which the cold start is measured: up to 512


@dataclass(frozen=True, slots=True)
class Starts:
    """Natural-map residuals of one frame; NaN where they are not known."""

    warm: float  # after one sweep from the former forces; NaN where the frame started without any
    cold: Array  # (len(COLD_SWEEPS),) after so many sweeps from zero forces

    @property
    def saved(self) -> float:
        """Sweeps that a cold start needs to come as far as the warm one after its first; NaN if more than tried."""
        there = np.flatnonzero(self.cold <= self.warm)
        if len(there) == 0:
            return float("nan")
        row = int(there[0])
        if row == 0:
            return 0.0
        # Between two of them the residual falls as a power of the number of sweeps.
        part = np.log(self.cold[row - 1] / self.warm) / np.log(self.cold[row - 1] / self.cold[row])
        return float(COLD_SWEEPS[row - 1] * (COLD_SWEEPS[row] / COLD_SWEEPS[row - 1]) ** part - 1.0)


def measure_starts(step: ChainStep) -> Starts:
    """Measure the starts of a chain's last sub-step."""
    if step.contacts.count == 0:
        return Starts(np.nan, np.full(len(COLD_SWEEPS), np.nan))
    warm = np.nan
    if step.former is not None:
        warm = solve(step.problem, NlgsSettings(1), guess=step.former).natural_map
    return Starts(warm, cold_residuals(step.problem))


def cold_residuals(problem: ContactProblem) -> Array:
    """Natural-map residuals after COLD_SWEEPS sweeps from zero forces."""
    residuals, force, done = np.empty(len(COLD_SWEEPS)), None, 0
    for row, count in enumerate(COLD_SWEEPS.tolist()):
        solution = solve(problem, NlgsSettings(count - done), guess=force)
        residuals[row], force, done = solution.natural_map, solution.force, count
    return residuals
