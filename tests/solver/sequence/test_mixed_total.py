"""A mixture of both estimates has the motion estimate's sum of forces and stress as far as the motion counts."""

from __future__ import annotations

from dataclasses import replace

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
def test_projected_mixture_has_the_sum_of_the_motion_by_its_weight(monkeypatch: pytest.MonkeyPatch) -> None:
    sheared = simulate_shear(0.25, 6)
    mix, project, match = estimates._mix, equilibrium_mixture.project_mixed_field, equilibrium_mixture.mix_on_contacts
    weights, sums, powers = [], [], []

    def spy(problem, estimate, *arguments, **further):
        mixed = mix(problem, estimate, *arguments, **further)
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


@pytest.mark.thorough
def test_without_a_load_the_evidence_weighs_the_positions_of_hard_grains(monkeypatch: pytest.MonkeyPatch) -> None:
    sheared = simulate_shear(0.25, 4)
    unloaded = replace(sheared.packing, pressure=np.full(len(sheared.packing.pressure), np.nan))
    seen = []

    def weigh(evidence):
        seen.append(evidence.loaded)
        return 0.37

    monkeypatch.setattr(estimates, "evident_position_weight", weigh)
    hard, soft = (
        [each.position_weight for each, _ in solve_sequence(unloaded, sheared.snapshots, settings)]
        for settings in (SequenceSettings(), SequenceSettings(soft=True))
    )
    assert hard[1:] == [pytest.approx(0.37)] * (len(hard) - 1)
    assert not any(seen)
    assert 0.37 not in np.round(soft, 6)  # overlaps that are forces have a weight of their own
