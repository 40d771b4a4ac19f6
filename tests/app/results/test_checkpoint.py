"""Frames of an unfinished run come back bit for bit, those of an earlier version with defaults for what they lack."""

from __future__ import annotations

import numpy as np
from rodsight.results.checkpoint import Checkpoint, flatten

from solver.sequence.frame_forces import FrameForces, FrameStatus
from solver.statistics.frame_statistics import FrameStatistics
from tests.app.results.full_results import make_full_results


def same(one: object, other: object) -> bool:
    a, b = dict(flatten(one)), dict(flatten(other))
    return a.keys() == b.keys() and all(
        a[name].dtype == b[name].dtype and a[name].tobytes() == b[name].tobytes() for name in a
    )


def test_a_finished_frame_comes_back_bit_for_bit(tmp_path):
    results = make_full_results()
    checkpoint = Checkpoint(tmp_path / "solving", "fingerprint")
    for k, (frame, statistics) in enumerate(zip(results.frames, results.statistics, strict=True)):
        checkpoint.save(k, frame, statistics)
    assert checkpoint.finished() == 3
    for k in range(3):
        frame, statistics = checkpoint.load(k, FrameForces, FrameStatistics)
        assert same(frame, results.frames[k])
        assert same(statistics, results.statistics[k])
        assert isinstance(frame.status, FrameStatus)
        assert type(frame.sweeps) is int


def test_another_fingerprint_finds_nothing(tmp_path):
    Checkpoint(tmp_path / "solving", "one").save(0, make_full_results().frames[0])
    assert Checkpoint(tmp_path / "solving", "one").finished() == 1
    assert Checkpoint(tmp_path / "solving", "other").finished() == 0


def test_what_an_earlier_version_did_not_keep_has_its_default(tmp_path):
    checkpoint = Checkpoint(tmp_path / "solving", "fingerprint")
    checkpoint.save(0, make_full_results().frames[0])
    file = next((tmp_path / "solving").glob("*.npz"))
    with np.load(file) as arrays:
        kept = {name: values for name, values in arrays.items() if name not in ("0.hidden_share", "0.member_force")}
    np.savez(file, **kept)
    frame = checkpoint.load(0, FrameForces)[0]
    assert (frame.hidden_share, frame.member_force) == (0.0, None)
