"""Frames of an unfinished run are restored bit for bit, those of an earlier version with defaults."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.process.errors import RunError
from rodsight.results.checkpoint import Checkpoint, flatten
from rodsight.results.packed_arrays import pack, unpack
from rodsight.solver.frame_forces import FrameForces, FrameStatus
from rodsight.solver.statistics.frame_statistics import FrameStatistics

from tests.app.results.full_results import make_full_results


def same(one: object, other: object) -> bool:
    a, b = dict(flatten(one)), dict(flatten(other))
    return a.keys() == b.keys() and all(
        a[name].dtype == b[name].dtype and a[name].tobytes() == b[name].tobytes() for name in a
    )


def test_a_finished_frame_is_restored_bit_for_bit(tmp_path):
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


def test_another_fingerprint_finds_no_frames(tmp_path):
    Checkpoint(tmp_path / "solving", "one").save(0, make_full_results().frames[0])
    assert Checkpoint(tmp_path / "solving", "one").finished() == 1
    assert Checkpoint(tmp_path / "solving", "other").finished() == 0
    assert [each.name for each in (tmp_path / "solving").iterdir()] == ["fingerprint"]  # it takes no room
    assert (tmp_path / "solving" / "fingerprint").read_text() == "other"


def test_fields_missing_in_an_earlier_version_have_their_defaults(tmp_path, monkeypatch):
    checkpoint = Checkpoint(tmp_path / "solving", "fingerprint")
    frame = make_full_results().frames[0]
    kept = {name: values for name, values in flatten(frame) if name not in ("hidden_fraction", "member_force")}
    monkeypatch.setattr("rodsight.results.checkpoint.flatten", lambda value: list(kept.items()))
    checkpoint.save(0, frame)
    frame = checkpoint.load(0, FrameForces)[0]
    assert (frame.hidden_fraction, frame.member_force) == (0.0, None)


@pytest.mark.parametrize("at", [3, 40, -5])
def test_a_damaged_frame_and_later_ones_are_computed_again_with_a_note(tmp_path, at):
    notes: list[str] = []
    checkpoint = Checkpoint(tmp_path / "solving", "fingerprint", notes)
    for k in range(3):
        checkpoint.save(k, make_full_results().frames[k])
    file = tmp_path / "solving" / "000001.piece"
    content = bytearray(file.read_bytes())
    content[at] ^= 1
    file.write_bytes(content)
    assert checkpoint.finished() == 1
    assert notes == ["Frame 1 of the unfinished solving is damaged: it is computed again."]
    with pytest.raises(RunError, match=r"000001\.piece: was damaged"):
        checkpoint.load(1, FrameForces)


def test_a_frame_of_another_run_or_number_is_ignored(tmp_path):
    one, other = Checkpoint(tmp_path / "one", "a"), Checkpoint(tmp_path / "other", "b")
    for checkpoint in (one, other):
        for k in range(2):
            checkpoint.save(k, make_full_results().frames[k])
    (tmp_path / "other" / "000000.piece").replace(tmp_path / "one" / "000001.piece")
    assert one.finished() == 1
    (tmp_path / "one" / "000001.piece").write_bytes((tmp_path / "one" / "000000.piece").read_bytes())
    assert one.finished() == 1


@pytest.mark.parametrize(
    "array",
    [
        np.array(True),
        np.float64(2.5),
        np.zeros((3, 0)),
        np.arange(6.0).reshape(2, 3).T,
        np.arange(8)[::2],
        np.array(["wall", "é"]),
    ],
)
def test_an_array_is_restored_with_type_and_order(array):
    array = np.asarray(array)
    found = unpack(b"".join(pack({"before": np.ones(3, bool), "it": array})))
    assert list(found) == ["before", "it"]
    assert (found["it"].dtype, found["it"].shape) == (array.dtype, array.shape)
    by_column = array.flags.f_contiguous and not array.flags.c_contiguous
    assert found["it"].flags.c_contiguous is not by_column  # sums round as before
    assert found["it"].tobytes() == array.tobytes()
    assert found["it"].flags.writeable


def test_objects_are_refused():
    with pytest.raises(ValueError, match="names is an array of objects"):
        pack({"names": np.array([{}])})


def test_arrays_whose_names_begin_otherwise_are_not_unpacked():
    many = np.arange(5000.0)  # so many that the pieces are not copies
    content = b"".join(pack({"0.one": many, "1.two": np.ones(3), "2.three": -many}))
    found = unpack(content, ("0.", "2."))
    assert list(found) == ["0.one", "2.three"]
    assert (found["2.three"] == -many).all()
