"""The values that a click on a contact shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from rodsight.recording.files.finished_run import write_recording
from rodsight.recording.look import entities

from tests.app.recording.fake_results import FRICTION, make_results
from tests.app.recording.rows import latest

FLOAT32 = 1e-6  # relative


def mobilisation_of(results, path) -> np.ndarray:
    """Return the recorded mobilisation of the contacts of frame 0, NaN where absent."""
    write_recording(results, path)
    return np.array(latest(path, entities.FORCES, entities.FRAME, 0)["mobilisation"], np.float64)


def test_a_fully_sliding_wall_contact_has_mobilisation_1(tmp_path):
    results = make_results(1, sweeps=2)
    frame = results.frames[0]
    friction = np.where(frame.contacts.with_wall, 0.4 * FRICTION, FRICTION)
    ft = friction * frame.fn * np.where(frame.contacts.with_wall, -1.0, 0.5)
    sliding = replace(results, frames=[replace(frame, ft=ft, friction=friction)])
    found, bearing = mobilisation_of(sliding, tmp_path / "run.rrd"), frame.fn > 0.0
    expected = np.where(frame.contacts.with_wall, 1.0, 0.5)
    assert (bearing & frame.contacts.with_wall).any()
    assert np.allclose(found[bearing], expected[bearing], rtol=FLOAT32)
    assert np.isnan(found[~bearing]).all()


def test_the_coefficient_between_grains_is_used_if_the_file_has_none_per_contact(tmp_path):
    results = make_results(1, sweeps=2)
    frame = results.frames[0]
    bearing = frame.fn > 0.0
    found = mobilisation_of(results, tmp_path / "run.rrd")
    assert frame.friction is None
    assert np.allclose(found[bearing], np.abs(frame.ft[bearing]) / (FRICTION * frame.fn[bearing]), rtol=FLOAT32)
