"""Frames that were solved to judge a sequence are not solved again."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numba
import numpy as np
import pytest
from rodsight.inference import solve_frames as module
from rodsight.inference.frame_store import MemoryStore
from rodsight.inference.solve_frames import Beginning, InferenceObserver, solve_beginning, solve_frames

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")

JUDGED, FRAMES = 2, 4


@dataclass
class Recorder(InferenceObserver):
    """An observer that records the frames it receives."""

    frames: list[int] = field(default_factory=list)

    def __post_init__(self):
        super().__init__()

    def solved(self, frame):
        self.frames.append(frame.forces.frame)


@pytest.fixture
def sequence(wrong_centres):
    return replace(wrong_centres.sequence, snapshots=wrong_centres.sequence.snapshots[:FRAMES])


def test_a_sequence_continues_behind_its_beginning_bit_for_bit(sequence, monkeypatch):
    alone, continued, observer = MemoryStore(), MemoryStore(), Recorder()
    solve_frames(sequence, alone, InferenceObserver())
    beginning = solve_beginning(sequence, JUDGED)
    assert [each.forces.frame for each in beginning.frames] == list(range(JUDGED))
    monkeypatch.setattr(module, "solve_sequence", None)  # a call fails
    solve_frames(sequence, continued, observer, beginning)
    assert observer.frames == list(range(FRAMES))
    for one, other in zip(alone.frames, continued.frames, strict=True):
        np.testing.assert_array_equal(one.forces.fn, other.forces.fn)
        np.testing.assert_array_equal(one.forces.fn_sd, other.forces.fn_sd)


def test_a_store_that_holds_frames_is_continued_without_a_beginning(sequence):
    store, observer = MemoryStore(), Recorder()
    store.save(solve_beginning(sequence, 1).frames[0])
    solve_frames(sequence, store, observer, Beginning((), iter(())))
    assert observer.frames == list(range(1, FRAMES))
