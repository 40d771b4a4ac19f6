"""A running test is tracked and solved photograph by photograph."""

import shutil

import pytest
from rodsight.experiment.experiment import load_experiment
from rodsight.following.follow import follow
from rodsight.process.errors import InputError
from rodsight.results.checkpoint import Checkpoint
from rodsight.results.hdf5.store import load_tracks
from rodsight.run_folder import TRACKS, UNFINISHED, Run
from rodsight.solver.frame_forces import FrameForces


@pytest.fixture
def started(made_photographs, tmp_path):
    """The experiment with its first two photographs, and the folder of later ones."""
    folder = tmp_path / "test"
    shutil.copytree(made_photographs, folder)
    files = sorted((folder / "photos").iterdir())
    later = tmp_path / "to come"
    later.mkdir()
    for file in files[2:]:
        shutil.move(file, later)
    lines = (folder / "walls.csv").read_text().splitlines(keepends=True)
    (folder / "walls.csv").write_text("".join(line for line in lines if line.startswith(("frame", "0,"))))
    lines = (folder / "experiment.toml").read_text().splitlines(keepends=True)
    (folder / "experiment.toml").write_text("".join(line for line in lines if not line.startswith(("truth", "forces"))))
    return Run(load_experiment(folder), tmp_path / "run"), later


@pytest.mark.screen
def test_frames_are_solved_as_photographs_arrive(started):
    run, later = started
    messages, alarms = [], []

    def follow_on():
        alarm = lambda frame, text: alarms.append((frame, text))  # noqa: E731
        return [len(each.frames) for each in follow(run, (), idle=1.5, alarm=alarm, report=messages.append)]

    assert follow_on() == [2]
    assert solved(run) == [0, 1]
    for file in sorted(later.iterdir()):
        shutil.copy(file, run.experiment.folder / "photos")
    assert follow_on()[-1] == 4
    assert solved(run) == [0, 1, 2, 3]
    tracks, walls = load_tracks(run.file(TRACKS))
    assert tracks.present.all()
    assert walls is not None
    assert alarms == []


def solved(run):
    folder = run.folder / UNFINISHED / "solving"
    stored = Checkpoint(folder, (folder / "fingerprint").read_text())
    return [stored.load(k, FrameForces)[0].frame for k in range(stored.finished())]


def test_experiments_without_photographs_are_refused(tracked):
    run = Run(load_experiment(tracked), tracked / "run")
    with pytest.raises(InputError, match="photographs"):
        next(follow(run, (), idle=1.0, alarm=lambda frame, text: None, report=lambda text: None))
