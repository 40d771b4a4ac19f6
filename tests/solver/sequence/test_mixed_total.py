"""A mixture of both estimates has the motion estimate's sum of forces after its projection onto equilibrium, too."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from rodsight.solver.mixture import equilibrium_mixture
from rodsight.solver.sequence import estimate as estimates
from rodsight.solver.sequence.frames import solve_sequence
from rodsight.solver.sequence.settings import SequenceSettings

from tests.solver.posterior.simulated import simulate_shear

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")


@pytest.mark.thorough
def test_projected_mixture_keeps_the_sum_of_the_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    sheared = simulate_shear(0.25, 6)
    mix, sums, used = estimates._mix, [], []

    def spy(problem, estimate, *arguments):
        mixed = mix(problem, estimate, *arguments)
        if problem.motion.ends_here and mixed.mixture.position_weight > 0.0:
            sums.append(mixed.fn.sum() / estimate.fn.sum())
        return mixed

    def factors(*arguments):
        used.append(true_factors(*arguments))
        return used[-1]

    true_factors = equilibrium_mixture.stress_factors
    monkeypatch.setattr(estimates, "_mix", spy)
    monkeypatch.setattr(equilibrium_mixture, "stress_factors", factors)
    list(solve_sequence(sheared.packing, sheared.snapshots, SequenceSettings(positions="always")))
    assert len(sums) > 2
    assert np.abs(np.array(sums) - 1.0).max() < 2e-3
    assert len(used) == len(sums)  # no weight: the stress is matched in every frame that has a motion
