"""Sliding that is read over several photographs, and histories that are carried as far."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.contacts.verdicts import Verdicts
from rodsight.solver.frame_forces import FrameStatus
from rodsight.solver.nlgs.chain import ChainSettings
from rodsight.solver.sequence import frames as frames_module
from rodsight.solver.sequence.frames import SequencePart, solve_sequence
from rodsight.solver.sequence.settings import SequenceSettings

from tests.solver.sequence.test_frames import sheared_frames

ONE = SequenceSettings(estimator="ensemble", chain=ChainSettings(sweeps=40), positions="never")
THREE = replace(ONE, span=3)
FRAMES = 8


def solve(settings, count=FRAMES, snapshots=None, **options):
    packing, sheared = sheared_frames(count)
    return list(solve_sequence(packing, sheared if snapshots is None else snapshots, settings, **options))


def begins(monkeypatch, settings=THREE, **options) -> list[float]:
    """Photographs between the beginning of the motion that each frame reads, and the frame."""
    read = []

    def pose(sequence, k, state, *rest):
        problem = pose_frame(sequence, k, state, *rest)
        read.append(problem.motion.interval / 30.0 if problem.motion.ends_here else 0.0)
        return problem

    pose_frame = frames_module.pose_frame
    monkeypatch.setattr(frames_module, "pose_frame", pose)
    solve(settings, **options)
    return read


def test_every_frame_reads_the_motion_of_so_many_photographs(monkeypatch):
    assert begins(monkeypatch) == pytest.approx([0, 1, 2, 3, 3, 3, 3, 3])


@pytest.mark.slow
def test_a_frame_continues_the_forces_of_the_frame_where_its_motion_begins(monkeypatch):
    solved = solve(THREE)
    continued = {}

    def keep(problem, state):
        continued[problem.k] = state.members
        return solve_frame(problem, state)

    solve_frame = frames_module.solve_frame
    monkeypatch.setattr(frames_module, "solve_frame", keep)
    solve(THREE)
    for k in range(3, FRAMES):
        np.testing.assert_array_equal(continued[k].soft.force, solved[k - 3][1].members.soft.force)
        assert not np.array_equal(continued[k].soft.force, solved[k - 1][1].members.soft.force)


@pytest.mark.slow
def test_what_is_counted_by_photographs_is_still_counted_so():
    one, three = solve(ONE), solve(THREE)
    for (single, _), (spanned, state) in zip(one, three, strict=True):
        assert spanned.frames_since_reset == single.frames_since_reset
        assert spanned.age.max() == single.age.max()
        assert spanned.shear_step == pytest.approx(single.shear_step, rel=0.05)
        assert state.time == 30.0 * spanned.frame


@pytest.mark.slow
def test_motion_and_forces_from_before_a_reset_are_not_used(monkeypatch):
    assert begins(monkeypatch, verdicts={4: Verdicts(reset=True)}) == pytest.approx([0, 1, 2, 3, 3, 1, 2, 3])
    solved = solve(THREE, verdicts={4: Verdicts(reset=True)})
    assert solved[4][0].status is FrameStatus.RESET
    assert [frame.frames_since_reset for frame, _ in solved] == [0, 1, 2, 3, 0, 1, 2, 3]


@pytest.mark.thorough
def test_motion_from_before_a_reversal_is_not_read(monkeypatch):
    _, sheared = sheared_frames(6)
    there_and_back = [replace(sheared[row], time=30.0 * k) for k, row in enumerate((0, 1, 2, 3, 4, 3, 2, 1))]
    read = begins(monkeypatch, snapshots=there_and_back)
    assert read == pytest.approx([0, 1, 2, 3, 3, 1, 2, 3])


@pytest.mark.thorough
def test_a_frame_that_fails_costs_no_other(monkeypatch):
    solved = solve(THREE, failed={4: "dark"})
    assert [frame.status is FrameStatus.FAILED for frame, _ in solved] == [k == 4 for k in range(FRAMES)]
    assert solved[5][0].status is FrameStatus.RESET


@pytest.mark.thorough
@pytest.mark.parametrize("first", [pytest.param(1, marks=pytest.mark.slow), 4, 6])
def test_a_sequence_resumes_from_the_last_states_bit_for_bit(first):
    packing, snapshots = sheared_frames(FRAMES)
    whole = solve(THREE)
    states = [state for _, state in whole[max(first - 3, 0) : first]]
    resumed = solve_sequence(packing, snapshots, THREE, SequencePart(first, states))
    for (frame, _), (again, _) in zip(whole[first:], resumed, strict=True):
        assert np.array_equal(frame.fn, again.fn)
        assert np.array_equal(frame.age, again.age)


def test_a_single_chain_reads_neighbouring_photographs(monkeypatch):
    chain = SequenceSettings(estimator="nlgs", chain=ChainSettings(sweeps=40), threshold=2e-4, span=3)
    assert begins(monkeypatch, chain, count=4) == pytest.approx([0, 1, 1, 1])
