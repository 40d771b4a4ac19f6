"""Scale of the forces of hard grains where no load is known: their mean is one in every frame."""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np
import pytest
from rodsight.solver.frame_forces import FrameForces
from rodsight.solver.part_settings import ChainSettings
from rodsight.solver.sequence.frames import solve_sequence
from rodsight.solver.sequence.settings import SequenceSettings
from rodsight.solver.statistics.force_statistics import mean_normal_force

from tests.solver.posterior.simulated import SimulatedShear, simulate_shear

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")

FEW = SequenceSettings(estimator="nlgs", chain=ChainSettings(sweeps=200))


@pytest.fixture(scope="module")
def sheared() -> SimulatedShear:
    return simulate_shear(0.25, 4)


def solve(sheared: SimulatedShear, pressure: float) -> list[FrameForces]:
    packing = replace(sheared.packing, pressure=np.where(np.isfinite(sheared.packing.pressure), pressure, np.nan))
    return [frame for frame, _ in solve_sequence(packing, sheared.snapshots, FEW)]


def test_without_a_load_the_mean_force_of_every_frame_is_one(sheared):
    for frame in solve(sheared, np.nan):
        assert mean_normal_force(frame.fn) == pytest.approx(1.0)
        # the last sweep of a single chain, which it reports, has the same scale
        np.testing.assert_allclose(frame.nlgs_fn, frame.fn)
        assert frame.history.fn[-1] == pytest.approx(frame.fn, abs=1e-3)


def test_a_load_sets_the_scale(sheared):
    one, two = ([mean_normal_force(each.fn) for each in solve(sheared, pressure)] for pressure in (5e3, 1e4))
    assert np.array(two[1:]) / one[1:] == pytest.approx(2.0, rel=0.05)
