from __future__ import annotations

import numba
import numpy as np
import pytest
from rodsight.solver.frame_forces import FrameForces
from rodsight.solver.nlgs.solve import NlgsSettings, solve
from rodsight.solver.nlgs.start_residuals import COLD_SWEEPS, StartResiduals, cold_residuals
from rodsight.solver.sequence.frames import solve_sequence

from tests.packings import problem_of, squeezed_heap
from tests.solver.sequence.test_frames import ENSEMBLE, SETTINGS, sheared_frames


def test_the_sweeps_saved_lie_between_those_that_bracket_the_warm_start() -> None:
    cold = COLD_SWEEPS.astype(float) ** -1.0
    assert StartResiduals(0.3, cold).sweeps_saved == pytest.approx(1.0 / 0.3 - 1.0)
    assert StartResiduals(2.0, cold).sweeps_saved == 0.0
    assert np.isnan(StartResiduals(1e-9, cold).sweeps_saved)
    assert np.isnan(StartResiduals(np.nan, cold).sweeps_saved)


def test_cold_residuals_are_those_of_so_many_sweeps_from_zero() -> None:
    problem, _ = problem_of(*squeezed_heap(np.random.default_rng(3)), threshold=2e-4)
    expected = [solve(problem, NlgsSettings(count)).natural_map for count in COLD_SWEEPS.tolist()]
    assert cold_residuals(problem) == pytest.approx(np.array(expected), rel=1e-9)


MANY_SECONDS = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="many seconds as plain Python")


@pytest.fixture(
    scope="module",
    params=[pytest.param(SETTINGS, id="nlgs"), pytest.param(ENSEMBLE, id="ensemble", marks=MANY_SECONDS)],
)
def frames(request: pytest.FixtureRequest) -> list[FrameForces]:
    return [frame for frame, _ in solve_sequence(*sheared_frames(5), request.param)]


def test_a_frame_without_previous_forces_has_a_cold_start_only(frames: list[FrameForces]) -> None:
    for frame in frames:
        assert frame.cold_residual is not None
        assert np.isfinite(frame.cold_residual).all()
        assert np.isfinite(frame.warm_residual) == np.isfinite(frame.old_unbalance)
    assert np.isnan(frames[0].warm_residual)
    assert np.isnan(frames[0].sweeps_saved)


def test_a_warm_start_has_a_smaller_residual_than_a_cold_one(frames: list[FrameForces]) -> None:
    for frame in frames[3:]:
        assert frame.cold_residual is not None
        assert frame.warm_residual < frame.cold_residual[0]
        assert not frame.sweeps_saved <= 0.0  # NaN: more sweeps than COLD_SWEEPS


def test_where_no_sweeps_are_recorded_there_is_no_cold_start() -> None:
    packing, snapshots = sheared_frames(3)
    frames = [frame for frame, _ in solve_sequence(packing, snapshots, SETTINGS.without_sweeps())]
    assert all(np.isnan(frame.cold_residual).all() for frame in frames)
    assert np.isfinite(frames[-1].warm_residual)


def test_without_contacts_there_are_no_start_residuals() -> None:
    packing, snapshots = sheared_frames(1)
    nothing = SETTINGS.__class__(estimator="nlgs", chain=SETTINGS.chain, threshold=-1.0)
    (frame, _), *_ = solve_sequence(packing, snapshots, nothing)
    assert frame.contacts.count == 0
    assert frame.cold_residual is not None
    assert np.isnan(frame.cold_residual).all()
