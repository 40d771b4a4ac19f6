"""A run's results, made once for the tests of all formats."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rodsight import pipeline
from rodsight.experiment.experiment import load_experiment
from rodsight.results.results import Results
from rodsight.tracks import TrackStatus


@pytest.fixture(scope="session")
def results(made_tracks: Path, tmp_path_factory: pytest.TempPathFactory) -> Results:
    """Forty grains in five frames, roughly solved."""
    experiment = load_experiment(made_tracks, ("solver.sweeps=20",))
    return pipeline.solve(pipeline.Run(experiment, tmp_path_factory.mktemp("results")))


@pytest.fixture
def with_a_loss(results: Results) -> Results:
    """The same, but grain 3 has no pose in frames 2 and 3."""
    tracks = results.tracks
    position, rotation, status = tracks.position.copy(), tracks.rotation.copy(), tracks.status.copy()
    position[2:4, 3], rotation[2:4, 3], status[2:4, 3] = np.nan, np.nan, TrackStatus.LOST
    return replace(results, tracks=replace(tracks, position=position, rotation=rotation, status=status))
