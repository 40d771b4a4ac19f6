"""The vector implementations measure eight contacts or grains at once, like the plain loops."""

import numpy as np
import pytest
from numba import njit
from rodsight.solver.grain_records import RECORD, WIDTH
from rodsight.solver.nlgs.sweeping.measured_groups import (
    CELL_ROWS,
    RESIDUAL,
    SUMS,
    add_forces,
    add_residuals,
    add_unbalance,
    clear_sums,
    finish_grains,
    relax_and_measure,
)
from rodsight.solver.nlgs.sweeping.ordering import GROUP

BLOCKS, GRAINS, FRICTION = 2, 3 * GROUP, 0.3
ROUNDING = 1e-12


@njit
def residuals(pair, rows, ids, body, force, block, sums):
    add_residuals(pair, rows, ids, body, force, block, FRICTION, sums)


@njit
def relax(pair, rows, ids, both, force, block, relaxation, sums):
    work = np.empty(2 * RECORD * GROUP)
    relax_and_measure(pair, rows, ids, both, force, block, relaxation, FRICTION, work, sums)


@njit
def sum_forces(force, first, before, second, sums):
    add_forces(force, first, before, second, sums)


@njit
def unbalance(body, equilibrium, block, sums):
    add_unbalance(body, equilibrium, block, sums)


@njit
def finish(both, equilibrium, block, sums):
    finish_grains(both, equilibrium, block, sums)


class Group:
    """Random contacts, of which some stick, slide, open, and carry nothing."""

    def __init__(self, rows):
        rng = np.random.default_rng(7)
        self.rows, self.pair = rows, rng.normal(size=BLOCKS * rows * GROUP)
        quantities = self.pair.reshape(BLOCKS, rows, GROUP)
        quantities[:, 2] = np.abs(quantities[:, 2])
        places = [RECORD * rng.permutation(GRAINS)[: 2 * GROUP] for _ in range(BLOCKS)]
        self.ids = np.concatenate(places).astype(np.int32)
        self.both = rng.normal(size=2 * RECORD * GRAINS)
        force = np.stack([np.maximum(rng.normal(size=BLOCKS * GROUP), 0.0), np.zeros(BLOCKS * GROUP)], axis=1)
        force[:, 1] = FRICTION * force[:, 0] * rng.uniform(-1.0, 1.0, len(force)).round(1)
        self.force = force.reshape(-1)
        self.sums = cleared()

    @property
    def state(self):
        return self.both, self.force, self.sums


def cleared():
    sums = np.empty(SUMS)
    clear_sums(sums)
    return sums


@pytest.fixture(params=[CELL_ROWS - 1, CELL_ROWS])
def groups(request):
    return Group(request.param), Group(request.param)


@pytest.mark.parametrize("block", range(BLOCKS))
def test_residuals_of_a_group_are_those_one_by_one(groups, block):
    found, plain = groups
    body = found.both[: RECORD * GRAINS]
    residuals(found.pair, found.rows, found.ids, body, found.force, block, found.sums)
    add_residuals(plain.pair, plain.rows, plain.ids, body, plain.force, block, FRICTION, plain.sums)
    assert found.sums == pytest.approx(plain.sums, rel=ROUNDING)
    assert np.all(found.sums[RESIDUAL : RESIDUAL + WIDTH] > 0.0)


@pytest.mark.parametrize("relaxation", [1.0, 1.4])
@pytest.mark.parametrize("block", range(BLOCKS))
def test_a_group_is_relaxed_and_measured_as_one_by_one(groups, block, relaxation):
    found, plain = groups
    relax(found.pair, found.rows, found.ids, found.both, found.force, block, relaxation, found.sums)
    relax_and_measure(
        plain.pair, plain.rows, plain.ids, plain.both, plain.force, block, relaxation, FRICTION, None, plain.sums
    )
    for one, other in zip(found.state, plain.state, strict=True):
        assert one == pytest.approx(other, rel=ROUNDING, abs=ROUNDING)
    assert not np.array_equal(found.force, Group(found.rows).force)


def test_forces_are_added_as_one_by_one(groups):
    found, plain = groups
    before = np.random.default_rng(8).normal(size=2 * WIDTH + 3)
    sum_forces(found.force, 2 * WIDTH, before, 3, found.sums)
    add_forces(plain.force, 2 * WIDTH, before, 3, plain.sums)
    assert np.array_equal(found.sums, plain.sums)


@pytest.mark.parametrize("block", range(2))
def test_the_unbalance_of_grains_is_that_one_by_one(groups, block):
    equilibrium = np.random.default_rng(9).normal(size=3 * GRAINS)
    found, plain = groups
    unbalance(found.both, equilibrium, block, found.sums)
    add_unbalance(plain.both, equilibrium, block, plain.sums)
    assert np.array_equal(found.sums, plain.sums)


@pytest.mark.parametrize("block", range(2))
def test_grains_keep_their_records_of_the_last_sweep(groups, block):
    equilibrium = np.random.default_rng(9).normal(size=3 * GRAINS)
    found, plain = groups
    finish(found.both, equilibrium, block, found.sums)
    finish_grains(plain.both, equilibrium, block, plain.sums)
    assert all(np.array_equal(one, other) for one, other in zip(found.state, plain.state, strict=True))
    records = found.both.reshape(GRAINS, 2, RECORD)
    kept = np.all(records[:, 0] == records[:, 1], axis=1)
    assert np.flatnonzero(kept).tolist() == list(range(block * GROUP, (block + 1) * GROUP))
