"""Pairs that surely bear force, and the correction of tracks by the errors that they show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.inference.known_pairs import BEARS, correct_grain_errors, known_pairs
from rodsight.inference.snapshots import measure_sequence
from rodsight.solver.calibration.grain_errors import GrainErrors

from tests.app.inference.test_radii import lattice
from tests.app.recording.fake_results import make_results


def test_pairs_that_surely_bear_are_listed_with_frame_and_normal_force():
    frames = []
    for frame in make_results(3, 8, 7, sweeps=2).frames[1:]:
        number = np.arange(frame.contacts.count)
        bears = np.linspace(0.0, 1.0, len(number))
        frames.append(replace(frame, fn=np.where(number % 3 == 0, 0.0, 1.0 + number), bearing_probability=bears))
    rows, force = known_pairs([*frames, replace(frames[0], frame=7, bearing_probability=None)])
    known = [(each.bearing_probability > BEARS) & (each.fn > 0.0) for each in frames]
    assert 0 < sum(each.sum() for each in known) == rows.count
    assert rows.frame.tolist() == [1] * known[0].sum() + [2] * known[1].sum()
    np.testing.assert_array_equal(rows.i, np.concatenate([f.contacts.i[k] for f, k in zip(frames, known, strict=True)]))
    np.testing.assert_array_equal(rows.j, np.concatenate([f.contacts.j[k] for f, k in zip(frames, known, strict=True)]))
    np.testing.assert_array_equal(force, np.concatenate([f.fn[k] for f, k in zip(frames, known, strict=True)]))


def test_no_pair_is_known_without_frames():
    rows, force = known_pairs([])
    assert rows.count == len(force) == 0


def test_errors_are_added_to_the_tracks_and_rotate_with_the_rods():
    tracks, walls = lattice()
    quarter = 0.5 * np.pi * np.arange(tracks.frame_count)[:, None] * np.ones(tracks.grain_count)
    tracks = replace(tracks, rotation=quarter)
    n = tracks.grain_count
    offset, radius = np.tile([2e-5, 0.0], (n, 1)), np.linspace(-1e-5, 1e-5, n)
    found = GrainErrors(offset, radius, 0.0, np.zeros((1, 3 * n)))
    corrected = correct_grain_errors(tracks, measure_sequence(tracks, walls), found)
    assert corrected.radius - tracks.radius == pytest.approx(radius)
    for k, shift in enumerate(([2e-5, 0.0], [0.0, 2e-5], [-2e-5, 0.0], [0.0, -2e-5])):
        assert corrected.position[k] - tracks.position[k] == pytest.approx(np.tile(shift, (n, 1)), abs=1e-12)
