"""A running test is tracked and solved photograph by photograph."""

import shutil

import pytest
from rodsight.errors import InputError
from rodsight.experiment.experiment import load_experiment
from rodsight.following.follow import follow
from rodsight.results.checkpoint import Checkpoint
from rodsight.results.hdf5.store import load_tracks
from rodsight.run_folder import TRACKS, UNFINISHED, Run

from solver.sequence.frame_forces import FrameForces


@pytest.fixture
def begun(made_photographs, tmp_path):
    """The experiment with its first two photographs, and the files that are still to come."""
    folder = tmp_path / "test"
    shutil.copytree(made_photographs, folder)
    files = sorted((folder / "photos").iterdir())
    to_come = tmp_path / "to come"
    to_come.mkdir()
    for file in files[2:]:
        shutil.move(file, to_come)
    lines = (folder / "walls.csv").read_text().splitlines(keepends=True)
    (folder / "walls.csv").write_text("".join(line for line in lines if line.startswith(("frame", "0,"))))
    told = (folder / "experiment.toml").read_text().splitlines(keepends=True)
    (folder / "experiment.toml").write_text("".join(line for line in told if not line.startswith(("truth", "forces"))))
    return Run(load_experiment(folder), tmp_path / "run"), to_come


@pytest.mark.screen
def test_frames_are_solved_as_photographs_come(begun):
    run, to_come = begun
    said, alarms = [], []

    def say(text):
        said.append(text)

    follow(run, (), idle=1.5, alarm=lambda frame, text: alarms.append((frame, text)), say=say)
    assert solved(run) == [0, 1]
    for file in sorted(to_come.iterdir()):
        shutil.copy(file, run.experiment.folder / "photos")
    follow(run, (), idle=1.5, alarm=lambda frame, text: alarms.append((frame, text)), say=say)
    assert solved(run) == [0, 1, 2, 3]
    tracks, walls = load_tracks(run.file(TRACKS))
    assert tracks.present.all()
    assert walls is not None
    assert alarms == []


def solved(run):
    place = run.folder / UNFINISHED / "solving"
    kept = Checkpoint(place, (place / "fingerprint").read_text())
    return [kept.load(k, FrameForces)[0].frame for k in range(kept.finished())]


def test_what_cannot_be_followed_is_refused(tracked):
    run = Run(load_experiment(tracked), tracked / "run")
    with pytest.raises(InputError, match="photographs"):
        follow(run, (), idle=1.0, alarm=lambda frame, text: None, say=lambda text: None)
