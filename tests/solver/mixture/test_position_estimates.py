"""Position-only estimates of a sequence on demand."""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np
import pytest
from rodsight.solver.contacts.verdicts import Verdicts
from rodsight.solver.mixture.position_estimates import PositionEstimates
from rodsight.solver.posterior.posterior_settings import PosteriorSettings
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
