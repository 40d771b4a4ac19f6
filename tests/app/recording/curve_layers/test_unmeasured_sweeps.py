from __future__ import annotations

from dataclasses import replace

import numpy as np
from rodsight.recording.files.finished_run import write_recording
from rodsight.recording.look import entities

from tests.app.recording.fake_results import make_results
from tests.app.recording.rows import rows

SWEEPS, SPACING = 50, 7


def test_unmeasured_sweeps_leave_no_gap_in_the_curves(tmp_path):
    results = make_results(1, sweeps=SWEEPS)
    sweep = np.arange(SWEEPS)
    known = (sweep % SPACING == 0) | (sweep == SWEEPS - 1)
    history = results.frames[0].history
    some = {
        name: np.where(known, getattr(history, name), np.nan) for name in ("force_change", "natural_map", "unbalance")
    }
    frame = replace(results.frames[0], history=replace(history, **some))
    path = write_recording(replace(results, frames=[frame]), tmp_path / "run.rrd").path
    for entity, name in (
        (entities.SWEEP_FORCE_CHANGE, "force_change"),
        (entities.SWEEP_NATURAL_MAP, "natural_map"),
        (entities.SWEEP_UNBALANCE, "unbalance"),
    ):
        found = [row for row in rows(path, entity) if "sweep" in row and "frame" not in row]
        assert [row["sweep"] for row in found] == sweep[known].tolist()
        values = np.array([row["Scalars:scalars"][0] for row in found])
        assert np.array_equal(values, np.log10(some[name][known]))
