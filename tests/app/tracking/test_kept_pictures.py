"""Photographs are kept as recordings show them, and no recording decodes them once more."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from rodsight import pipeline
from rodsight.experiment.experiment import load_experiment
from rodsight.experiment.shown import LARGEST, ShownPhotograph, ShownPhotographs, show
from rodsight.results.checkpoint import Checkpoint
from rodsight.tracking.kept_pictures import KeepingPictures, KeptPictures

FRAMES = 3
SEEN = [np.random.default_rng(k).integers(0, 255, (40, 30)).astype(np.float32) for k in range(FRAMES)]


def is_same(one: ShownPhotograph, other: ShownPhotograph) -> bool:
    return np.array_equal(one.jpeg, other.jpeg) and (one.shape, one.shrink) == (other.shape, other.shrink)


def test_what_is_read_is_kept_as_it_is_shown(tmp_path):
    pictures = Checkpoint(tmp_path / "pictures", "")
    reading = KeepingPictures(SEEN, pictures)
    assert reading[1] is SEEN[1]
    assert [pictures.has(k) for k in range(FRAMES)] == [False, True, False]
    kept = pictures.find(1, ShownPhotograph)
    assert kept is not None
    assert is_same(kept, show(SEEN[1]))


def test_what_was_kept_is_not_read_again_and_the_rest_is(tmp_path):
    pictures = Checkpoint(tmp_path / "pictures", "")
    for k in (0, 2):
        KeepingPictures(SEEN, pictures)[k]
    pictures.save(0, show(SEEN[2]))  # a mark that nobody overwrites it
    asked: list[int] = []

    class Asked:
        def __getitem__(self, frame: int) -> np.ndarray:
            asked.append(frame)
            return SEEN[frame]

    KeepingPictures(Asked(), pictures)[0]
    asked.clear()
    shown = KeptPictures(Asked(), 0, pictures)
    assert is_same(shown[0], show(SEEN[2]))
    assert is_same(KeptPictures(Asked(), 2, pictures)[0], show(SEEN[2]))
    assert asked == []
    assert is_same(shown[1], show(SEEN[1]))
    assert asked == [1]


def test_what_was_kept_of_something_else_or_is_damaged_is_read_again(tmp_path):
    KeepingPictures(SEEN, Checkpoint(tmp_path / "pictures", "former"))[0]
    assert Checkpoint(tmp_path / "pictures", "now", looks_on=True).find(0, ShownPhotograph) is None
    kept = Checkpoint(tmp_path / "pictures", "former", looks_on=True)
    (file,) = (tmp_path / "pictures").glob("*.piece")
    file.write_bytes(file.read_bytes()[:-1])
    assert is_same(KeptPictures(SEEN, 0, kept)[0], show(SEEN[0]))


def test_levels_are_rounded_and_kept_to_the_scale():
    shown = show(np.array([[0.4, 0.6, 254.6, 300.0]] * 16, np.float32).repeat(16, axis=1))
    levels = np.asarray(cv2.imdecode(shown.jpeg, cv2.IMREAD_GRAYSCALE))[8, 8::16]
    assert np.abs(levels.astype(int) - [0, 1, 255, 255]).max() <= 2  # of JPEG


def test_large_photographs_are_shown_at_half_size():
    side = 2 * round(LARGEST**0.5 / 2) + 3
    shown = ShownPhotographs([np.zeros((side, side), np.float32)], 0)[0]
    assert (shown.shape, shown.shrink) == ((side, side), 2)
    assert np.asarray(cv2.imdecode(shown.jpeg, cv2.IMREAD_GRAYSCALE)).shape == (side // 2, side // 2)


@pytest.fixture
def run(photographed: Path, tmp_path: Path) -> pipeline.Run:
    chosen = ("solver.estimator=nlgs", "solver.sweeps=20", "recording.sweeps=none")
    return pipeline.Run(load_experiment(photographed, chosen), tmp_path / "run")


def test_a_recording_shows_photographs_that_only_tracking_read(run, monkeypatch):
    results = pipeline.solve(run)
    aside = run.folder / ".tracked" / "pictures"
    assert len(list(aside.glob("*.piece"))) == len(results.frames)
    monkeypatch.setattr("rodsight.experiment.shown.show", pytest.fail)  # of one that is read anew
    pipeline.record(run, results, None)
    assert not aside.exists()
    monkeypatch.undo()
    with_kept = run.file("recording.rrd").read_bytes()
    pipeline.record(run, results, None)
    anew = run.file("recording.rrd").read_bytes()
    assert len(anew) == pytest.approx(len(with_kept), rel=0.01)  # a photograph is a twentieth
