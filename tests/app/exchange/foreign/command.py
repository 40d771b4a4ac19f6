"""The command import, called as a user does."""

from __future__ import annotations

from pathlib import Path

import pytest
from rodsight.cli.main import main
from rodsight.experiment.experiment import load_experiment, read_tracks
from rodsight.experiment.walls import read_walls
from rodsight.tracks import Tracks, WallTracks


def take_in(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """Import; gives what was printed, on one line."""
    with pytest.raises(SystemExit) as end:
        main(["import", *map(str, arguments)])
    said = capsys.readouterr()
    assert not end.value.code, said.err
    return " ".join(said.out.split())


def refuse(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """Import what is wrong; gives the one line of complaint."""
    with pytest.raises(SystemExit) as end:
        main(["import", *map(str, arguments)])
    assert end.value.code == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    return said


def tracks_in(folder: Path) -> Tracks:
    return read_tracks(load_experiment(folder))


def walls_in(folder: Path) -> WallTracks | None:
    experiment = load_experiment(folder)
    return read_walls(experiment, read_tracks(experiment).frame_count)
