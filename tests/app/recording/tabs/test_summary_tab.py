"""The Summary tab lists the reasons that lower the trust."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.recording.files.finished_run import write_recording
from rodsight.recording.tabs.summary_tab import MAX_REASONS
from rodsight.solver.boundary.camera_distortion import CameraDistortion

from tests.app.recording.fake_results import make_results
from tests.app.recording.rows import rows


def summary_of(frames, path) -> str:
    """Return the text of the Summary tab of a recording of these frames."""
    results = make_results(len(frames), sweeps=2)
    write_recording(replace(results, frames=frames), path)
    return rows(path, "/summary")[-1]["TextDocument:text"][0]


def test_the_summary_lists_each_reason_once_with_its_least_trusted_frame_and_its_cure(tmp_path):
    reasons = [
        "smaller steps; use more photographs · noise of 12 µm: state the precision", "",
        "noise of 3.5 µm: state the precision · walls", "history: wait", "walls",
    ]  # fmt: skip
    frames = [
        replace(each, trust=trust, trust_penalties=reason)
        for each, trust, reason in zip(
            make_results(5, sweeps=2).frames, (0.7, 0.1, 0.4, float("nan"), 0.5), reasons, strict=True
        )
    ]
    text = summary_of(frames, tmp_path / "run.rrd")
    listed = text[text.index("Reasons that lower T") :].split("\n\n")[1]
    assert listed.splitlines() == [
        "- frame 2, T 0.40 and 1 more frame: noise of 3.5 µm: state the precision",
        "- frame 2, T 0.40 and 1 more frame: walls",
        "- frame 0, T 0.70: smaller steps; use more photographs",
    ]


@pytest.mark.thorough
def test_the_summary_lists_so_many_reasons_only(tmp_path):
    count = MAX_REASONS + 3
    frames = [
        replace(each, trust=0.05 + 0.05 * each.frame, trust_penalties="noise " + "x" * each.frame)
        for each in make_results(count, sweeps=2).frames
    ]
    text = summary_of(frames, tmp_path / "run.rrd")
    assert f"Reasons that lower T ({MAX_REASONS} of {count})" in text
    listed = [line for line in text.splitlines() if line.startswith("- frame ")]
    assert [line.split(",")[0] for line in listed] == [f"- frame {k}" for k in range(MAX_REASONS)]


def test_the_summary_shows_median_and_worst_frame_beside_their_names(tmp_path):
    frames = [
        replace(each, trust=trust, unbalance=residual)
        for each, trust, residual in zip(
            make_results(3, sweeps=2).frames, (0.9, 0.7, 0.8), (1e-5, 2e-5, 0.3), strict=True
        )
    ]
    text = summary_of(frames, tmp_path / "run.rrd")
    assert "| of the frames | median | worst |" in text
    assert "| trust T | 0.8 | 0.7 |" in text
    assert "| greatest force residual / mean f_n | 2e-05 | 0.3 |" in text


def test_a_summary_without_reasons_has_no_list(tmp_path):
    assert "Reasons that lower T" not in summary_of(make_results(2, sweeps=2).frames, tmp_path / "run.rrd")


@pytest.mark.thorough
def test_the_summary_states_the_camera_with_intervals_where_it_was_sought(tmp_path):
    results = make_results(2, sweeps=2)
    value, sd = np.zeros(10), np.full(10, 2e-4)
    value[0], value[2] = -1.5e-3, 2e-2
    lens = CameraDistortion(
        value, sd, 0.0, np.zeros(2), 0.1, 8e-5, 3e-5, True, 0.0, np.array([-2e-6]), 1e-5, np.array([5e-7]),
        np.array([8e-3]), np.ones(1),
    )  # fmt: skip
    write_recording(replace(results, lens=lens), tmp_path / "run.rrd")
    text = rows(tmp_path / "run.rrd", "/summary")[-1]["TextDocument:text"][0]
    assert "## Camera and radii" in text
    assert "a stretching (a = −0.15 ± 0.02 %), a lens (k1 = 2 ± 0.02 %) of half the width and scatter by 30 µm" in text
    assert "30 µm, 80 µm before" in text
    assert "radii 8 mm −2 ± 0.5 µm" in text
    write_recording(results, tmp_path / "plain.rrd")
    assert "Camera" not in rows(tmp_path / "plain.rrd", "/summary")[-1]["TextDocument:text"][0]
