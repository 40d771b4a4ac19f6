from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rodsight import pipeline
from rodsight.experiment.experiment import load_experiment
from rodsight.recording.curve_layers.residual_plot import DECADES, envelope
from rodsight.recording.curve_layers.starts import COLD_SWEEPS, StartGauge, Starts, contact_problem
from rodsight.recording.files.finished_run import write_recording
from rodsight.recording.look import entities
from rodsight.recording.look.canvas import Canvas
from rodsight.recording.look.force_style import ForceRange, ForceStyle
from rodsight.recording.look.scene import Scene
from rodsight.results.results import Results

from solver.nlgs.solve import NlgsSettings, solve
from tests.app.recording.fake_results import make_results
from tests.app.recording.rows import latest

ROUNDING = 1e-9  # relative: the same sums over the same numbers


@pytest.fixture(scope="module")
def solved(made_tracks: Path, tmp_path_factory: pytest.TempPathFactory) -> Results:
    experiment = load_experiment(made_tracks, ("solver.sweeps=200",))
    return pipeline.solve(pipeline.Run(experiment, tmp_path_factory.mktemp("solved")))


def scene_of(results: Results) -> Scene:
    canvas = Canvas.around(results.tracks, None)
    style = ForceStyle.on(canvas, ForceRange.of(results.frames))
    return Scene(
        results.name, results.tracks, results.walls, results.grains, results.friction, results.configuration, canvas,
        style,
    )  # fmt: skip


def test_the_problem_measured_is_the_one_that_the_chain_solved(solved: Results):
    gauge = StartGauge(scene_of(solved))
    for forces in solved.frames:
        motion, packing = gauge._motion(forces.frame), gauge._packing
        assert motion is not None
        assert packing is not None
        problem, rows = contact_problem(packing, motion, forces)
        reached = np.column_stack([forces.nlgs_fn, forces.nlgs_ft])[rows]
        found = solve(problem, NlgsSettings(0), guess=reached).natural_map
        assert found == pytest.approx(forces.natural_map, rel=ROUNDING)
        gauge.measure(forces)


def test_a_warm_start_is_far_ahead_of_a_cold_one_where_little_has_changed(solved: Results):
    gauge = StartGauge(scene_of(solved))
    starts = [gauge.measure(forces) for forces in solved.frames]
    assert np.isnan(starts[0].warm)  # nothing was there before
    assert np.isnan(starts[0].saved)
    for start in starts:
        assert np.all(np.diff(start.cold) < 0.0)
    carried = starts[2:]
    assert all(start.warm < 0.5 * start.cold[0] and start.saved > 0.5 for start in carried)  # events included
    assert np.median([start.warm / start.cold[0] for start in carried]) < 0.2


def test_the_sweeps_saved_lie_between_those_that_bracket_the_warm_start():
    cold = COLD_SWEEPS.astype(float) ** -1.0
    assert Starts(0.3, cold).saved == pytest.approx(1.0 / 0.3 - 1.0)
    assert Starts(2.0, cold).saved == 0.0
    assert np.isnan(Starts(1e-9, cold).saved)
    assert np.isnan(Starts(np.nan, cold).saved)


def test_the_recording_has_warm_cold_and_reached_of_every_frame(solved: Results, tmp_path: Path):
    path = write_recording(solved, tmp_path / "run.rrd").path
    gauge = StartGauge(scene_of(solved))
    for forces in solved.frames:
        starts = gauge.measure(forces)
        for entity, value in (
            (entities.COLD_RESIDUAL, starts.cold[0]), (entities.WARM_RESIDUAL, starts.warm),
            (entities.FINAL_NATURAL_MAP, forces.natural_map),
        ):  # fmt: skip
            shown = latest(path, entity, entities.FRAME, forces.frame)["Scalars:scalars"]
            assert shown == pytest.approx([np.log10(value)] if np.isfinite(value) else [])


def test_a_run_that_does_not_say_how_it_was_loaded_has_no_starts():
    results = make_results(2)
    frames = [replace(forces, kappa=float("nan")) for forces in results.frames]
    gauge = StartGauge(scene_of(results))
    assert np.isnan(gauge.measure(frames[0]).cold).all()


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
