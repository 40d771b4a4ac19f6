"""The dim edges of forces: as wide as a force larger by two standard deviations, only of coloured lines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.recording.files.finished_run import write_recording
from rodsight.recording.look import entities

from tests.app.recording.fake_results import make_results
from tests.app.recording.rows import latest


def test_an_edge_is_as_wide_as_a_force_larger_by_two_standard_deviations(tmp_path):
    results = make_results(1, sweeps=20)
    frame = results.frames[0]
    strong = int(np.argsort(frame.fn)[len(frame.fn) // 2])
    weak = int(np.argmin(np.where(frame.fn > 0.0, frame.fn, np.inf)))
    sd = np.zeros_like(frame.fn)
    sd[[strong, weak]] = frame.fn[strong]
    path = write_recording(replace(results, frames=[replace(frame, fn_sd=sd)]), tmp_path / "run.rrd").path
    edges = latest(path, entities.FORCE_UNCERTAINTY, entities.FRAME, 0)
    lines = latest(path, entities.FORCES, entities.FRAME, 0)
    assert frame.fn[weak] < 0.5 * frame.fn[frame.fn > 0.0].mean() < frame.fn[strong]
    assert len(edges["LineStrips2D:radii"]) == 1  # a grey line has none, nor a force without uncertainty
    assert edges["LineStrips2D:strips"][0] == lines["LineStrips2D:strips"][strong]
    shown = np.argsort(np.abs(frame.fn - 3.0 * frame.fn[strong]))[0]
    assert frame.fn[shown] == pytest.approx(3.0 * frame.fn[strong], rel=0.2)
    assert edges["LineStrips2D:radii"][0] == pytest.approx(lines["LineStrips2D:radii"][shown], rel=0.25)
    colour, dim = lines["LineStrips2D:colors"][strong], edges["LineStrips2D:colors"][0]
    assert all((dim >> shift) & 0xFF < (colour >> shift) & 0xFF for shift in (24, 16, 8) if (colour >> shift) & 0xFF)


def test_sweeps_have_no_edges(tmp_path):
    results = make_results(2, sweeps=20)
    frames = [replace(each, fn_sd=np.full_like(each.fn, each.fn.mean())) for each in results.frames]
    path = write_recording(replace(results, frames=frames), tmp_path / "run.rrd").path
    first = latest(path, entities.FORCE_UNCERTAINTY, entities.SWEEP, 3)
    assert not first.get("LineStrips2D:radii")
    assert latest(path, entities.FORCE_UNCERTAINTY, entities.FRAME, 1)["LineStrips2D:radii"]
