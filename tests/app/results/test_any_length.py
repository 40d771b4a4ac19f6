"""A run of any length is written and read in the memory of a few frames, and disk errors are reported."""

from __future__ import annotations

import errno
import gc
import io
import os
import tracemalloc
from dataclasses import replace

import h5py
import numpy as np
import pytest
from rodsight.results.checkpoint import Checkpoint, flatten
from rodsight.results.hdf5 import writer
from rodsight.results.hdf5.file_creation import create_file
from rodsight.results.hdf5.lazy_sequences import CachedSequence, LazySequence
from rodsight.results.hdf5.store import Provenance, load_results, save_results
from rodsight.results.summary import summarize
from rodsight.solver.frame_forces import FrameForces
from rodsight.solver.statistics.frame_statistics import FrameStatistics

from tests.app.results.differences import differences
from tests.app.results.full_results import make_full_results

ORIGIN = Provenance("print", "experiment.toml", (0, None), {})


@pytest.mark.thorough
def test_frames_of_a_checkpoint_are_stored_as_those_in_memory(tmp_path):
    full = make_full_results()
    checkpoint = Checkpoint(tmp_path / "solving", "fingerprint")
    for k, (forces, statistics) in enumerate(zip(full.frames, full.statistics, strict=True)):
        checkpoint.save(k, forces, statistics)
    frames, statistics = checkpoint.lazy_sequences(len(full.frames), FrameForces, FrameStatistics)
    save_results(tmp_path / "results.h5", replace(full, frames=frames, statistics=statistics), ORIGIN)
    assert differences(full, load_results(tmp_path / "results.h5")) == []


def peak_of(work) -> int:
    """Return the peak memory of a function [bytes] beyond its result, with frequent garbage collection."""
    usual = gc.get_threshold()
    gc.collect()
    gc.set_threshold(50)
    tracemalloc.start()
    try:
        made = work()
        now, most = tracemalloc.get_traced_memory()
        del made
        return most - now
    finally:
        tracemalloc.stop()
        gc.set_threshold(*usual)


@pytest.mark.slow
def test_memory_is_independent_of_the_number_of_frames(tmp_path, monkeypatch):
    monkeypatch.setattr(writer, "BLOCK", 1 << 11)  # otherwise blocks fill after hundreds of frames
    monkeypatch.setattr(writer, "TEXTS", 8)
    few = make_full_results()

    def of(count: int):
        def frame(k: int) -> FrameForces:
            forces = few.frames[k % 3]
            fn = np.random.default_rng(k).random(forces.history.fn.shape).astype(np.float32)
            return replace(forces, frame=k, history=replace(forces.history, fn=fn))

        plain = {
            "boundary": None,
            "calibration": None,
            "fringes": None,
            "friction_check": None,
            "radius_tuning": None,
            "read_kinematics": lambda: None,
        }
        tracks = few.tracks.frames(0, 3)
        over = np.arange(count) % 3
        tracks = replace(
            tracks, failed_reason=None, time=np.arange(count, dtype=float),
            **{name: getattr(tracks, name)[over] for name in ("position", "rotation", "sigma", "zncc", "status")},
            second_zncc=None, reference_frame=None, fringes=None, given_id=None,
        )  # fmt: skip
        unknown = dict.fromkeys(("force", "sigma", "end_kind", "load", "cell"))
        walls = replace(few.walls, endpoints=few.walls.endpoints[over], **unknown)
        return replace(
            few, tracks=tracks, walls=walls, frames=LazySequence(count, frame),
            statistics=LazySequence(count, lambda k: few.statistics[k % 3]), **plain,
        )  # fmt: skip

    def save_and_summarize(count: int) -> object:
        save_results(tmp_path / "results.h5", of(count), ORIGIN)
        return summarize(load_results(tmp_path / "results.h5"), None, {})  # a row for every frame

    save_and_summarize(3)  # caches that are filled once
    some, many = peak_of(lambda: save_and_summarize(30)), peak_of(lambda: save_and_summarize(60))
    frames = sum(array.nbytes for each in few.frames for _, array in flatten(each)) / len(few.frames) * 30
    assert many - some < 0.5 * frames, (some, many, frames)  # cached frames would need all of it


@pytest.mark.parametrize("size", [0, 300, 5000, 100_000])
def test_a_disk_error_is_raised_with_the_name_of_the_file(tmp_path, monkeypatch, size):
    file = tmp_path / "store.h5"
    written, real = [0], io.FileIO.write

    class Full:
        def __init__(self, target):
            self._target = target

        def __getattr__(self, name):
            return getattr(self._target, name)

        def __enter__(self):
            return self

        def __exit__(self, *_):
            self._target.close()

        def write(self, content):
            written[0] += len(content)
            if written[0] > size:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            return real(self._target, content)

    opened = type(file).open
    monkeypatch.setattr(type(file), "open", lambda self, *given, **named: Full(opened(self, *given, **named)))
    with pytest.raises(OSError, match="No space left") as raised, create_file(file) as store:
        fill(store)
    assert raised.value.filename == str(file)


def fill(store: h5py.File) -> None:
    for k in range(30):
        values = np.random.default_rng(k).random(2000)
        store.create_dataset(f"group/{k}", data=values, chunks=(500,), compression="gzip")


def test_a_cached_sequence_keeps_the_most_recent_items_within_its_capacity():
    made: list[int] = []

    def make(k: int) -> int:
        made.append(k)
        return k

    some = CachedSequence(5, make, lambda _: 10, 25)
    assert [some[k] for k in (0, 1, 0, 1, 2, 1, 0)] == [0, 1, 0, 1, 2, 1, 0]
    assert made == [0, 1, 2, 0]
    some.extend_to(7)
    assert some[-1] == 6
    with pytest.raises(IndexError):
        some[7]


@pytest.mark.thorough
def test_an_open_file_holds_one_block_of_a_dataset_at_most(tmp_path):
    save_results(tmp_path / "results.h5", make_full_results(), ORIGIN)
    results = load_results(tmp_path / "results.h5")
    for sequence, blocks in ((results.frames, 1), (results.statistics, 0)):
        stored = sequence._make.args[0]
        _, slots, values, _ = stored._store.id.get_access_plist().get_cache()
        assert values == blocks * writer.BLOCK
        assert slots * 8 < 256  # [bytes]: HDF5 2 makes 64 kB of places for every dataset by default
