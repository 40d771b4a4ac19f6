"""Frames of a stored run are read on access, unchanged, in the memory of a few frames."""

from __future__ import annotations

import gc
import pickle
import shutil
import tracemalloc
import weakref
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from rodsight.results.hdf5.lazy_sequences import CachedSequence
from rodsight.results.hdf5.reader import CACHED_FRAMES, StoredFrames
from rodsight.results.hdf5.store import Provenance, load_results, save_results

from tests.app.results.differences import differences
from tests.app.results.full_results import make_full_results

ORIGIN = Provenance("print", "experiment.toml", (0, None), {})
FRAMES = 40


def longer(whole):
    """Return the same frames repeated."""
    found = {each.name: getattr(whole, each.name) for each in fields(whole)}
    over = {name: value for name, value in found.items() if isinstance(value, np.ndarray) and len(value) == 3}
    return replace(whole, **{name: value[np.arange(FRAMES) % 3] for name, value in over.items() if name != "name"})


@pytest.fixture(scope="module")
def full():
    few = make_full_results()
    frames = [replace(few.frames[k % 3], frame=k) for k in range(FRAMES)]
    tracks = replace(longer(replace(few.tracks, failed_reason=None)), time=np.arange(FRAMES, dtype=float))
    walls = longer(few.walls)
    statistics = [few.statistics[k % 3] for k in range(FRAMES)]
    return replace(
        few,
        frames=frames,
        statistics=statistics,
        tracks=tracks,
        walls=walls,
        boundary=None,
        radius_tuning=None,
        read_kinematics=lambda: None,
        friction_check=None,
        calibration=None,
        fringes=None,
    )


@pytest.fixture(scope="module")
def saved(full, tmp_path_factory):
    file = tmp_path_factory.mktemp("saved") / "results.h5"
    save_results(file, full, ORIGIN)
    return file


@pytest.fixture
def stored(saved, tmp_path):
    """A copy that a test may replace."""
    return Path(shutil.copy(saved, tmp_path))


def test_every_frame_reads_back_unchanged(stored, full):
    found = load_results(stored)
    assert isinstance(found.frames, StoredFrames)
    assert (
        differences(replace(full, tracks=found.tracks, walls=found.walls), replace(found, frames=list(found.frames)))
        == []
    )
    assert [each.frame for each in found.frames[-3:]] == [FRAMES - 3, FRAMES - 2, FRAMES - 1]
    with pytest.raises(IndexError):
        found.frames[FRAMES]


@pytest.mark.thorough
def test_columns_of_one_value_are_read_as_one_value(full, tmp_path):
    shape, file = full.tracks.rotation.shape, tmp_path / "given.h5"
    sigma = np.full(shape, 1e-5)
    given = replace(full.tracks, sigma=sigma, zncc=np.full(shape, np.nan))
    save_results(file, replace(full, tracks=given), ORIGIN)
    found = load_results(file).tracks
    for name in ("sigma", "zncc"):
        assert getattr(found, name).strides == (0, 0), name
        np.testing.assert_array_equal(getattr(found, name), getattr(given, name))
    sigma[-1, -1] = 2e-5
    save_results(file, replace(full, tracks=given), ORIGIN)
    np.testing.assert_array_equal(load_results(file).tracks.sigma, sigma)


@pytest.mark.thorough
def test_reading_frames_takes_the_memory_of_a_few(stored):
    found = load_results(stored)

    def peak(work) -> int:
        work()  # modules and caches that are loaded once
        gc.collect()
        tracemalloc.start()
        try:
            work()
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    one_by_one = peak(lambda: [frame.contacts.count for frame in found.frames])
    all_at_once = peak(lambda: list(load_results(stored).frames))
    assert one_by_one < 0.5 * all_at_once


def test_only_the_most_recent_frames_are_kept(stored):
    found = load_results(stored).frames
    items = [weakref.ref(found[k].contacts.i) for k in range(FRAMES)]
    gc.collect()
    assert [k for k, item in enumerate(items) if item() is not None] == list(range(FRAMES - CACHED_FRAMES, FRAMES))


@pytest.mark.thorough
def test_a_file_that_is_replaced_meanwhile_is_read_as_it_was_opened(stored, full):
    found = load_results(stored)
    save_results(stored, replace(full, frames=[replace(each, fn=2.0 * each.fn) for each in full.frames]), ORIGIN)
    assert np.array_equal(found.frames[7].fn, full.frames[7].fn)


@pytest.mark.thorough
def test_frames_can_be_pickled(stored, full):
    found = pickle.loads(pickle.dumps(load_results(stored)))
    assert np.array_equal(found.frames[5].fn, full.frames[5].fn)


def test_frames_are_freed_with_their_last_use_and_not_at_a_later_collection(stored):
    found = load_results(stored).frames
    cached = CachedSequence(FRAMES, found.__getitem__, lambda _: 1, FRAMES)
    items = [weakref.ref(found[3].contacts.i), weakref.ref(cached[7].contacts.i)]
    assert all(item() is not None for item in items)
    gc.disable()
    try:
        del found, cached
        assert [item() for item in items] == [None, None]
    finally:
        gc.enable()


@pytest.mark.thorough
def test_kinematics_of_a_frame_are_read_alone_and_are_those_of_all_frames(full, tmp_path, monkeypatch):
    few = make_full_results()
    save_results(tmp_path / "results.h5", few, ORIGIN)
    found, whole = load_results(tmp_path / "results.h5"), few.kinematics
    read = []
    original = type(found.read_kinematics._stored).part_of
    monkeypatch.setattr(
        type(found.read_kinematics._stored), "part_of",
        lambda self, entry, rows: read.append((entry.path, rows)) or original(self, entry, rows),
    )  # fmt: skip
    for k in range(len(few.frames)):
        one, same = found.kinematics_of(slice(k, k + 1)), few.kinematics_of(slice(k, k + 1))
        for each in fields(whole):
            np.testing.assert_array_equal(getattr(one, each.name), getattr(same, each.name), each.name)
        np.testing.assert_array_equal(one.shear_strain[0], whole.shear_strain[k])
        np.testing.assert_array_equal(one.window_rms, whole.window_rms)
    one_by_one = [slice(k, k + 1) for k in range(len(few.frames))]
    assert [rows for path, rows in read if path == "kinematics/fluctuation"] == one_by_one
