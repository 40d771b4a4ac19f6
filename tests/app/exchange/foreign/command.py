"""Helpers that call the command `import` and read its output."""

from __future__ import annotations

from pathlib import Path

import pytest
from rodsight.cli.main import main
from rodsight.experiment.experiment import load_experiment, read_tracks
from rodsight.experiment.walls import read_walls
from rodsight.tracks import Tracks, WallTracks


def import_files(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """Import; return the output on one line."""
    with pytest.raises(SystemExit) as end:
        main(["import", *map(str, arguments)])
    printed = capsys.readouterr()
    assert not end.value.code, printed.err
    return " ".join(printed.out.split())


def refuse(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """Import invalid files; return the error line."""
    with pytest.raises(SystemExit) as end:
        main(["import", *map(str, arguments)])
    assert end.value.code == 2
    printed = capsys.readouterr().err
    assert printed.count("\n") == 1
    return printed


def tracks_in(folder: Path) -> Tracks:
    return read_tracks(load_experiment(folder))


def walls_in(folder: Path) -> WallTracks | None:
    experiment = load_experiment(folder)
    return read_walls(experiment, read_tracks(experiment).frame_count)
