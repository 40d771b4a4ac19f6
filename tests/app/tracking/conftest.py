"""The small photographed experiment, tracked once in every way that several tests look at."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.app.experiment.tables import edit
from tests.app.tracking.photographed import Tracked, cut_walls, read_walls, track_all


@pytest.fixture
def photographed(made_photographs: Path, tmp_path: Path) -> Path:
    """A copy of the small photographed experiment, to be spoiled at will."""
    return Path(shutil.copytree(made_photographs, tmp_path / "photographed"))


@pytest.fixture(scope="session")
def plain(made_photographs: Path, tmp_path_factory: pytest.TempPathFactory) -> Tracked:
    """As it is, with all walls in its table; with a report."""
    experiment = Path(shutil.copytree(made_photographs, tmp_path_factory.mktemp("plain") / "photographed"))
    return track_all(experiment, read_walls(experiment), "--report")


@pytest.fixture(scope="session")
def followed(made_photographs: Path, tmp_path_factory: pytest.TempPathFactory) -> Tracked:
    """With the walls of the first photograph alone; the others are followed."""
    experiment = Path(shutil.copytree(made_photographs, tmp_path_factory.mktemp("followed") / "photographed"))
    return track_all(experiment, cut_walls(experiment))


@pytest.fixture(scope="session")
def partly_told(made_photographs: Path, tmp_path_factory: pytest.TempPathFactory) -> Tracked:
    """With the walls of the first photograph, and the top one in frame 2; the others are followed."""
    experiment = Path(shutil.copytree(made_photographs, tmp_path_factory.mktemp("told") / "photographed"))
    file = experiment / "walls.csv"
    told = next(line for line in file.read_text().splitlines() if line.startswith("2,top"))
    true = cut_walls(experiment)
    file.write_text(file.read_text() + told + "\n")
    edit(experiment / "experiment.toml", '[walls]\nfile = "walls.csv"', '[walls]\nfile = "walls.csv"\ntrack = true')
    return track_all(experiment, true)
