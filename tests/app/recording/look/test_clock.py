from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.recording.files.finished_run import write_recording
from rodsight.recording.files.share import share_recording
from rodsight.recording.files.side_file import record_side_file
from rodsight.recording.look import entities
from rodsight.recording.look.clock import StrainWay, strain_ways

from tests.app.recording.fake_results import make_results
from tests.app.recording.rows import components, latest, rows

STEP = np.radians(0.25)  # of the invented shear


def test_on_time_and_on_strain_the_reported_field_of_every_photograph_is_shown(results, recording):
    for forces in results.frames:
        way = round(1e6 * STEP * forces.frame)
        for timeline, at in ((entities.TIME, 30.0 * forces.frame), (entities.STRAIN, way)):
            logged = [row for row in rows(recording.path, entities.FORCES) if _number(row[timeline]) <= at]
            newest = max(logged, key=lambda row: (_number(row[timeline]), row["rerun.controls.RowId"]))
            reported = latest(recording.path, entities.FORCES, entities.FRAME, forces.frame)
            assert newest["LineStrips2D:radii"] == reported["LineStrips2D:radii"]


def test_the_way_of_a_strain_never_turns_back_and_takes_the_greater_of_shear_and_compression():
    shear, squeeze = np.array([[0.0, 0.05], [0.05, 0.0]]), np.diag([0.0, -0.03])
    assert strain_ways([0.0 * shear, shear, 0.0 * shear]) == pytest.approx([0.0, 0.1, 0.2])
    assert strain_ways([0.0 * shear, squeeze]) == pytest.approx([0.0, 0.03])
    assert strain_ways([0.0 * shear, np.diag([-0.03, -0.03])]) == pytest.approx([0.0, 0.03])  # isotropic: no shear


def test_a_frame_whose_strain_is_not_known_stays_where_the_frame_before_was():
    way = StrainWay()
    assert np.isnan(way.go(None))
    shear = np.array([[0.0, 0.05], [0.05, 0.0]])
    assert [way.go(shear), way.go(np.full((2, 2), np.nan)), way.go(2.0 * shear)] == pytest.approx([0.0, 0.0, 0.1])


def test_results_of_earlier_versions_without_strain_have_no_such_timeline(tmp_path):
    results = make_results(2, sweeps=20)
    old = replace(results, frames=[replace(forces, strain=None) for forces in results.frames])
    lines = components(write_recording(old, tmp_path / "run.rrd").path)[entities.FORCES][0]
    assert lines == {entities.FRAME, entities.SWEEP, entities.TIME}


def test_a_shared_and_a_side_file_keep_all_timelines(recording, results, tmp_path):
    whole = {entities.FRAME, entities.SWEEP, entities.TIME, entities.STRAIN}
    shared = components(share_recording(recording.path, tmp_path / "small.rrd", first=1, stop=3, scale=0.5).path)
    assert shared[entities.FORCES][0] == shared[entities.PHOTOGRAPH][0] == whole
    record_side_file(results, recording.path, tmp_path / "side.rrd", [1])
    assert components(tmp_path / "side.rrd")[entities.FORCES][0] == whole


def _number(value) -> float:
    return value.total_seconds() if hasattr(value, "total_seconds") else float(value)
