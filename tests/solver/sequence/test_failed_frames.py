"""One frame that shows nothing, or cannot be solved, costs no other."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from solver.bodies.grains import Grains
from solver.sequence import frames as sequence
from solver.sequence.failure import find_fault
from solver.sequence.frame_forces import FrameStatus
from solver.sequence.judging.judgement import CHAIN_UNBALANCED
from tests.solver.sequence.test_frames import ENSEMBLE, SETTINGS, run, sheared_frames

BAD, COUNT = 3, 7


def blank(snapshot):
    """A black photograph: no grain is found in it."""
    return replace(snapshot, position=np.full_like(snapshot.position, np.nan), present=np.zeros(36, bool))


def without_walls(snapshot):
    return replace(snapshot, endpoints=np.full_like(snapshot.endpoints, np.nan))


def infinite(snapshot):
    return replace(snapshot, position=np.where(np.arange(36)[:, None] == 5, np.inf, snapshot.position))


@cache
def sound_frames(settings):
    """The frames of the heap when nothing is wrong."""
    return [frame for frame, _ in run(*sheared_frames(COUNT), settings)]


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


@pytest.mark.parametrize("settings", [SETTINGS, ENSEMBLE], ids=["nlgs", "ensemble"])
@pytest.mark.parametrize("spoil", [blank, without_walls, infinite])
def test_a_frame_that_shows_nothing_fails_alone(settings, spoil):
    packing, snapshots = sheared_frames(COUNT)
    snapshots[BAD] = spoil(snapshots[BAD])
    assert_only_the_bad_one_failed([frame for frame, _ in run(packing, snapshots, settings)], sound_frames(settings))


@pytest.mark.parametrize("settings", [SETTINGS, ENSEMBLE], ids=["nlgs", "ensemble"])
def test_a_frame_that_is_half_black_is_told_and_hardly_believed(settings):
    packing, snapshots = sheared_frames(COUNT)
    half = snapshots[BAD].position[:, 0] < np.median(snapshots[BAD].position[:, 0])
    position = np.where(half[:, None], np.nan, snapshots[BAD].position)
    snapshots[BAD] = replace(snapshots[BAD], position=position, present=~half)
    frames = [frame for frame, _ in run(packing, snapshots, settings)]
    told = [frame.frame for frame in frames if "50 % of the grains are not seen" in frame.reason]
    assert told == [BAD]
    assert frames[BAD].status is FrameStatus.SUSPECT
    assert not frames[BAD].trust > 0.5


def test_what_a_method_raises_fails_the_frame_and_is_told(monkeypatch):
    packing, snapshots = sheared_frames(COUNT)
    solve_frame = sequence.solve_frame

    def solve(problem, state):
        if problem.k == BAD:
            raise ZeroDivisionError("by an\nempty frame")
        return solve_frame(problem, state)

    sound, heard = sound_frames(SETTINGS), []
    monkeypatch.setattr(sequence, "solve_frame", solve)
    frames = [frame for frame, _ in run(packing, snapshots, observer=lambda *told: heard.append(told))]
    assert_only_the_bad_one_failed(frames, sound)
    assert frames[BAD].failed_reason == "it could not be solved (ZeroDivisionError: by an empty frame)"
    ((frame, error),) = heard
    assert (frame, type(error)) == (BAD, ZeroDivisionError)


@pytest.mark.parametrize("stop", [KeyboardInterrupt, SystemExit, MemoryError])
def test_what_is_not_the_frames_fault_ends_the_sequence(monkeypatch, stop):
    def solve(problem, state):
        raise stop

    monkeypatch.setattr(sequence, "solve_frame", solve)
    with pytest.raises(stop):
        run(*sheared_frames(2))


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # as where nobody makes them errors
@pytest.mark.parametrize("settings", [SETTINGS, ENSEMBLE], ids=["nlgs", "ensemble"])
def test_masses_beyond_all_numbers_fail_every_frame(settings):
    packing, snapshots = sheared_frames(3)
    grains = packing.grains
    heavy = Grains.of_rods(grains.radius, density=1e308, length=1e3)
    frames = [frame for frame, _ in run(replace(packing, grains=heavy), snapshots, settings)]
    assert {frame.status for frame in frames} == {FrameStatus.FAILED}


def test_a_failure_goes_on_from_a_kept_state_bit_for_bit():
    packing, snapshots = sheared_frames(COUNT)
    snapshots[BAD] = blank(snapshots[BAD])
    whole = run(packing, snapshots, ENSEMBLE)
    resumed = run(packing, snapshots, ENSEMBLE, state=whole[BAD][1], first=BAD + 1)
    for (frame, _), (again, _) in zip(whole[BAD + 1 :], resumed, strict=True):
        assert np.array_equal(frame.fn, again.fn)


def test_a_sequence_that_shows_nothing_fails_whole():
    packing, snapshots = sheared_frames(3)
    frames = [frame for frame, _ in run(packing, [blank(each) for each in snapshots], ENSEMBLE)]
    assert {frame.status for frame in frames} == {FrameStatus.FAILED}


def test_forces_that_balance_nothing_are_a_fault():
    frame, _ = run(*sheared_frames(3))[-1]
    assert find_fault(frame) == ""
    assert "balance nothing" in find_fault(replace(frame, grain_unbalance=np.full(36, 1.2)))
    assert "no finite ft" in find_fault(replace(frame, ft=np.where(frame.ft == frame.ft.max(), np.nan, frame.ft)))
    assert "not finite" in find_fault(replace(frame, unbalance=np.nan))
