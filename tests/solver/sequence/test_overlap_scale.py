"""Total force of soft grains without a load: it follows their overlaps from frame to frame."""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np
import pytest
from rodsight.solver.sequence.frames import solve_sequence
from rodsight.solver.sequence.settings import SequenceSettings

from tests.solver.posterior.simulated import SimulatedShear, simulate_shear

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")

STRAIN = np.array([0.0, 1e-3, 3e-3, 2e-3, 5e-4])  # compression of the same packing, up and down


@pytest.fixture(scope="module")
def soft() -> SimulatedShear:
    return simulate_shear(0.25, 6, normal_stiffness=2e5)


@pytest.fixture(scope="module")
def squeezed(soft: SimulatedShear):
    """A packing without loads, squeezed alike in all directions."""
    start, rng = soft.snapshots[0], np.random.default_rng(3)
    snapshots = [
        replace(
            start, time=float(k), position=(1.0 - e) * start.position + 1e-6 * rng.normal(size=start.position.shape),
            endpoints=(1.0 - e) * start.endpoints,
        )
        for k, e in enumerate(STRAIN)
    ]  # fmt: skip
    packing = replace(soft.packing, pressure=np.full(len(soft.packing.pressure), np.nan))
    return packing, snapshots


@pytest.mark.thorough
@pytest.mark.parametrize("soft_grains", [True, False])
def test_total_force_of_soft_grains_follows_their_overlap(squeezed, soft_grains) -> None:
    packing, snapshots = squeezed
    settings = SequenceSettings(soft=soft_grains, measured_overlap=1e-4, positions="always")
    solved = list(solve_sequence(packing, snapshots, settings))
    if not soft_grains:
        assert np.isnan(solved[-1][1].overlap_unit)
        return
    frames = [frame for frame, _ in solved]
    total = np.array([frame.fn.sum() for frame in frames])
    overlap = np.array([frame.overlap * frame.bearing_probability.sum() for frame in frames])
    assert total / total[0] == pytest.approx(overlap / overlap[0], rel=0.02)
    assert np.corrcoef(total, STRAIN)[0, 1] > 0.8
    assert solved[-1][1].overlap_unit == frames[0].overlap
    # standard deviations are multiplied, too: a relative error does not depend on the scale; the first frame has no
    # motion of its own, and wider ones
    relative = [float(np.median(frame.fn_sd[frame.fn > 0.0])) / float(frame.fn.mean()) for frame in frames[1:]]
    assert max(relative) < 2.0 * min(relative)
