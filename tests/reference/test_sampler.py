"""The compiled Gibbs sampler against the plain one, on pairs that reach every branch."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from rodsight.solver.posterior.sampler.common_draws import draw_common, draw_scale
from rodsight.solver.posterior.sampler.contact_draws import draw_contacts, weigh_contacts
from rodsight.solver.posterior.sampler.error_draws import draw_errors, factorize_errors
from rodsight.solver.posterior.sampler.gibbs_sweeps import run
from rodsight.solver.posterior.sampler.records import (
    BALANCE_WEIGHT,
    CX,
    CY,
    DELTA,
    FX,
    LEVER,
    TORQUE,
    ModelParameters,
    SamplerGrains,
    SamplerPairs,
    SamplerState,
    initial_state,
    make_workspace,
)
from rodsight.solver.posterior.touching_kernels import accumulate_gaps, compute_touch_probabilities

from tests.reference.twins.sampler import PlainSampler, PlainState, plain_touching, resultants

pytestmark = pytest.mark.unit

# Relative: the plain precisions are differences of sums of about 1e4, and the odds hold Mills' ratio to 1e-8.
ROUNDING = 1e-6
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

    @property
    def start(self) -> SamplerState:
        return initial_state(self.pairs, self.grains, self.model.compliance_mean)


def make_case(*, scale_known: bool, soft: bool) -> Case:
    """Four grains in two frames with common radii: pairs of grains, walls, plates, reviewed and hopeless pairs."""
    rng, m = np.random.default_rng(8), RADII * FRAMES
    first, second = [], []
    for k in range(FRAMES):
        for i, j in ((0, 1), (1, 2), (2, 3), (0, 3), (0, 2), (1, 3), (0, -1), (1, -1), (2, -1), (3, -1), (3, -1)):
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
    members = [[row for row in range(c) if grain in (i[row], j[row])] for grain in range(m)]
    pairs = SamplerPairs(
        i, j, np.column_stack([np.cos(angle), np.sin(angle)]), gap, odds, friction, group,
        np.where(np.arange(c) % 5 == 0, 0.015, 0.0), np.where(np.arange(c) == 9, 0.7, 1.0),
    )  # fmt: skip
    balance_weight = np.ones(m)
    balance_weight[[2, 5]] = 0.0, 0.01
    grains = SamplerGrains(
        rng.uniform(0.6, 1.4, m), rng.normal(0.0, 0.4, (m, 2)) * scale_known, balance_weight,
        rng.uniform(0.01, 0.03, m), rng.uniform(0.01, 0.02, RADII),
        np.concatenate([[0], np.cumsum([len(each) for each in members])]), np.concatenate(members).astype(np.int64),
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


@pytest.fixture(scope="module", params=[(True, True), (False, False)], ids=["known scale, soft", "unknown scale, hard"])
def case(request) -> Case:
    known, soft = request.param
    return make_case(scale_known=known, soft=soft)


def plain_of(case: Case, state: SamplerState) -> PlainState:
    return PlainState(
        state.bearing.copy(), state.fn.copy(), state.ft.copy(), state.open_gap.copy(),
        state.body[:, CX : CY + 1].copy(), state.body[:RADII, DELTA].copy(),
        float(state.common[0]), float(state.common[1]),
    )  # fmt: skip


def assert_same(case: Case, state: SamplerState, plain: PlainState) -> None:
    """All unknowns are equal, and the sums that the kernels update are those of the forces."""
    np.testing.assert_array_equal(state.bearing, plain.bearing)
    for name in ("fn", "ft", "open_gap"):
        np.testing.assert_allclose(getattr(state, name), getattr(plain, name), rtol=ROUNDING, atol=ROUNDING)
    np.testing.assert_allclose(state.body[:, CX : CY + 1], plain.centre, atol=0.01 * ROUNDING)
    np.testing.assert_allclose(state.body[:, DELTA], np.tile(plain.radius, FRAMES), atol=0.01 * ROUNDING)
    np.testing.assert_allclose(state.common[:2], [plain.compliance, plain.offset], rtol=ROUNDING, atol=0.01 * ROUNDING)
    z = state.bearing
    assert state.common[2:] == pytest.approx([(state.fn[z] - 1.0).sum(), z.sum()], abs=ROUNDING)
    sums = resultants(case.pairs, case.grains, state.fn, state.ft)
    np.testing.assert_allclose(state.body[:, FX : TORQUE + 1], sums, atol=ROUNDING)
    np.testing.assert_allclose(state.normal_sum, normal_sums(case.pairs, state.fn, len(sums)), atol=ROUNDING)
    np.testing.assert_array_equal(state.body[:, LEVER], case.grains.lever)
    np.testing.assert_array_equal(state.body[:, BALANCE_WEIGHT], case.grains.balance_weight)
    for g in range(len(case.grains.group_load)):
        assert state.group_sum[g] == pytest.approx(state.fn[case.pairs.group == g].sum(), abs=ROUNDING)


def normal_sums(pairs: SamplerPairs, fn: np.ndarray, count: int) -> np.ndarray:
    """Sum of the normal forces on every grain (m,)."""
    return np.array([fn[(pairs.i == k) | (pairs.j == k)].sum() for k in range(count)])


def weighed(case: Case, state: SamplerState):
    """The workspace with everything that follows from the parameters and the state."""
    workspace = make_workspace(case.pairs, case.grains)
    weigh_contacts(case.pairs, case.grains, case.model, workspace)
    factorize_errors(case.grains, case.model, workspace)
    common = state.common
    workspace.observation[:, 1] = (
        case.pairs.gap - common[1] + np.where(state.bearing, common[0] * state.fn, -state.open_gap)
    )
    return workspace


def sampled_state(case: Case, sweeps: int = 3) -> SamplerState:
    """A state some sweeps after the start, with errors of all kinds."""
    state, count = case.start, len(case.pairs.gap)
    sums = np.zeros((count, 5)), np.zeros((len(state.body), 6)), np.zeros(4)
    schedule = np.tile(np.array(case.model), (sweeps, 1))
    run(
        np.random.default_rng(5), case.pairs, case.grains, schedule, state, make_workspace(case.pairs, case.grains), 1,
        sums,
    )  # fmt: skip
    return state


@pytest.mark.thorough
def test_forces_bearing_and_gaps_have_the_plain_conditional_distributions(case):
    state, branches = case.start, []
    one, two = np.random.default_rng(1), np.random.default_rng(1)
    for _ in range(SWEEPS):
        plain, followed = case.plain.draw_contacts(two, plain_of(case, state))
        workspace = weighed(case, state)
        draw_contacts(one, case.pairs, case.grains, case.model, workspace, state)
        assert_same(case, state, plain)
        residual = np.where(state.bearing, state.common[0] * state.fn, -state.open_gap)
        np.testing.assert_allclose(workspace.observation[:, 1], case.pairs.gap - state.common[1] + residual)
        branches += list(zip(followed, range(len(followed)), strict=True))
        draw_errors(one, case.grains, workspace, state)
        two.bit_generator.state = one.bit_generator.state
    assert one.random() == two.random()
    reached = {branch for branch, _ in branches}
    assert reached == {"hopeless", "open", "frictional", "smooth", "kept bearing", "kept open"}
    for kind in (case.pairs.j >= 0, case.pairs.j < 0, case.pairs.odds == FORCED, case.pairs.gap_sd > 0):
        assert {"frictional"} <= {branch for branch, c in branches if kind[c]}
    assert all(branch != "frictional" for branch, c in branches if case.pairs.gap[c] == HOPELESS_GAP)


def test_centres_and_radii_have_the_plain_joint_distribution(case):
    state = sampled_state(case)
    one, two = np.random.default_rng(2), np.random.default_rng(2)
    plain = case.plain.draw_errors(two, plain_of(case, state))
    draw_errors(one, case.grains, weighed(case, state), state)
    assert_same(case, state, plain)
    assert one.random() == two.random()
    assert np.ptp(state.body[:, CX]) > 0.01


def test_common_unknowns_have_the_plain_conditional_distributions(case):
    state = sampled_state(case)
    state.common[2:] = np.nan  # recomputed
    one, two = np.random.default_rng(3), np.random.default_rng(3)
    plain = case.plain.draw_common(two, plain_of(case, state))
    draw_common(one, case.pairs, case.model, weighed(case, state), state)
    assert_same(case, state, plain)
    assert one.random() == two.random()


def test_scale_of_the_forces_moves_by_the_plain_posterior(case):
    scales = []
    for seed in range(6):
        state = sampled_state(case)
        before = state.fn.sum()
        one, two = np.random.default_rng(seed), np.random.default_rng(seed)
        plain = case.plain.draw_scale(two, plain_of(case, state))
        draw_scale(one, case.pairs, case.grains, case.model, state)
        assert_same(case, state, plain)
        assert one.random() == two.random()
        scales.append(state.fn.sum() / before)
    assert len(set(scales)) > 2


def test_a_known_compliance_pulls_the_scale_of_the_forces_towards_it(case):
    narrow = replace(case, model=case.model._replace(compliance_mean=0.05, compliance_sd=0.002))
    found = []
    for seed in range(6):
        state = sampled_state(narrow)
        state.common[0] = 0.045
        one, two = np.random.default_rng(seed), np.random.default_rng(seed)
        plain = narrow.plain.draw_scale(two, plain_of(narrow, state))
        draw_scale(one, narrow.pairs, narrow.grains, narrow.model, state)
        assert_same(narrow, state, plain)
        found.append(state.common[0])
    assert 0.047 < np.mean(found) < 0.053


def test_without_bearing_pairs_no_scale_is_drawn(case):
    none = np.zeros(len(case.pairs.gap), bool)
    state = initial_state(case.pairs._replace(odds=np.full(len(none), -50.0)), case.grains, 0.1)
    one, two = np.random.default_rng(3), np.random.default_rng(3)
    draw_scale(one, case.pairs, case.grains, case.model, state)
    assert not state.bearing.any()
    assert state.common[0] == 0.1
    assert one.random() == two.random()


@pytest.mark.thorough
def test_sweeps_follow_the_schedule_and_only_the_last_are_summed(case):
    looser = case.model._replace(balance_sd=0.9, gap_law_sd=0.05)
    models, kept = [looser, looser, case.model, case.model, case.model], 2
    state, plain = case.start, plain_of(case, case.start)
    count, m = len(case.pairs.gap), len(case.grains.lever)
    sums = np.zeros((count, 5)), np.zeros((m, 6)), np.zeros(4)
    workspace = make_workspace(case.pairs, case.grains)
    one, two = np.random.default_rng(4), np.random.default_rng(4)
    run(one, case.pairs, case.grains, np.array(models), state, workspace, kept, sums)
    pair, error, common = np.zeros((count, 5)), np.zeros((m, 6)), np.zeros(4)
    for k, model in enumerate(models):
        plain = PlainSampler(case.pairs, case.grains, model).sweep(two, plain)
        if k >= len(models) - kept:
            z = plain.bearing.astype(float)
            pair += np.column_stack([z, plain.fn, plain.ft, plain.fn**2, plain.ft**2])
            radius = np.tile(plain.radius, FRAMES)
            pressure = normal_sums(case.pairs, plain.fn, m)
            error += np.column_stack([plain.centre, radius, radius**2, pressure, pressure**2])
            common += [plain.compliance, plain.compliance**2, plain.offset, plain.offset**2]
    assert_same(case, state, plain)
    for found, expected in zip(sums, (pair, error, common), strict=True):
        np.testing.assert_allclose(found, expected, rtol=ROUNDING, atol=ROUNDING)


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
