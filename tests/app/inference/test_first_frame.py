"""The first photograph is solved once more, with what later ones tell of every rod's own errors."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
import pytest
from rodsight.experiment.experiment import load_experiment
from rodsight.inference import inference
from rodsight.inference.inference import (
    CorrectedSequence,
    SolvedFrame,
    renew_first,
    solve_all,
    solve_frames,
)
from rodsight.inference.known_forces.first_frame import ask_first_again
from rodsight.study.worlds.world_score import correct_world, true_forces
from rodsight.synthetic.worlds.making import make_world
from rodsight.synthetic.worlds.names import WorldName

from solver.sequence.frame_forces import FrameForces, FrameStatus
from solver.statistics.agreement import compare_forces

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")

RODS = 70


def correct(folder: Path, world: WorldName, seed: int, rods: int = RODS) -> tuple[CorrectedSequence, tuple]:
    """A world as tracked and corrected, and its true forces."""
    experiment = load_experiment(make_world(folder, world, seed, grains=rods).folder, ())
    sequence = correct_world(experiment)
    return sequence, true_forces(experiment, sequence)


def agreement(frame: FrameForces, true: tuple) -> float:
    key, force = true
    return compare_forces(frame.contacts.key, np.column_stack([frame.fn, frame.ft]), key, force).r_fn


@pytest.fixture(scope="module")
def wrong_centres(tmp_path_factory: pytest.TempPathFactory) -> tuple[CorrectedSequence, tuple, list[SolvedFrame]]:
    sequence, true = correct(tmp_path_factory.mktemp("world"), "centres", 5)
    return sequence, true, list(solve_frames(sequence))


def test_the_first_photograph_is_renewed_and_says_so(wrong_centres):
    sequence, true, before = wrong_centres
    after = renew_first(sequence, [each.forces for each in before])
    assert after is not None
    assert "later photographs tell" in after.forces.reason
    assert agreement(after.forces, true[0]) > agreement(before[0].forces, true[0]) + 0.05
    assert after.forces.trust < agreement(after.forces, true[0])
    assert after.statistics.contact_count == pytest.approx(before[0].statistics.contact_count, rel=0.1)


def test_the_others_stay_as_they_are(wrong_centres, monkeypatch):
    sequence, _, before = wrong_centres
    first = replace(before[0], state=before[1].state)
    monkeypatch.setattr(inference, "renew_first", lambda *_: first)
    monkeypatch.setattr(inference, "solve_frames", lambda *_, **__: iter(before))
    assert [id(each) for each in solve_all(sequence)] == [id(each) for each in [first, *before[1:]]]


def test_it_follows_from_the_others_alone(wrong_centres):
    sequence, _, before = wrong_centres
    frames = [each.forces for each in before]
    changed = [replace(frames[0], fn=0.0 * frames[0].fn), *frames[1:]]
    first, again = ask_first_again(sequence, frames), ask_first_again(sequence, changed)
    assert first is not None
    assert again is not None
    np.testing.assert_array_equal(first.fn, again.fn)


def test_who_expects_to_ask_again_and_cannot_asks_at_length(wrong_centres, monkeypatch):
    sequence, _, before = wrong_centres
    expecting = sequence.with_first_renewed()
    assert expecting.settings.first_again
    assert not replace(sequence, calibration=None).with_first_renewed().settings.first_again
    monkeypatch.setattr(inference, "ask_first_again", lambda *_: None)
    monkeypatch.setattr(inference, "carry_back", lambda *_: None)
    frames = [each.forces for each in before]
    assert renew_first(sequence, frames) is None
    renewed = renew_first(expecting, frames)
    assert renewed is not None
    assert "asked at length" in renewed.forces.reason
    one, two = frames[0], renewed.forces
    force = [np.column_stack([each.fn, each.ft]) for each in (one, two)]
    assert compare_forces(one.contacts.key, force[0], two.contacts.key, force[1]).r_fn > 0.98


def test_nothing_is_asked_where_nothing_can_be_told(wrong_centres):
    sequence, _, before = wrong_centres
    frames = [each.forces for each in before]
    assert ask_first_again(replace(sequence, calibration=None), frames) is None
    assert ask_first_again(sequence, frames[:1]) is None
    unsound = [replace(each, status=FrameStatus.SUSPECT) for each in frames]
    assert ask_first_again(sequence, unsound) is None


@pytest.mark.slow
def test_exact_rods_are_left_as_they_are(tmp_path):
    sequence, _ = correct(tmp_path, "shear", 5)
    assert ask_first_again(sequence, [each.forces for each in solve_frames(sequence)]) is None


@pytest.mark.slow
@pytest.mark.parametrize(("world", "least"), [("centres", 0.9), ("radii_1", 0.9), ("radii_03", 0.92)])
def test_forces_of_the_first_photograph_are_right_where_rods_are_told_wrong(tmp_path, world, least):
    sequence, true = correct(tmp_path, world, 4, 450)
    frame = solve_all(sequence)[0].forces
    assert agreement(frame, true[0]) > least
    assert frame.trust < agreement(frame, true[0]) + 0.03
