"""The small photographed experiment, tracked once in every way that several tests use."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.app.experiment.tables import edit
from tests.app.tracking.photographed import Tracked, keep_first_walls, read_walls, track_all


@pytest.fixture
def photographed(made_photographs: Path, tmp_path: Path) -> Path:
    """A copy of the small photographed experiment that a test may change."""
    return Path(shutil.copytree(made_photographs, tmp_path / "photographed"))


@pytest.fixture(scope="session")
def plain(made_photographs: Path, tmp_path_factory: pytest.TempPathFactory) -> Tracked:
    """The experiment with all walls in its table, tracked with a report."""
    experiment = Path(shutil.copytree(made_photographs, tmp_path_factory.mktemp("plain") / "photographed"))
    return track_all(experiment, read_walls(experiment), "--report")


@pytest.fixture(scope="session")
def followed(made_photographs: Path, tmp_path_factory: pytest.TempPathFactory) -> Tracked:
    """The experiment with the walls of the first photograph only; the others are tracked."""
    experiment = Path(shutil.copytree(made_photographs, tmp_path_factory.mktemp("followed") / "photographed"))
    return track_all(experiment, keep_first_walls(experiment))


@pytest.fixture(scope="session")
def partly_given(made_photographs: Path, tmp_path_factory: pytest.TempPathFactory) -> Tracked:
    """The experiment with the walls of the first photograph and the top one in frame 2; the others are tracked."""
    experiment = Path(shutil.copytree(made_photographs, tmp_path_factory.mktemp("partly_given") / "photographed"))
    file = experiment / "walls.csv"
    given_line = next(line for line in file.read_text().splitlines() if line.startswith("2,top"))
    true = keep_first_walls(experiment)
    file.write_text(file.read_text() + given_line + "\n")
    edit(experiment / "experiment.toml", '[walls]\nfile = "walls.csv"', '[walls]\nfile = "walls.csv"\ntrack = true')
    return track_all(experiment, true)
