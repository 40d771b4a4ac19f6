"""A small tracked experiment and its nominal run."""

from __future__ import annotations

from pathlib import Path

import pytest
from rodsight import pipeline
from rodsight.experiment.experiment import load_experiment
from rodsight.robustness.study import Nominal

FEW = ("solver.sweeps=50", 'recording.sweeps="none"')


@pytest.fixture(scope="session")
def nominal(made_tracks: Path, tmp_path_factory: pytest.TempPathFactory) -> Nominal:
    """The nominal run of 40 grains over 5 frames, with its truth."""
    folder = tmp_path_factory.mktemp("nominal")
    return pipeline.nominal_run(pipeline.Run(load_experiment(made_tracks, FEW), folder))[0]
