"""A mixture of both estimates has the motion estimate's sum of forces and stress as far as the motion counts."""

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


@pytest.mark.slow
def test_projected_mixture_has_the_sum_of_the_motion_by_its_weight(monkeypatch: pytest.MonkeyPatch) -> None:
    sheared = simulate_shear(0.25, 6)
    mix, project, match = estimates._mix, equilibrium_mixture.project_mixed_field, equilibrium_mixture.mix_on_contacts
    weights, sums, powers = [], [], []

    def spy(problem, estimate, *arguments):
        mixed = mix(problem, estimate, *arguments)
        if problem.motion.ends_here and mixed.mixture.position_weight > 0.0:
            weights.append((1.0 - mixed.mixture.position_weight, float(estimate.fn.sum())))
        return mixed

    def projected(balance, fn, ft, fn_sd, settings, wanted=None, **further):
        found = project(balance, fn, ft, fn_sd, settings, wanted, **further)
        if wanted is not None:
            alone = float(project(balance, fn, ft, fn_sd, settings, **further).fn.sum())
            sums.append((*wanted, float(found.fn.sum()), alone))
        return found

    def mixed(contacts, motion, positions, *arguments, **further):
        found = match(contacts, motion, positions, *arguments, **further)
        if positions.stress_factor is not None:
            powers.append((float(np.ptp(positions.stress_factor)), found.position_weight))
        return found

    monkeypatch.setattr(estimates, "_mix", spy)
    monkeypatch.setattr(equilibrium_mixture, "project_mixed_field", projected)
    monkeypatch.setattr(equilibrium_mixture, "mix_on_contacts", mixed)
    list(solve_sequence(sheared.packing, sheared.snapshots, SequenceSettings(positions="always")))
    assert len(sums) > 2
    assert len(powers) == len(sums)  # no weight: the stress is matched in every frame that has a motion
    assert min(power for power, _ in powers) > 0.0
    for (weight, motion), (total, counted, found, alone) in zip(weights, sums, strict=True):
        assert (total, counted) == pytest.approx((motion, weight))
        assert found == pytest.approx(alone + weight * (total - alone), rel=2e-3)
