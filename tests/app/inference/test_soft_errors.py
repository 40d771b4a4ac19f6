"""Radii of soft rods that are told wrong are found with the forces; those that are right are left alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
import pytest
from rodsight.experiment.experiment import load_experiment, read_tracks
from rodsight.inference.inference import CorrectedSequence, solve_all
from rodsight.inference.known_forces import soft_errors
from rodsight.inference.known_forces.soft_errors import TRUST_AT_MOST, correct_soft
from rodsight.study.worlds.world_score import correct_world, true_forces
from rodsight.synthetic.worlds.making import make_world
from rodsight.synthetic.worlds.names import WorldName

from solver.sequence.frames import solve_sequence
from solver.statistics.agreement import compare_forces

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")


def corrected(folder: Path, world: WorldName, seed: int, rods: int) -> tuple[CorrectedSequence, np.ndarray, np.ndarray]:
    """A world as corrected, its told and its true radii (n,) [m]."""
    made = make_world(folder, world, seed, grains=rods)
    experiment = load_experiment(made.folder, ())
    return correct_world(experiment), read_tracks(experiment).radius, made.truth.radius


def test_radii_that_are_wrong_are_told_by_forces(tmp_path):
    sequence, told, true = corrected(tmp_path, "soft_radii_03", 9, 80)
    assert sequence.settings.soft
    assert np.std(sequence.tracks.radius - true) < 0.8 * np.std(told - true)
    assert sequence.settings.soft_trust == TRUST_AT_MOST
    np.testing.assert_array_equal(sequence.packing.grains.radius, sequence.tracks.radius)


def test_radii_that_are_right_stay_as_they_are_told(tmp_path):
    sequence, told, _ = corrected(tmp_path, "soft", 9, 80)
    assert sequence.settings.soft
    np.testing.assert_array_equal(sequence.tracks.radius, told)
    assert sequence.settings.soft_trust > TRUST_AT_MOST
    hard = replace(sequence, settings=replace(sequence.settings, soft=False))
    assert correct_soft(hard) is hard


def test_where_few_frames_tell_nothing_no_more_are_solved_beforehand(tmp_path, monkeypatch):
    solved = []

    def counted(*args, **told):
        for each in solve_sequence(*args, **told):
            solved.append(each[0].frame)
            yield each

    monkeypatch.setattr(soft_errors, "solve_sequence", counted)
    sequence, told, _ = corrected(tmp_path, "soft", 1, 150)
    assert solved == list(range(soft_errors.LOOK))
    np.testing.assert_array_equal(sequence.tracks.radius, told)


@pytest.mark.slow
@pytest.mark.parametrize(("world", "least"), [("soft_radii_03", 0.95), ("soft_unseen", 0.95)])
def test_forces_of_soft_rods_are_right_where_the_input_is_not(tmp_path, world, least):
    sequence, _, _ = corrected(tmp_path, world, 8, 300)
    true = true_forces(load_experiment(tmp_path, ()), sequence)
    seen = []
    for frame in [each.forces for each in solve_all(sequence)][3:]:
        found = compare_forces(frame.contacts.key, np.column_stack([frame.fn, frame.ft]), *true[frame.frame])
        seen.append(found.r_fn)
        assert frame.trust < found.r_fn + 0.03
    assert np.mean(seen) > least
