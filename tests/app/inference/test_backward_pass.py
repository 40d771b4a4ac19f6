"""Forces of the second frame are fused into the first where both are alike."""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np
import pytest
from rodsight.inference.backward_pass import (
    ALIKE,
    DRIFT,
    INDEPENDENT,
    MIN_SD,
    UNLISTED_SD,
    fuse_second_frame,
)
from rodsight.inference.first_frame import estimate_first_frame
from rodsight.solver.contacts.pairs import align, match_values
from rodsight.solver.frame_forces import FrameForces, FrameStatus
from rodsight.solver.posterior.frame_posterior import FramePosterior

from tests.app.inference.scenarios import Solved, agreement, solve

pytestmark = [
    pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels"),
    pytest.mark.thorough,
]

FUSED = "the forces of the next photograph are fused"


@pytest.fixture(scope="module")
def sheared(tmp_path_factory: pytest.TempPathFactory) -> Solved:
    return solve(tmp_path_factory.mktemp("scenario"), "sheared", 6, grains=100, frames=2)


@pytest.fixture(scope="module")
def pair(sheared: Solved) -> tuple[FramePosterior, FrameForces]:
    """Position-only estimate of the first frame, and the second frame."""
    first, second = sheared.frames
    found = estimate_first_frame(sheared.sequence, [first, replace(second, status=FrameStatus.SUSPECT)])
    assert found is not None
    assert FUSED not in found[1]
    return found[0], second


def test_the_second_frame_improves_the_first_of_a_sheared_packing(sheared):
    after, true = sheared.complete().frames[0], sheared.true[0]
    assert FUSED in after.reason
    assert agreement(after, true) > agreement(sheared.frames[0], true) + 0.01
    assert after.trust < agreement(after, true) + 0.03
    assert after.unbalance < 0.05


@pytest.mark.slow
def test_a_fresh_packing_keeps_its_own_forces(tmp_path):
    fresh = solve(tmp_path, "shear", 6, grains=100, frames=2)
    assert FUSED not in fresh.complete().frames[0].reason


def test_fused_forces_stay_in_the_coulomb_cone_with_smaller_standard_deviations(sheared, pair):
    first, _ = pair
    fused = fuse_second_frame(sheared.sequence, *pair)
    assert fused is not None
    friction = sheared.sequence.packing.material.friction
    cone = np.abs(first.ft) <= friction * first.fn * (1 + 1e-6) + 1e-9
    assert (np.abs(fused.ft) <= friction * fused.fn * (1 + 1e-6) + 1e-9)[cone].all()
    stated = np.maximum(first.fn_sd, 0.02 * first.fn.mean())
    assert (fused.fn_sd <= stated * fused.fn.sum() / first.fn.sum() * 1.05 + 1e-12).all()


def test_each_force_counts_by_its_information_and_the_drift_between_the_frames(sheared, pair):
    first, second = pair
    fused = fuse_second_frame(sheared.sequence, first, second)
    assert fused is not None
    _, one, two = align(first.contacts.key, first.fn, second.contacts.key, second.fn)
    scale, mean = one.sum() / two.sum(), first.fn.mean()
    alike = min(max((np.corrcoef(one, two)[0, 1] - ALIKE[0]) / (ALIKE[1] - ALIKE[0]), 0.0), 1.0)
    drift = DRIFT * np.mean((one - scale * two) ** 2)
    values, sd = (
        scale * match_values(first.contacts.key, second.contacts.key, each, fill=fill)
        for each, fill in ((second.fn, 0.0), (second.fn_sd, UNLISTED_SD * mean / scale))
    )
    own = INDEPENDENT * alike * np.maximum(first.fn_sd, MIN_SD * mean) ** 2
    weight = own / (own + sd**2 + drift)
    expected = (1.0 - weight) * first.fn + weight * values
    np.testing.assert_allclose(fused.fn / fused.fn.sum(), expected / expected.sum(), rtol=1e-9)


def test_the_scale_follows_the_second_frame_and_the_loads(sheared, pair):
    first, second = pair
    sequence = sheared.sequence
    unloaded = [replace(each, load=None) for each in sequence.snapshots]
    plate = np.isfinite(sequence.packing.pressure)
    half = np.where(plate, 0.5 * sequence.packing.walls_of(unloaded[0]).load, np.nan)
    lighter = [replace(unloaded[0], load=half), *unloaded[1:]]
    doubled = {name: 2.0 * getattr(second, name) for name in ("fn", "ft", "fn_sd", "ft_sd")}
    fused = [
        fuse_second_frame(replace(sequence, snapshots=snapshots), first, frame)
        for snapshots, frame in ((unloaded, second), (lighter, second), (unloaded, replace(second, **doubled)))
    ]
    assert all(each is not None for each in fused)
    of_second, of_lighter, of_doubled = (each.fn for each in fused if each is not None)
    assert of_second.sum() == pytest.approx(second.fn.sum(), rel=0.05)
    np.testing.assert_allclose(of_lighter, 0.5 * of_second, rtol=1e-6)
    np.testing.assert_allclose(of_doubled, 2.0 * of_second, rtol=1e-6)


def test_the_weight_falls_with_the_agreement(sheared, pair):
    first, second = pair
    pattern = np.random.default_rng(1).standard_normal(len(second.fn)) * second.fn.mean()
    weights, trusts = [], []
    for noise in (0.0, 0.2, 0.4, 0.5, 0.6, 3.0):
        other = np.abs(second.fn + noise * pattern)
        fused = fuse_second_frame(sheared.sequence, first, replace(second, fn=other))
        there = match_values(first.contacts.key, second.contacts.key, other)
        there = there * first.fn.sum() / other.sum() - first.fn
        weights.append(0.0 if fused is None else float((fused.fn - first.fn) @ there / (there @ there)))
        trusts += [] if fused is None else [fused.trust]
    assert weights[0] > 0.1
    assert weights[-1] == 0.0
    assert (np.diff(weights) <= 1e-9).all()
    assert (np.array(trusts) < 1.0).all()


@pytest.mark.parametrize(("soft", "changes"), [(True, {}), (False, {"position_weight": 0.8})])
def test_a_second_frame_without_information_of_its_own_is_not_fused(sheared, pair, soft, changes):
    first, second = pair
    sequence = replace(sheared.sequence, settings=replace(sheared.sequence.settings, soft=soft))
    assert fuse_second_frame(sequence, first, replace(second, **changes)) is None


def test_nothing_is_fused_without_a_load(sheared, pair):
    sequence = sheared.sequence
    free = replace(
        sequence, packing=replace(sequence.packing, pressure=np.full_like(sequence.packing.pressure, np.nan))
    )
    assert not free.packing.scale_is_known
    assert fuse_second_frame(free, *pair) is None
