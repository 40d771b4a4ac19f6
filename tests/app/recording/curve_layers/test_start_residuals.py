from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rodsight import pipeline
from rodsight.experiment.experiment import load_experiment
from rodsight.recording.curve_layers.residual_plot import DECADES, envelope
from rodsight.recording.files.finished_run import write_recording
from rodsight.recording.look import entities
from rodsight.results.results import Results

from tests.app.recording.fake_results import make_results
from tests.app.recording.rows import latest

ROUNDING = 1e-9  # relative: the same sums over the same numbers


@pytest.fixture(scope="module")
def solved(made_tracks: Path, tmp_path_factory: pytest.TempPathFactory) -> Results:
    experiment = load_experiment(made_tracks, ("solver.sweeps=200",))
    return pipeline.solve(pipeline.Run(experiment, tmp_path_factory.mktemp("solved")))


@pytest.mark.thorough
def test_the_recording_has_warm_cold_and_final_residuals_of_every_frame(solved: Results, tmp_path: Path):
    path = write_recording(solved, tmp_path / "run.rrd").path
    for forces in solved.frames:
        assert forces.cold_residual is not None
        for entity, value in (
            (entities.COLD_RESIDUAL, forces.cold_residual[0]), (entities.WARM_RESIDUAL, forces.warm_residual),
            (entities.FINAL_NATURAL_MAP, forces.natural_map),
        ):  # fmt: skip
            shown = latest(path, entity, entities.FRAME, forces.frame)["Scalars:scalars"]
            assert shown == pytest.approx([np.log10(value)] if np.isfinite(value) else [])


def test_quantities_missing_in_files_of_earlier_versions_are_left_out_of_the_recording(tmp_path: Path):
    results = make_results(2)
    unknown = {"similarity", "new_contact_count", "lost_contact_count", "warm_residual", "sweeps_saved"}
    less = dict.fromkeys(unknown, float("nan")) | {"cold_residual": None, "grain_unbalance": None}
    path = write_recording(
        replace(results, frames=[replace(each, **less) for each in results.frames]), tmp_path / "o.rrd"
    ).path
    for entity in (
        entities.SIMILARITY, entities.NEW_CONTACT_COUNT, entities.LOST_CONTACT_COUNT, entities.WARM_RESIDUAL,
        entities.COLD_RESIDUAL, entities.SAVED_SWEEPS,
    ):  # fmt: skip
        assert latest(path, entity, entities.FRAME, 1)["Scalars:scalars"] == []
    assert set(latest(path, entities.GRAINS, entities.FRAME, 1)["unbalance"]) == {None}


def test_a_thinned_residual_keeps_its_peaks():
    residual = 1.0 / np.arange(1.0, 5001.0)
    residual[3000] = 7.0
    sweep, kept = envelope(residual)
    assert kept.max() == 7.0
    assert sweep[np.argmax(kept)] == 3001.0
    assert len(sweep) < 300
    assert np.all(np.diff(sweep) > 0.0)


def test_residuals_are_drawn_on_logarithmic_axes_and_marked_at_the_sweep(recording, results):
    strips = latest(recording.path, entities.RESIDUAL_CURVES, entities.FRAME, 1)["LineStrips2D:strips"]
    history = results.frames[1].history
    heights = [380.0 * (DECADES[1] - np.log10(value)) / (DECADES[1] - DECADES[0]) for value in history.natural_map]
    assert strips[0][0] == pytest.approx([0.0, heights[0]], rel=1e-5, abs=1e-3)  # float32
    assert strips[0][-1][1] == pytest.approx(heights[-1], rel=1e-5)
    first = history.count + 1
    marks = latest(recording.path, entities.RESIDUAL_MARKS, entities.SWEEP, first + 5)["Points2D:positions"]
    assert marks[0][1] == pytest.approx(heights[5], rel=1e-5)
    end = latest(recording.path, entities.RESIDUAL_MARKS, entities.FRAME, 1)["Points2D:positions"]
    assert end[0][1] == pytest.approx(heights[-1], rel=1e-5)
