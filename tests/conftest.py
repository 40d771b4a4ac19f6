"""Experiments that several tests share; made once."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from rodsight.synthetic.experiment import synthesize

from tests.shapes import check_shapes

check_shapes("solver")


@pytest.fixture(scope="session")
def made_tracks(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small tracked experiment with truth; not to be written to."""
    folder = tmp_path_factory.mktemp("synthetic") / "tracked"
    synthesize(folder, grains=40, frames=5, photographs=False, noise=1e-5, seed=1)
    return folder


@pytest.fixture
def tracked(made_tracks: Path, tmp_path: Path) -> Path:
    """A copy of the small tracked experiment, to be spoiled at will."""
    return Path(shutil.copytree(made_tracks, tmp_path / "tracked"))


@pytest.fixture(scope="session")
def made_photographs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small photographed experiment with truth; not to be written to."""
    folder = tmp_path_factory.mktemp("synthetic") / "photographed"
    synthesize(folder, grains=30, frames=4, seed=2)
    return folder
