"""The compiled Gibbs sampler against the plain one, on pairs that reach every branch."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, replace

import numpy as np
import pytest
from rodsight.solver.bodies.grains import Array
from rodsight.solver.posterior.sampler import blocks
from rodsight.solver.posterior.sampler.common_draws import draw_common, draw_scale
from rodsight.solver.posterior.sampler.contact_draws import DRAWS, draw_contacts, weigh_pairs
from rodsight.solver.posterior.sampler.error_draws import draw_errors, factorize_errors
from rodsight.solver.posterior.sampler.gibbs_sweeps import run
from rodsight.solver.posterior.sampler.lanes import LANES, draw_uniform
from rodsight.solver.posterior.sampler.records import ModelParameters, SamplerGrains, SamplerPairs
from rodsight.solver.posterior.sampler.state import CX, CY, DELTA, FX, NORMAL_SUM, TORQUE, Chain, start_chain
from rodsight.solver.posterior.touching_kernels import accumulate_gaps, compute_touch_probabilities

from tests.reference.twins.sampler import PlainSampler, PlainState, plain_touching, resultants

pytestmark = pytest.mark.unit

ROUNDING = 1e-6  # relative: the plain precisions are differences of sums of about 1e4
DRAWN = 2e-3  # of a draw in single precision, of which all others follow
RADII, FRAMES = 4, 2
FORCED, FORBIDDEN, HOPELESS_GAP = 4.6, -13.8, 0.6  # ln P/(1 − P) of reviewed pairs; mean diameters
SWEEPS = 12


@dataclass(frozen=True)
class Case:
    pairs: SamplerPairs
    grains: SamplerGrains
    model: ModelParameters

    @property
    def plain(self) -> PlainSampler:
        return PlainSampler(self.pairs, self.grains, self.model)

    def start(self, seed: int = 5) -> Chain:
        """A chain whose parameters are set."""
        chain = start_chain(self.pairs, self.grains, self.model.compliance_mean, np.random.default_rng(seed))
        weigh_pairs(chain, self.model)
        factorize_errors(chain)
        return chain


def make_case(*, scale_known: bool, soft: bool) -> Case:
    """Four grains in two frames with common radii: pairs of grains, walls, plates, reviewed and hopeless pairs."""
    rng, m = np.random.default_rng(8), RADII * FRAMES
    first, second = [], []
    for k in range(FRAMES):
        for i, j in ((0, 1), (1, 2), (2, 3), (0, 3), (2, -1), (1, 3), (0, -1), (1, -1), (2, -1), (3, -1), (3, -1)):
            first.append(i + RADII * k)
            second.append(j + RADII * k if j >= 0 else -1)
    i, j = np.array(first), np.array(second)
    c = len(i)
    angle = rng.uniform(0.0, 2.0 * np.pi, c)
    odds = rng.normal(0.8, 0.5, c)
    odds[[1, 7]], odds[[4, 9]] = FORCED, FORBIDDEN
    gap = rng.normal(0.0, 0.03, c)
    gap[[5, 18]] = HOPELESS_GAP
    friction = np.where(j >= 0, 0.4, 0.2)
    friction[[6, 12, 19]] = 0.0
    group = np.full(c, -1)
    if scale_known:
        group[[7, 9]], group[[18, 20]] = 0, 1
    pairs = SamplerPairs(
        i, j, np.column_stack([np.cos(angle), np.sin(angle)]), gap, odds, friction, group,
        np.where(np.arange(c) % 5 == 0, 0.015, 0.0), np.where(np.arange(c) % 13 == 7, 0.7, 1.0),
    )  # fmt: skip
    balance_weight = np.ones(m)
    balance_weight[[2, 5]] = 0.0, 0.01
    grains = SamplerGrains(
        rng.uniform(0.6, 1.4, m), rng.normal(0.0, 0.4, (m, 2)) * scale_known, balance_weight,
        rng.uniform(0.01, 0.03, m), rng.uniform(0.01, 0.02, RADII),
        np.array([1.5, 2.5]) if scale_known else np.empty(0),
        rng.uniform(1.0, 4.0, m), np.where(np.arange(m) % 3 == 1, 0.0, rng.uniform(0.5, 4.0, m)),
    )  # fmt: skip
    expected = float((1.0 / (1.0 + np.exp(-odds))).sum())
    model = ModelParameters(
        balance_sd=0.4, gap_law_sd=0.02, tangential_sd=0.3, mean_open_gap=0.05, mean_gauge=0.0 if scale_known else 30.0,
        count_gauge=20.0, expected_count=expected, compliance_mean=0.03 if soft else 0.0,
        compliance_sd=0.02 if soft else 0.004, offset_sd=0.01, force_rate=0.3,
    )  # fmt: skip
    return Case(pairs, grains, model)


@pytest.fixture(params=[(True, True), (False, False)], ids=["known scale, soft", "unknown scale, hard"])
def case(request) -> Case:
    known, soft = request.param
    return make_case(scale_known=known, soft=soft)


@pytest.fixture(params=[0.05, 0.5], ids=["one by one", "in blocks"])
def greatest_part(request, monkeypatch) -> float:
    monkeypatch.setattr(blocks, "GREATEST_PART", request.param)
    return request.param


def plain_of(chain: Chain) -> PlainState:
    state, place, m = chain.state, chain.pairs.place, chain.grain_count
    return PlainState(
        state.bearing[place] > 0.0, state.fn[place], state.ft[place], state.open_gap[place],
        state.error[:m, CX : CY + 1].copy(), state.error[:RADII, DELTA].copy(),
        float(state.common[0]), float(state.common[1]),
    )  # fmt: skip


def assert_same(case: Case, chain: Chain, plain: PlainState) -> None:
    """All unknowns are equal, and the sums that the kernels update are those of the forces."""
    found, state, m = plain_of(chain), chain.state, chain.grain_count
    np.testing.assert_array_equal(found.bearing, plain.bearing)
    for name in ("fn", "ft", "open_gap"):
        np.testing.assert_allclose(getattr(found, name), getattr(plain, name), rtol=DRAWN, atol=DRAWN)
    np.testing.assert_allclose(found.centre, plain.centre, atol=0.02 * DRAWN)
    np.testing.assert_allclose(state.error[:m, DELTA], np.tile(plain.radius, FRAMES), atol=0.02 * DRAWN)
    np.testing.assert_allclose(
        [found.compliance, found.offset], [plain.compliance, plain.offset], rtol=DRAWN, atol=0.02 * DRAWN
    )
    assert_sums(case, chain)


def assert_sums(case: Case, chain: Chain) -> None:
    """The sums that the kernels update are those of the forces, and absent pairs and grains have none."""
    found, state, m = plain_of(chain), chain.state, chain.grain_count
    z = found.bearing
    assert state.common[2:] == pytest.approx([(found.fn[z] - 1.0).sum(), z.sum()], abs=ROUNDING)
    sums = resultants(case.pairs, case.grains, found.fn, found.ft)
    np.testing.assert_allclose(state.force[:m, FX : TORQUE + 1], sums, atol=ROUNDING)
    np.testing.assert_allclose(state.force[:m, NORMAL_SUM], normal_sums(case.pairs, found.fn, m), atol=ROUNDING)
    for g in range(len(case.grains.group_load)):
        expected = (case.pairs.factor * found.fn)[case.pairs.group == g].sum()
        assert state.group_sum[g] == pytest.approx(expected, abs=ROUNDING)
    absent = np.setdiff1d(np.arange(len(state.fn)), chain.pairs.place)
    assert not state.fn[absent].any()
    assert not state.bearing[absent].any()
    assert not state.error[m:].any()


def normal_sums(pairs: SamplerPairs, fn: Array, count: int) -> Array:
    """Sum of the normal forces on every grain (m,)."""
    return np.array([fn[(pairs.i == k) | (pairs.j == k)].sum() for k in range(count)])


def uniform_rows(random: Array, rows: int) -> Array:
    """The next uniform numbers (rows, LANES)."""
    out = np.empty((rows, LANES), np.float32)
    for row in out:
        draw_uniform(random, row, 0)
    return out.astype(np.float64)


def sampled_chain(case: Case, sweeps: int = 3) -> Chain:
    """A chain some sweeps after the start, with errors of all kinds."""
    chain = case.start()
    sums = np.zeros((len(chain.state.fn), 5)), np.zeros((chain.grain_count, 6)), np.zeros(4)
    run(chain, np.tile(np.array(case.model), (sweeps, 1)), 1, sums)
    return chain


def plain_contacts(case: Case, chain: Chain, random: Array) -> tuple[PlainState, list[str], list[int]]:
    """Draw the pairs by the plain sampler, block by block; return branches and pairs, too."""
    state, branches, drawn = plain_of(chain), [], []
    row = np.full(len(chain.state.fn), -1)
    row[chain.pairs.place] = np.arange(chain.pair_count)
    for rows in row.reshape(-1, LANES):
        state, found = case.plain.draw_block(uniform_rows(random, DRAWS), state, rows.tolist())
        branches += found
        drawn += rows[rows >= 0].tolist()
    return state, branches, drawn


def plain_errors(case: Case, chain: Chain, random: Array, state: PlainState) -> PlainState:
    grains = chain.grains
    for block, radii in enumerate(grains.record[:: grains.frames] // blocks.RECORD):
        uniform = uniform_rows(random, 1 + 2 * grains.frames)
        for lane, grain in enumerate(radii.tolist()):
            if grain < chain.grain_count:
                state = case.plain.draw_errors(uniform[:, lane].tolist(), state, grain)
        assert block < len(grains.radius_precision)
    return state


@pytest.mark.thorough
def test_forces_bearing_and_gaps_have_the_plain_conditional_distributions(case, greatest_part):
    chain, branches = case.start(), []
    assert (chain.pair_count > len(chain.pairs.grouped)) == (greatest_part > 0.1)
    for _ in range(SWEEPS):
        plain, followed, drawn = plain_contacts(case, chain, chain.state.random.copy())
        draw_contacts(chain, case.model)
        assert_same(case, chain, plain)
        found, common = plain_of(chain), chain.state.common
        residual = case.pairs.gap - common[1] + np.where(found.bearing, common[0] * found.fn, -found.open_gap)
        np.testing.assert_allclose(chain.workspace.residual[chain.pairs.place], residual, atol=ROUNDING)
        branches += list(zip(followed, drawn, strict=True))
        draw_errors(chain)
        before = chain.state.common.copy()
        draw_common(chain, case.model)
        chain.state.common[:] = before  # of which only the heights are needed
    reached = {branch.removesuffix(", moved") for branch, _ in branches}
    assert reached == {"hopeless", "open", "frictional", "smooth", "kept bearing", "kept open"}
    assert any(branch.endswith("moved") for branch, _ in branches)
    for kind in (case.pairs.j >= 0, case.pairs.j < 0, case.pairs.odds == FORCED, case.pairs.gap_sd > 0):
        assert any(branch.startswith("frictional") for branch, c in branches if kind[c])
    assert not any(branch.startswith("frictional") for branch, c in branches if case.pairs.gap[c] == HOPELESS_GAP)


def test_centres_and_radii_have_the_plain_joint_distribution(case):
    chain = sampled_chain(case)
    draw_contacts(chain, case.model)
    plain = plain_errors(case, chain, chain.state.random.copy(), plain_of(chain))
    draw_errors(chain)
    assert_same(case, chain, plain)
    assert np.ptp(chain.state.error[:, CX]) > 0.01


def test_common_unknowns_have_the_plain_conditional_distributions(case):
    chain = sampled_chain(case)
    chain.state.common[2:] = np.nan  # recomputed
    uniform = uniform_rows(chain.state.random.copy(), 1)[0]
    plain = case.plain.draw_common(uniform, plain_of(chain))
    draw_common(chain, case.model)
    assert_same(case, chain, plain)


def test_scale_of_the_forces_moves_by_the_plain_posterior(case):
    chain, scales = sampled_chain(case), []
    for _ in range(6):
        before = chain.state.fn.sum()
        uniform = uniform_rows(chain.state.random.copy(), 1)[0, 2:]
        plain = case.plain.draw_scale(iter(uniform), plain_of(chain))
        draw_scale(chain, case.model)
        assert_same(case, chain, plain)
        scales.append(chain.state.fn.sum() / before)
    assert len(set(scales)) > 2


def test_a_known_compliance_pulls_the_scale_of_the_forces_towards_it(case):
    drawn = {0.05: [], 0.04: []}
    for sweeps in range(3, 9):
        start = sampled_chain(case, sweeps)
        start.state.common[0] = 0.045
        uniform = uniform_rows(start.state.random.copy(), 1)[0, 2:]
        for compliance, values in drawn.items():
            narrow = replace(case, model=case.model._replace(compliance_mean=compliance, compliance_sd=0.002))
            chain = deepcopy(start)
            plain = narrow.plain.draw_scale(iter(uniform), plain_of(chain))
            draw_scale(chain, narrow.model)
            assert_same(narrow, chain, plain)
            values.append(chain.state.common[0])
    stiff, soft = (np.mean(values) for values in drawn.values())
    assert stiff > 0.045 > soft
    assert stiff - soft > 0.001


def test_without_bearing_pairs_no_scale_is_drawn(case):
    none = np.full(len(case.pairs.gap), -50.0)
    chain = replace(case, pairs=case.pairs._replace(odds=none)).start()
    chain.state.common[0], random = 0.1, chain.state.random.copy()
    draw_scale(chain, case.model)
    assert not chain.state.bearing.any()
    assert chain.state.common[0] == 0.1
    np.testing.assert_array_equal(chain.state.random, random)


@pytest.mark.thorough
def test_sweeps_follow_the_schedule_and_only_the_last_are_summed(case):
    looser = case.model._replace(balance_sd=0.9, gap_law_sd=0.05)
    models, kept = [looser, looser, case.model, case.model, case.model], 2
    chain, single = case.start(seed=4), case.start(seed=4)
    sums = np.zeros((len(chain.state.fn), 5)), np.zeros((chain.grain_count, 6)), np.zeros(4)
    run(chain, np.array(models), kept, sums)
    pair, error, common = np.zeros((chain.pair_count, 5)), np.zeros((chain.grain_count, 6)), np.zeros(4)
    for k, model in enumerate(models):
        weigh_pairs(single, model)
        factorize_errors(single)
        draw_contacts(single, model)
        draw_errors(single)
        draw_common(single, model)
        draw_scale(single, model)
        if k >= len(models) - kept:
            plain = plain_of(single)
            pair += np.column_stack([plain.bearing, plain.fn, plain.ft, plain.fn**2, plain.ft**2])
            radius = np.tile(plain.radius, FRAMES)
            pressure = normal_sums(case.pairs, plain.fn, chain.grain_count)
            error += np.column_stack([plain.centre, radius, radius**2, pressure, pressure**2])
            common += [plain.compliance, plain.compliance**2, plain.offset, plain.offset**2]
    for found, expected in zip((sums[0][chain.pairs.place], *sums[1:]), (pair, error, common), strict=True):
        np.testing.assert_allclose(found, expected, rtol=ROUNDING, atol=ROUNDING)
    assert_sums(case, chain)


def test_blocks_share_no_grain_no_known_sum_and_no_pair(case, greatest_part):
    chain, pairs, m = case.start(), case.pairs, case.start().grain_count
    row = np.full(len(chain.state.fn), -1)
    row[chain.pairs.place] = np.arange(chain.pair_count)
    assert sorted(row[row >= 0]) == list(range(chain.pair_count))
    largest = 0
    for rows in row.reshape(-1, LANES):
        present = rows[rows >= 0]
        bodies = [*pairs.i[present], *(j for j in pairs.j[present] if j >= 0)]
        groups = [g for g in pairs.group[present] if g >= 0]
        assert len(set(bodies)) == len(bodies)
        assert len(set(groups)) == len(groups)
        largest = max(largest, len(present))
    assert largest == 1 if greatest_part < 0.1 else largest > 1
    radii = chain.grains.record[:FRAMES:FRAMES] // blocks.RECORD
    assert set(chain.grains.record.ravel() // blocks.RECORD) == set(range(m + 1))
    for members in radii:
        grains = [grain for grain in members if grain < m]
        touching = {(i % RADII, j % RADII) for i, j in zip(pairs.i, pairs.j, strict=True) if j >= 0}
        assert not any((a, b) in touching for a in grains for b in grains)


def test_the_mixture_of_touching_and_open_gaps_is_the_plain_one():
    rng, s = np.random.default_rng(6), 1e-5
    mean, fraction = rng.normal(0.0, 1e-5, 5), np.array([0.4, 0.7, 0.9])
    reach = np.array([2e-4, 1e-4, 0.5 * s, 3e-5, 1e-4])  # one is below the standard deviation
    gap = mean + rng.uniform(-4.0 * s, reach, (3, 5))
    gap[1, 3], gap[2, 0] = np.nan, mean[0] + 10.0 * s
    by_pair, touched, touch = np.empty((3, 5)), np.empty(3), np.empty((3, 5))
    likelihood = accumulate_gaps(gap, mean, reach, s, fraction, by_pair, touched)
    compute_touch_probabilities(gap, mean, reach, s, fraction, touch)
    expected, plain_touch, plain_by_pair, plain_touched = plain_touching(gap, mean, reach, s, fraction)
    assert likelihood == pytest.approx(expected, rel=1e-7)
    np.testing.assert_allclose(by_pair, plain_by_pair, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(touched, plain_touched, rtol=1e-6)
    np.testing.assert_allclose(touch, plain_touch, rtol=1e-6)
    compute_touch_probabilities(mean + 1.01 * np.tile(reach, (3, 1)), mean, reach, s, fraction, touch)
    assert (touch == 0.0).all()  # beyond the reach
