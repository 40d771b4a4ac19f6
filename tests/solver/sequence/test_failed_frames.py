"""A frame that is unusable or cannot be solved fails alone."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from rodsight.solver.assessment.status import CHAIN_UNBALANCED
from rodsight.solver.bodies.grains import Grains
from rodsight.solver.frame_forces import FrameStatus
from rodsight.solver.sequence import frames as sequence
from rodsight.solver.sequence.failure import find_fault
from rodsight.solver.sequence.frames import SequencePart

from tests.solver.sequence.test_frames import ENSEMBLE, SETTINGS, run, sheared_frames, solved_heap

BAD, COUNT = 3, 7


def blank(snapshot):
    """A black photograph: no grain is found in it."""
    return replace(snapshot, position=np.full_like(snapshot.position, np.nan), present=np.zeros(36, bool))


def without_walls(snapshot):
    return replace(snapshot, endpoints=np.full_like(snapshot.endpoints, np.nan))


def infinite(snapshot):
    return replace(snapshot, position=np.where(np.arange(36)[:, None] == 5, np.inf, snapshot.position))


def sound_frames(settings):
    """The frames of the heap without faults."""
    return [frame for frame, _ in solved_heap(settings, COUNT)]


@cache
def solve_with_fault(settings, spoil):
    packing, snapshots = sheared_frames(COUNT)
    snapshots[BAD] = spoil(snapshots[BAD])
    return run(packing, snapshots, settings)


def assert_only_the_bad_one_failed(frames, sound):
    assert [frame.status is FrameStatus.FAILED for frame in frames] == [k == BAD for k in range(COUNT)]
    failed = frames[BAD]
    assert failed.contacts.count == len(failed.fn) == 0
    assert failed.trust == 0.0
    assert failed.failed_reason
    assert not any(frame.failed_reason for frame in frames if frame is not failed)
    assert frames[BAD + 1].status is FrameStatus.RESET
    assert frames[BAD + 1].frames_since_reset == 0
    for frame, usual in zip(frames[BAD + 1 :], sound[BAD + 1 :], strict=True):
        assert frame.contacts.count > 30
        assert frame.unbalance < max(1.5 * usual.unbalance, CHAIN_UNBALANCED)  # a chain starts from zero


@pytest.mark.parametrize(
    "settings",
    [pytest.param(SETTINGS, id="nlgs"), pytest.param(ENSEMBLE, id="ensemble", marks=pytest.mark.thorough)],
)
@pytest.mark.parametrize("spoil", [blank, without_walls, infinite])
def test_an_unusable_frame_fails_alone(settings, spoil):
    frames = [frame for frame, _ in solve_with_fault(settings, spoil)]
    assert_only_the_bad_one_failed(frames, sound_frames(settings))


@pytest.mark.slow
@pytest.mark.parametrize("settings", [SETTINGS, ENSEMBLE], ids=["nlgs", "ensemble"])
def test_a_half_black_frame_is_reported_with_a_low_trust(settings):
    packing, snapshots = sheared_frames(COUNT)
    half = snapshots[BAD].position[:, 0] < np.median(snapshots[BAD].position[:, 0])
    position = np.where(half[:, None], np.nan, snapshots[BAD].position)
    snapshots[BAD] = replace(snapshots[BAD], position=position, present=~half)
    frames = [frame for frame, _ in run(packing, snapshots, settings)]
    reported = [frame.frame for frame in frames if "50 % of the grains are not found" in frame.reason]
    assert reported == [BAD]
    assert frames[BAD].status is FrameStatus.SUSPECT
    assert not frames[BAD].trust > 0.5


def test_an_exception_fails_the_frame_and_is_reported(monkeypatch):
    packing, snapshots = sheared_frames(COUNT)
    solve_frame = sequence.solve_frame

    def solve(problem, state):
        if problem.k == BAD:
            raise ZeroDivisionError("by an\nempty frame")
        return solve_frame(problem, state)

    sound, observed = sound_frames(SETTINGS), []
    monkeypatch.setattr(sequence, "solve_frame", solve)
    frames = [frame for frame, _ in run(packing, snapshots, observer=lambda *event: observed.append(event))]
    assert_only_the_bad_one_failed(frames, sound)
    assert frames[BAD].failed_reason == "it could not be solved (ZeroDivisionError: by an empty frame)"
    ((frame, error),) = observed
    assert (frame, type(error)) == (BAD, ZeroDivisionError)


@pytest.mark.parametrize("stop", [KeyboardInterrupt, SystemExit, MemoryError])
def test_interrupts_and_lack_of_memory_end_the_sequence(monkeypatch, stop):
    def solve(problem, state):
        raise stop

    monkeypatch.setattr(sequence, "solve_frame", solve)
    with pytest.raises(stop):
        run(*sheared_frames(2))


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # as in a run, where warnings are not errors
@pytest.mark.parametrize("settings", [SETTINGS, ENSEMBLE], ids=["nlgs", "ensemble"])
def test_infinite_masses_fail_every_frame(settings):
    packing, snapshots = sheared_frames(3)
    grains = packing.grains
    heavy = Grains.of_rods(grains.radius, density=1e308, length=1e3)
    frames = [frame for frame, _ in run(replace(packing, grains=heavy), snapshots, settings)]
    assert {frame.status for frame in frames} == {FrameStatus.FAILED}


@pytest.mark.thorough
def test_a_sequence_resumes_after_a_failed_frame_bit_for_bit():
    packing, snapshots = sheared_frames(COUNT)
    snapshots[BAD] = blank(snapshots[BAD])
    whole = solve_with_fault(ENSEMBLE, blank)
    resumed = run(packing, snapshots, ENSEMBLE, part=SequencePart(BAD + 1, [whole[BAD][1]]))
    for (frame, _), (again, _) in zip(whole[BAD + 1 :], resumed, strict=True):
        assert np.array_equal(frame.fn, again.fn)


def test_all_frames_of_an_unusable_sequence_fail():
    packing, snapshots = sheared_frames(3)
    frames = [frame for frame, _ in run(packing, [blank(each) for each in snapshots], ENSEMBLE)]
    assert {frame.status for frame in frames} == {FrameStatus.FAILED}


def test_forces_out_of_balance_or_not_finite_are_a_fault():
    frame, _ = run(*sheared_frames(3))[-1]
    assert find_fault(frame) == ""
    assert "not in equilibrium" in find_fault(replace(frame, grain_unbalance=np.full(36, 1.2)))
    assert "no finite ft" in find_fault(replace(frame, ft=np.where(frame.ft == frame.ft.max(), np.nan, frame.ft)))
    assert "not finite" in find_fault(replace(frame, unbalance=np.nan))
