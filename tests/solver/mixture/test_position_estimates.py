"""Position-only estimates of a sequence on demand."""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np
import pytest
from rodsight.solver.contacts.verdicts import Verdicts
from rodsight.solver.mixture.force_smoothing import WINDOW, smooth_forces
from rodsight.solver.mixture.position_estimates import PositionEstimates, frame_generator, infer_alone
from rodsight.solver.posterior.posterior_settings import PosteriorSettings
from rodsight.solver.posterior.sequence_evidence import gather_position_evidence
from rodsight.solver.statistics.agreement import compare_forces
from rodsight.solver.statistics.balance import grain_unbalance

from tests.solver.posterior.simulated import SimulatedShear, simulate_shear

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")

SWEEPS = PosteriorSettings(annealing=60, burn_in=30, kept=60)
FEW_SWEEPS = PosteriorSettings(annealing=20, burn_in=5, kept=10)


@pytest.fixture(scope="module")
def soft() -> SimulatedShear:
    return simulate_shear(0.25, 6, normal_stiffness=2e5)


def test_estimate_does_not_depend_on_the_order_of_requests(soft) -> None:
    one, two = (PositionEstimates(soft.packing, soft.snapshots, FEW_SWEEPS) for _ in range(2))
    two.at(4)
    first, second = one.at(2), two.at(2)
    assert first is not None
    assert second is not None
    assert np.array_equal(first.fn, second.fn)


def test_fewer_draws_are_compared_whatever_is_known(soft) -> None:
    one, two = (PositionEstimates(soft.packing, soft.snapshots, SWEEPS, alike=2) for _ in range(2))
    full = one.at(2)
    brief, again = one.compared(3), two.compared(2)  # photographs alike
    assert full is not None
    assert brief is not None
    assert again is not None
    assert np.array_equal(brief.fn, again.fn)
    assert 0.97 < np.corrcoef(full.fn, brief.fn)[0, 1] < 1.0


def test_forces_of_positions_alone_are_nearer_to_balance_and_no_more_certain(soft) -> None:
    beside, alone = (
        PositionEstimates(soft.packing, soft.snapshots, SWEEPS, alone=each).at(2) for each in (False, True)
    )
    assert beside is not None
    assert alone is not None
    unbalance = [
        float(
            np.nanmean(
                grain_unbalance(found.contacts, found.fn, found.ft, soft.packing.weight, soft.packing.grains.free)
            )
        )
        for found in (beside, alone)
    ]
    assert unbalance[1] < 0.8 * unbalance[0]
    assert float(np.median(alone.fn_sd)) > 0.7 * float(np.median(beside.fn_sd))


def test_errors_of_photographs_are_averaged_where_forces_rest_on_positions_alone() -> None:
    noise, rng = 4e-4, np.random.default_rng(5)  # [m], more than the mean overlap
    world = simulate_shear(0.01, 8, normal_stiffness=2e5)
    seen = [
        replace(each, position=each.position + rng.normal(0.0, noise, each.position.shape), sigma=noise)
        for each in world.snapshots
    ]
    estimates = PositionEstimates(world.packing, seen, SWEEPS, alone=True, alike=4)
    evidence = gather_position_evidence(world.packing, seen, SWEEPS, soft=True)
    single = [infer_alone(evidence.of_frame(k), evidence.settings, frame_generator(k)) for k in range(len(seen))]
    for k in (0, 5, 7):
        found, near = estimates.at(k), single[max(k - WINDOW, 0) : k + WINDOW + 1]
        assert found is not None
        assert np.array_equal(found.fn, smooth_forces(near, min(k, WINDOW), np.empty(0, np.int64)).fn)
        r = [
            compare_forces(each.contacts.key, np.column_stack([each.fn, each.ft]), *world.truth(k)).r_fn
            for each in (single[k], found)
        ]
        assert r[1] > r[0] + 0.004  # .007 to .010
    doubtful = int(np.argmin(np.abs(single[7].bearing_probability - 0.5)))
    verdicts = Verdicts(forced=single[7].contacts.key[doubtful : doubtful + 1])
    judged, again = (
        PositionEstimates(world.packing, seen, SWEEPS, alone=True).at(7, each)
        for each in (verdicts, Verdicts(reset=True))
    )
    own = infer_alone(evidence.of_frame(7, verdicts=verdicts), evidence.settings, frame_generator(7))
    assert judged is not None
    assert again is not None
    row = int(np.flatnonzero(own.contacts.key == verdicts.forced)[0])
    assert judged.fn[row] == own.fn[row]
    assert len({own.fn[row], again.fn[row], single[7].fn[doubtful]}) == 3


def test_given_posteriors_are_used_as_they_are(soft) -> None:
    given = PositionEstimates(soft.packing, soft.snapshots, FEW_SWEEPS).at(0)
    assert given is not None
    assert PositionEstimates(soft.packing, soft.snapshots, FEW_SWEEPS, given={0: given}).at(0) is given


def test_close_photographs_share_the_posterior_of_the_first_of_every_span(soft) -> None:
    every = PositionEstimates(soft.packing, soft.snapshots, FEW_SWEEPS)
    shared = PositionEstimates(soft.packing, soft.snapshots, FEW_SWEEPS, alike=3)
    fifth, third = shared.at(5), every.at(3)
    assert fifth is not None
    assert third is not None
    assert np.array_equal(fifth.fn, third.fn)  # also where frames 3 and 4 were not requested
    assert shared.at(4) is fifth
    judged = shared.at(4, Verdicts(reset=True))
    own = every.at(4)
    assert judged is not None
    assert own is not None
    assert np.array_equal(judged.fn, own.fn)  # a frame with verdicts has a posterior of its own


def test_photographs_under_another_load_share_no_posterior(soft) -> None:
    loaded = [
        replace(each, load=np.full(len(each.endpoints), 700.0 if k < 4 else 900.0))
        for k, each in enumerate(soft.snapshots)
    ]
    shared = PositionEstimates(soft.packing, loaded, FEW_SWEEPS, alike=3)
    assert [shared.frame_of(k) for k in range(len(loaded))][:6] == [0, 0, 0, 3, 4, 4]
    assert shared.frame_of(5, Verdicts(reset=True)) == 5
