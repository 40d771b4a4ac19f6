"""Tracking once more after a correction: frames before it stay, all others are as if nothing had been there."""

from __future__ import annotations

from pathlib import Path

import pytest
from rodsight.tracking import follow
from rodsight.tracks import TrackStatus

from tests.app.experiment.tables import edit
from tests.app.tracking.photographed import cut_walls, track

HEADER = "frame,id,x,y,theta\n"


@pytest.fixture
def followed_anew(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What is followed in which photograph while the test goes on."""
    seen: list[str] = []
    grains, bars = follow._follow, follow._follow_bars

    def follow_grains(tracker, photographs, image, poses, told, execution):
        seen.append(f"grains {len(poses)}")
        return grains(tracker, photographs, image, poses, told, execution)

    def follow_bars(tracker, image, poses, execution):
        seen.append(f"walls {len(poses)}")
        return bars(tracker, image, poses, execution)

    monkeypatch.setattr(follow, "_follow", follow_grains)
    monkeypatch.setattr(follow, "_follow_bars", follow_bars)
    return seen


def taken(seen: list[str]) -> list[str]:
    now = list(seen)
    seen.clear()
    return now


def test_only_what_follows_from_a_correction_is_tracked_again(
    photographed: Path, tmp_path: Path, followed_anew: list[str]
) -> None:
    cut_walls(photographed)
    out, table = tmp_path / "out", photographed / "corrections.csv"
    track(photographed, out)
    assert taken(followed_anew) == ["walls 1", "walls 2", "walls 3", "grains 1", "grains 2", "grains 3"]
    edit(photographed / "experiment.toml", "interval =", 'corrections = "corrections.csv"\ninterval =')
    for lines, expected in (
        ("2,4,lost,,\n", ["grains 2", "grains 3"]),
        ("3,7,lost,,\n2,4,lost,,\n", ["grains 3"]),  # one more; the order of the lines says nothing
        ("3,8,lost,,\n2,4,lost,,\n", ["grains 3"]),  # of another rod
        ("3,7,lost,,\n", ["grains 2", "grains 3"]),  # one taken back
    ):
        table.write_text(HEADER + lines)
        again, _ = track(photographed, out)
        assert taken(followed_anew) == expected
        assert not (out / ".unfinished").exists()
    assert again.status[2, 4] == TrackStatus.OK
    assert again.status[3, 7] == TrackStatus.LOST
    fresh, _ = track(photographed, tmp_path / "fresh")
    for name in ("position", "rotation", "sigma", "zncc", "status", "reference_frame"):
        assert getattr(again, name).tobytes() == getattr(fresh, name).tobytes()


def test_other_photographs_are_tracked_from_the_first_on(
    photographed: Path, tmp_path: Path, followed_anew: list[str]
) -> None:
    track(photographed, tmp_path / "out")
    followed_anew.clear()
    last = sorted((photographed / "photos").iterdir())[-1]
    last.write_bytes(sorted((photographed / "photos").iterdir())[-2].read_bytes())
    track(photographed, tmp_path / "out")
    assert taken(followed_anew) == ["grains 1", "grains 2", "grains 3"]
