"""Tracking after a correction: frames before it are kept, and all others are bit-identical to a new run."""

from __future__ import annotations

from pathlib import Path

import pytest
from rodsight.tracking import follow
from rodsight.tracks import TrackStatus

from tests.app.experiment.tables import edit
from tests.app.tracking.photographed import keep_first_walls, track

pytestmark = pytest.mark.thorough

HEADER = "frame,id,x,y,theta\n"


@pytest.fixture
def tracked_frames(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the stages and frames that are tracked during the test."""
    seen: list[str] = []
    grains, bars = follow._follow, follow.WallTracker.follow
    walls = iter(range(1, 1000))

    def follow_grains(tracker, photographs, image, poses, given):
        seen.append(f"grains {len(poses)}")
        return grains(tracker, photographs, image, poses, given)

    def follow_bars(tracker, image, poses):
        seen.append(f"walls {next(walls)}")
        return bars(tracker, image, poses)

    monkeypatch.setattr(follow, "_follow", follow_grains)
    monkeypatch.setattr(follow.WallTracker, "follow", follow_bars)
    return seen


def pop_all(seen: list[str]) -> list[str]:
    now = list(seen)
    seen.clear()
    return now


@pytest.mark.slow
def test_only_frames_from_the_changed_correction_on_are_tracked_again(
    photographed: Path, tmp_path: Path, tracked_frames: list[str]
) -> None:
    keep_first_walls(photographed)
    out, table = tmp_path / "out", photographed / "corrections.csv"
    track(photographed, out)
    assert pop_all(tracked_frames) == ["walls 1", "walls 2", "walls 3", "grains 1", "grains 2", "grains 3"]
    edit(photographed / "experiment.toml", "interval =", 'corrections = "corrections.csv"\ninterval =')
    for lines, expected in (
        ("2,4,lost,,\n", ["grains 2", "grains 3"]),
        ("3,7,lost,,\n2,4,lost,,\n", ["grains 3"]),  # one more; the order of the lines is irrelevant
        ("3,8,lost,,\n2,4,lost,,\n", ["grains 3"]),  # of another rod
        ("3,7,lost,,\n", ["grains 2", "grains 3"]),  # one removed
    ):
        table.write_text(HEADER + lines)
        again, _ = track(photographed, out)
        assert pop_all(tracked_frames) == expected
        assert not (out / ".unfinished").exists()
    assert again.status[2, 4] == TrackStatus.OK
    assert again.status[3, 7] == TrackStatus.LOST
    fresh, _ = track(photographed, tmp_path / "fresh")
    for name in ("position", "rotation", "sigma", "zncc", "status", "reference_frame"):
        assert getattr(again, name).tobytes() == getattr(fresh, name).tobytes()


@pytest.mark.slow
def test_other_photographs_are_tracked_from_the_first_on(
    photographed: Path, tmp_path: Path, tracked_frames: list[str]
) -> None:
    track(photographed, tmp_path / "out")
    tracked_frames.clear()
    last = sorted((photographed / "photos").iterdir())[-1]
    last.write_bytes(sorted((photographed / "photos").iterdir())[-2].read_bytes())
    track(photographed, tmp_path / "out")
    assert pop_all(tracked_frames) == ["grains 1", "grains 2", "grains 3"]
