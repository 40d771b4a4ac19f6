from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.drawing.accumulated_strain import AccumulatedStrain, accumulated_strains
from rodsight.recording.archive.share import share_recording
from rodsight.recording.files.finished_run import write_recording
from rodsight.recording.files.side_file import record_side_file
from rodsight.recording.look import entities

from tests.app.recording.fake_results import make_results
from tests.app.recording.rows import components, latest, rows

STEP = np.radians(0.25)  # of the synthetic shear


def test_on_time_and_on_strain_the_reported_field_of_every_photograph_is_shown(results, recording):
    for forces in results.frames:
        strain = round(1e6 * STEP * forces.frame)
        for timeline, at in ((entities.TIME, 30.0 * forces.frame), (entities.STRAIN, strain)):
            logged = [row for row in rows(recording.path, entities.FORCES) if _number(row[timeline]) <= at]
            newest = max(logged, key=lambda row: (_number(row[timeline]), row["rerun.controls.RowId"]))
            reported = latest(recording.path, entities.FORCES, entities.FRAME, forces.frame)
            assert newest["LineStrips2D:radii"] == reported["LineStrips2D:radii"]


def test_accumulated_strain_never_decreases_and_adds_the_greater_of_shear_and_compression():
    shear, squeeze = np.array([[0.0, 0.05], [0.05, 0.0]]), np.diag([0.0, -0.03])
    assert accumulated_strains([0.0 * shear, shear, 0.0 * shear]) == pytest.approx([0.0, 0.1, 0.2])
    assert accumulated_strains([0.0 * shear, squeeze]) == pytest.approx([0.0, 0.03])
    assert accumulated_strains([0.0 * shear, np.diag([-0.03, -0.03])]) == pytest.approx(
        [0.0, 0.03]
    )  # isotropic: no shear


def test_a_frame_of_unknown_strain_has_the_accumulated_strain_of_the_frame_before():
    accumulated = AccumulatedStrain()
    assert np.isnan(accumulated.add(None))
    shear = np.array([[0.0, 0.05], [0.05, 0.0]])
    strains = [shear, np.full((2, 2), np.nan), 2.0 * shear]
    assert [accumulated.add(strain) for strain in strains] == pytest.approx([0.0, 0.0, 0.1])


def test_results_of_earlier_versions_without_strain_have_no_strain_timeline(tmp_path):
    results = make_results(2, sweeps=20)
    old = replace(results, frames=[replace(forces, strain=None) for forces in results.frames])
    lines = components(write_recording(old, tmp_path / "run.rrd").path)[entities.FORCES][0]
    assert lines == {entities.FRAME, entities.SWEEP, entities.TIME}


@pytest.mark.thorough
def test_a_shared_file_and_a_side_file_keep_all_timelines(recording, results, tmp_path):
    whole = {entities.FRAME, entities.SWEEP, entities.TIME, entities.STRAIN}
    shared = components(share_recording(recording.path, tmp_path / "small.rrd", first=1, stop=3, scale=0.5).path)
    assert shared[entities.FORCES][0] == shared[entities.PHOTOGRAPH][0] == whole
    record_side_file(results, recording.path, tmp_path / "side.rrd", [1])
    assert components(tmp_path / "side.rrd")[entities.FORCES][0] == whole


def _number(value) -> float:
    return value.total_seconds() if hasattr(value, "total_seconds") else float(value)
