"""The gaps in the lines of uncertain forces: their missing fraction is σ(f_n) / f_n."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.drawing.uncertainty import SURE, WIDEST, line_gaps, relative_uncertainty
from rodsight.recording.files.finished_run import write_recording
from rodsight.recording.look import entities
from rodsight.recording.packing_layers.forces.force_uncertainty import MARGIN, gap_strokes

from tests.app.recording.fake_results import make_results
from tests.app.recording.rows import latest

ROUNDING = 1e-9


def test_the_missing_fraction_of_a_line_is_the_relative_standard_deviation():
    lines = np.array([[[0.0, 0.0], [3.0, 4.0]]] * 5)
    relative = np.array([0.0, SURE, 0.5, 3.0, np.nan])
    gaps = line_gaps(lines, relative, 1.0)
    missing = np.bincount(gaps.row, gaps.length, minlength=5) / 5.0
    assert missing == pytest.approx([0.0, SURE, 0.5, WIDEST, WIDEST], abs=ROUNDING)  # unknown: as if most uncertain
    assert np.bincount(gaps.row, minlength=5)[0] == 0
    along = (gaps.middle @ [0.6, 0.8])[gaps.row == 2]
    half = 0.5 * gaps.length[gaps.row == 2]
    assert (along - half).min() > 0.0
    assert (along + half).max() < 5.0
    assert np.all(np.diff(along) > 2.0 * half[0])  # gaps do not overlap


def test_no_force_and_no_deviation_are_unknown():
    assert np.isnan(relative_uncertainty(np.array([0.0, 1.0]), np.array([1.0, np.nan]))).all()


@pytest.mark.parametrize("radius", [0.1, 2.0])
def test_a_stroke_covers_its_gap_and_the_line(radius):
    gaps = line_gaps(np.array([[[0.0, 0.0], [2.0, 0.0]]]), np.array([0.5]), 1.0)
    strokes, radii = gap_strokes(gaps, np.full(len(gaps.row), radius), 1.0)
    reach = np.abs(strokes - gaps.middle[:, None]).max(axis=1) + radii[:, None]  # along and across, with round ends
    assert reach[:, 0] == pytest.approx(0.5 * gaps.length, rel=0.02)
    assert reach[:, 1] == pytest.approx(np.full(len(radii), MARGIN * radius), rel=0.02)


def test_uncertain_forces_have_gaps_and_sure_ones_have_none(tmp_path):
    results = make_results(1, sweeps=20)
    frame = results.frames[0]
    strong = int(np.argmax(frame.fn))
    sd = np.zeros_like(frame.fn)
    sd[strong] = 0.5 * frame.fn[strong]
    path = write_recording(replace(results, frames=[replace(frame, fn_sd=sd)]), tmp_path / "run.rrd").path
    gaps = latest(path, entities.FORCE_UNCERTAINTY, entities.FRAME, 0)
    assert set(np.round(gaps["fn"], 3)) == {round(float(np.float32(frame.fn[strong])), 3)}
    assert len(gaps["LineStrips2D:strips"]) >= 2
    line = np.array(latest(path, entities.FORCES, entities.FRAME, 0)["LineStrips2D:strips"][strong])
    middle = np.array(gaps["LineStrips2D:strips"]).mean(axis=1)
    low, high = line.min(axis=0), line.max(axis=0)
    assert np.all((middle > low - 1.0) & (middle < high + 1.0))


def test_sweeps_have_no_gaps(tmp_path):
    results = make_results(2, sweeps=20)
    frames = [replace(each, fn_sd=np.full_like(each.fn, each.fn.mean())) for each in results.frames]
    path = write_recording(replace(results, frames=frames), tmp_path / "run.rrd").path
    first = latest(path, entities.FORCE_UNCERTAINTY, entities.SWEEP, 3)
    assert not first.get("LineStrips2D:radii")
    assert latest(path, entities.FORCE_UNCERTAINTY, entities.FRAME, 1)["LineStrips2D:radii"]
