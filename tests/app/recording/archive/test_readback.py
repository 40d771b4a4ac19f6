from __future__ import annotations

import numpy as np
import pytest
from rodsight.recording.archive.readback import read_forces


def test_forces_read_back_equal_the_recorded_forces_bit_for_bit(recording, results):
    found = read_forces(recording.path)
    assert list(found) == [forces.frame for forces in results.frames]
    n = results.grains.count
    for forces in results.frames:
        back = found[forces.frame]
        assert np.array_equal(back.fn, forces.fn)
        assert np.array_equal(back.ft, forces.ft)
        assert np.array_equal(back.i, forces.contacts.i)
        assert np.array_equal(back.j, forces.contacts.j)
        assert np.array_equal(back.grain_a, results.tracks.id[forces.contacts.i])
        names = [results.walls.name[j - n] if j >= n else str(results.tracks.id[j]) for j in forces.contacts.j]
        assert list(back.body_b) == names


def test_the_truth_is_read_back_in_the_order_of_its_contacts(recording, truth):
    found = read_forces(recording.path, truth=True)
    for frame, back in found.items():
        rows = truth.frame == frame
        assert np.array_equal(back.fn, truth.fn[rows])
        assert np.array_equal(back.i, truth.i[rows])
        assert np.array_equal(back.j, truth.j[rows])


def test_a_missing_recording_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"nowhere\.rrd"):
        read_forces(tmp_path / "nowhere.rrd")
