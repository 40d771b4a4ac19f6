from __future__ import annotations

import numpy as np
from rodsight.recording.files.finished_run import write_recording
from rodsight.recording.files.share import share_recording
from rodsight.recording.look import entities
from rodsight.recording.look.force_style import ForceRange
from rodsight.recording.packing_layers.stack import LAYERS, STRONG, STRONG_SWEEPS, SWEEP_LAYERS, layer_frames

from tests.app.recording.fake_results import make_results
from tests.app.recording.rows import latest, rows

OUTLINE = 8  # lines around the walls, the last ones of a layer


def test_layers_are_few_and_span_the_run():
    assert layer_frames(3).tolist() == [0, 1, 2]
    chosen = layer_frames(200)
    assert len(chosen) == LAYERS
    assert (chosen[0], chosen[-1]) == (0, 199)
    assert np.ptp(np.diff(chosen)) <= 1


def test_a_layer_holds_the_strong_forces_of_its_frame_and_later_ones_lie_nearer(recording, results):
    strong = STRONG * ForceRange.of(results.frames).mean
    depths = []
    for frame in range(4):
        layer = rows(recording.path, f"{entities.STACK_LAYERS}/{frame}")[-1]
        lines = layer["LineStrips3D:strips"][:-OUTLINE]
        assert len(lines) == np.sum(results.frames[frame].fn > strong)
        assert layer["Points3D:labels"] == [f"frame {frame}"]
        depths.append({z for line in lines for _, _, z in line})
    assert all(len(each) == 1 for each in depths)
    assert [min(each) for each in depths] == sorted(min(each) for each in depths)
    here = latest(recording.path, entities.STACK_PLACE, entities.FRAME, 2)["LineStrips3D:strips"][0]
    assert {z for _, _, z in here} == depths[2]


def test_the_stack_of_sweeps_ends_with_the_reported_forces(recording, results):
    shown = latest(recording.path, entities.STACK_SWEEPS, entities.FRAME, 1)
    assert shown["Points3D:labels"][-1] == "reported"
    assert len(shown["Points3D:labels"]) == SWEEP_LAYERS
    depth = [z for _, _, z in shown["Points3D:positions"]]
    assert depth == sorted(depth)
    strong = STRONG_SWEEPS * ForceRange.of(results.frames).mean
    top = [line for line in shown["LineStrips3D:strips"] if line[0][2] == depth[-1]]
    assert len(top) == np.sum(results.frames[1].fn > strong) + OUTLINE


def test_a_shared_recording_has_the_layers_of_its_frames_alone(recording, tmp_path):
    path = share_recording(recording.path, tmp_path / "small.rrd", first=1, stop=3).path
    there = [frame for frame in range(4) if rows(path, f"{entities.STACK_LAYERS}/{frame}")]
    assert there == [1, 2]


def test_the_stacks_cost_little(tmp_path):
    results = make_results(6, 16, 14, sweeps=300)
    path = write_recording(results, tmp_path / "run.rrd").path
    stacked = sum(
        np.asarray(row[name]).nbytes
        for entity in (entities.STACK_SWEEPS, *(f"{entities.STACK_LAYERS}/{k}" for k in range(6)))
        for row in rows(path, entity)
        for name in ("LineStrips3D:radii", "LineStrips3D:colors")
        if name in row
    )
    drawn = sum(
        np.asarray(row["LineStrips2D:radii"]).nbytes
        for row in rows(path, entities.FORCES)
        if "LineStrips2D:radii" in row
    )
    assert stacked < 0.2 * drawn
