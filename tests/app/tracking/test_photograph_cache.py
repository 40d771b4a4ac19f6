"""Tracking stores copies of photographs for recordings, which then need not read them again."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from rodsight import pipeline
from rodsight.experiment.experiment import load_experiment
from rodsight.experiment.jpeg_photographs import LARGEST, JpegPhotograph, JpegPhotographs, encode_jpeg
from rodsight.process.frame_range import FrameRange
from rodsight.results.checkpoint import Checkpoint
from rodsight.tracking.photograph_cache import CachedPhotographs, CachingPhotographs

FRAMES = 3
PHOTOGRAPHS = [np.random.default_rng(k).integers(0, 255, (40, 30)).astype(np.float32) for k in range(FRAMES)]


def is_same(one: JpegPhotograph, other: JpegPhotograph) -> bool:
    return np.array_equal(one.jpeg, other.jpeg) and (one.shape, one.shrink) == (other.shape, other.shrink)


def test_a_copy_is_stored_when_a_photograph_is_read(tmp_path):
    pictures = Checkpoint(tmp_path / "pictures", "")
    reading = CachingPhotographs(PHOTOGRAPHS, pictures)
    assert reading[1] is PHOTOGRAPHS[1]
    assert [pictures.has(k) for k in range(FRAMES)] == [False, True, False]
    stored = pictures.find(1, JpegPhotograph)
    assert stored is not None
    assert is_same(stored, encode_jpeg(PHOTOGRAPHS[1]))


def test_only_photographs_without_a_copy_are_read_again(tmp_path):
    pictures = Checkpoint(tmp_path / "pictures", "")
    for k in (0, 2):
        CachingPhotographs(PHOTOGRAPHS, pictures)[k]
    pictures.save(0, encode_jpeg(PHOTOGRAPHS[2]))  # another photograph's copy, to notice an overwrite
    reads: list[int] = []

    class RecordingReader:
        def __getitem__(self, frame: int) -> np.ndarray:
            reads.append(frame)
            return PHOTOGRAPHS[frame]

    CachingPhotographs(RecordingReader(), pictures)[0]
    reads.clear()
    shown = CachedPhotographs(RecordingReader(), FrameRange(), pictures)
    assert is_same(shown[0], encode_jpeg(PHOTOGRAPHS[2]))
    assert is_same(CachedPhotographs(RecordingReader(), FrameRange(2), pictures)[0], encode_jpeg(PHOTOGRAPHS[2]))
    assert reads == []
    assert is_same(shown[1], encode_jpeg(PHOTOGRAPHS[1]))
    assert reads == [1]


def test_outdated_and_damaged_copies_are_read_again(tmp_path):
    CachingPhotographs(PHOTOGRAPHS, Checkpoint(tmp_path / "pictures", "former"))[0]
    assert Checkpoint(tmp_path / "pictures", "now", read_only=True).find(0, JpegPhotograph) is None
    stored = Checkpoint(tmp_path / "pictures", "former", read_only=True)
    (file,) = (tmp_path / "pictures").glob("*.piece")
    file.write_bytes(file.read_bytes()[:-1])
    assert is_same(CachedPhotographs(PHOTOGRAPHS, FrameRange(), stored)[0], encode_jpeg(PHOTOGRAPHS[0]))


def test_levels_are_rounded_and_clipped_to_the_scale():
    shown = encode_jpeg(np.array([[0.4, 0.6, 254.6, 300.0]] * 16, np.float32).repeat(16, axis=1))
    levels = np.asarray(cv2.imdecode(shown.jpeg, cv2.IMREAD_GRAYSCALE))[8, 8::16]
    assert np.abs(levels.astype(int) - [0, 1, 255, 255]).max() <= 2  # of JPEG


def test_large_photographs_are_shown_at_half_size():
    side = 2 * round(LARGEST**0.5 / 2) + 3
    shown = JpegPhotographs([np.zeros((side, side), np.float32)], FrameRange())[0]
    assert (shown.shape, shown.shrink) == ((side, side), 2)
    assert np.asarray(cv2.imdecode(shown.jpeg, cv2.IMREAD_GRAYSCALE)).shape == (side // 2, side // 2)


@pytest.fixture
def run(photographed: Path, tmp_path: Path) -> pipeline.Run:
    chosen = ("solver.estimator=nlgs", "solver.sweeps=20", "recording.sweeps=none")
    return pipeline.Run(load_experiment(photographed, chosen), tmp_path / "run")


@pytest.mark.slow
def test_a_recording_uses_the_copies_that_tracking_stored(run, monkeypatch):
    results = pipeline.solve(run)
    cache = run.folder / ".tracked" / "pictures"
    assert len(list(cache.glob("*.piece"))) == len(results.frames)
    monkeypatch.setattr("rodsight.experiment.jpeg_photographs.encode_jpeg", pytest.fail)  # of one that is read anew
    pipeline.record(run, results, None)
    assert not cache.exists()
    monkeypatch.undo()
    with_copies = run.file("recording.rrd").read_bytes()
    pipeline.record(run, results, None)
    read_again = run.file("recording.rrd").read_bytes()
    assert len(read_again) == pytest.approx(len(with_copies), rel=0.01)  # a photograph is a twentieth
