"""Recordings made once for many tests. In strict mode the SDK raises errors instead of warning."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rerun as rr
from rodsight.experiment.units import Scale
from rodsight.recording.files.finished_run import RecordingFile, RecordingOptions, write_recording
from rodsight.results.results import Results, TruthContacts
from rodsight.solver.kinematics.sequence_kinematics import measure_kinematics

from tests.app.recording.fake_photographs import PIXEL, SHAPE, photograph
from tests.app.recording.fake_results import make_results, make_truth, make_tuning, with_fringes

LOST = (20, 2)  # grain and the frame it is lost from


@pytest.fixture(autouse=True, scope="session")
def strict():
    rr.set_strict_mode(True)


@pytest.fixture(scope="session")
def results() -> Results:
    return make_results(frame_count=4, lost=LOST)


@pytest.fixture(scope="session")
def truth(results) -> TruthContacts:
    return make_truth(results, np.random.default_rng(3))


@pytest.fixture(scope="session")
def recording(results, truth, tmp_path_factory) -> RecordingFile:
    """A recording with every optional part."""
    path: Path = tmp_path_factory.mktemp("recording") / "run.rrd"
    scale = Scale(PIXEL, SHAPE[0])
    fraction = np.array([0.3, 0.2, 0.1, 0.1, 0.1, 0.2])
    force = np.random.default_rng(5).random((len(results.frames), results.walls.count, 2))
    tracks = results.tracks
    found = measure_kinematics(
        np.where(tracks.present[..., None], tracks.position, np.nan), tracks.rotation, tracks.radius, tracks.sigma
    )
    tuned = replace(
        results, radius_tuning=make_tuning(), read_kinematics=lambda: found, walls=replace(results.walls, force=force),
        frames=[replace(each, error_budget=fraction) for each in results.frames],
    )  # fmt: skip
    return write_recording(
        with_fringes(tuned),
        path,
        photograph=photograph,
        scale=scale,
        truth=truth,
        options=RecordingOptions(tolerance=1e-4),
    )
