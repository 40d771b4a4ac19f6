"""Forces of the second photograph carried back to the first, where a test is photographed from its middle on."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
import pytest
from rodsight.experiment.experiment import load_experiment
from rodsight.inference.inference import CorrectedSequence, renew_first, solve_frames
from rodsight.inference.known_forces.carried_back import carry_back
from rodsight.study.worlds.world_score import correct_world, true_forces
from rodsight.synthetic.worlds.making import make_world
from rodsight.synthetic.worlds.names import WorldName

from solver.contacts.pairs import recall
from solver.sequence.frame_forces import FrameForces, FrameStatus
from solver.statistics.agreement import compare_forces

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")


def solve_two(folder: Path, world: WorldName, seed: int) -> tuple[CorrectedSequence, tuple, list[FrameForces]]:
    """A world as corrected, its true forces, its first two frames."""
    experiment = load_experiment(make_world(folder, world, seed, grains=100).folder, ())
    sequence, frames = correct_world(experiment), []
    for frame in solve_frames(sequence):
        frames.append(frame.forces)
        if len(frames) == 2:
            break
    return sequence, true_forces(experiment, sequence), frames


def agreement(frame: FrameForces, true: tuple) -> float:
    return compare_forces(frame.contacts.key, np.column_stack([frame.fn, frame.ft]), *true).r_fn


@pytest.fixture(scope="module")
def sheared(tmp_path_factory: pytest.TempPathFactory) -> tuple[CorrectedSequence, tuple, list[FrameForces]]:
    return solve_two(tmp_path_factory.mktemp("world"), "sheared", 6)


def test_a_packing_under_way_has_nearly_the_forces_of_its_second_photograph(sheared):
    sequence, true, frames = sheared
    after = renew_first(sequence, frames)
    assert after is not None
    assert "the next photograph count" in after.forces.reason
    assert agreement(after.forces, true[0]) > agreement(frames[0], true[0]) + 0.01
    assert after.forces.trust < agreement(after.forces, true[0]) + 0.03
    assert after.forces.unbalance < 0.05


def test_a_fresh_packing_keeps_its_own(tmp_path):
    sequence, _, frames = solve_two(tmp_path, "shear", 6)
    assert carry_back(sequence, *frames) is None


def test_what_is_carried_lies_between_both_and_in_the_cone(sheared):
    sequence, _, (first, second) = sheared
    carried = carry_back(sequence, first, second)
    assert carried is not None
    assert (np.abs(carried.ft) <= sequence.packing.material.friction * carried.fn * (1 + 1e-6) + 1e-9).all()
    stated = np.maximum(first.fn_sd, 0.02 * first.fn.mean())
    assert (carried.fn_deviation <= stated * carried.fn.sum() / first.fn.sum() + 1e-12).all()


def test_the_size_is_the_second_photographs_as_its_load_tells(sheared):
    sequence, _, (first, second) = sheared
    still = [replace(each, load=None) for each in sequence.snapshots]
    plate = np.isfinite(sequence.packing.pressure)
    half = np.where(plate, 0.5 * sequence.packing.walls_of(still[0]).load, np.nan)
    lighter = [replace(still[0], load=half), *still[1:]]
    doubled = {name: 2.0 * getattr(second, name) for name in ("fn", "ft", "fn_sd", "ft_sd")}
    told = [
        carry_back(replace(sequence, snapshots=snapshots), first, frame)
        for snapshots, frame in ((still, second), (lighter, second), (still, replace(second, **doubled)))
    ]
    assert all(each is not None for each in told)
    of_second, of_lighter, of_doubled = (each.fn for each in told if each is not None)
    assert of_second.sum() == pytest.approx(second.fn.sum(), rel=0.03)
    np.testing.assert_allclose(of_lighter, 0.5 * of_second, rtol=1e-6)
    np.testing.assert_allclose(of_doubled, 2.0 * of_second, rtol=1e-6)


def test_it_counts_the_less_the_less_both_are_alike(sheared):
    sequence, _, (first, second) = sheared
    way = np.random.default_rng(1).standard_normal(len(second.fn)) * second.fn.mean()
    weights = []
    for noise in (0.0, 0.2, 0.4, 0.5, 0.6, 3.0):
        other = np.abs(second.fn + noise * way)
        carried = carry_back(sequence, first, replace(second, fn=other))
        there = recall(first.contacts.key, second.contacts.key, other)
        there = there * first.fn.sum() / other.sum() - first.fn
        weights.append(0.0 if carried is None else float((carried.fn - first.fn) @ there / (there @ there)))
    assert weights[0] > 0.1
    assert weights[-1] == 0.0
    assert (np.diff(weights) <= 0.0).all()
    assert np.max(-np.diff(weights)) < 0.8 * weights[0]  # by and by


@pytest.mark.parametrize(
    ("of_first", "of_second"),
    [
        ({"soft": 1}, {}),
        ({}, {"status": FrameStatus.SUSPECT}),
        ({}, {"positions_share": 0.8}),
    ],
)
def test_nothing_is_carried_where_the_second_says_nothing_of_its_own(sheared, of_first, of_second):
    sequence, _, (first, second) = sheared
    assert carry_back(sequence, replace(first, **of_first), replace(second, **of_second)) is None


def test_nothing_is_carried_without_a_load(sheared):
    sequence, _, frames = sheared
    free = replace(
        sequence, packing=replace(sequence.packing, pressure=np.full_like(sequence.packing.pressure, np.nan))
    )
    assert not free.packing.scale_is_known
    assert carry_back(free, *frames) is None
