"""The Summary tab lists the reasons that lower the trust."""

from __future__ import annotations

from dataclasses import replace

from rodsight.recording.files.finished_run import write_recording
from rodsight.recording.tabs.summary_tab import MAX_REASONS

from tests.app.recording.fake_results import make_results
from tests.app.recording.rows import rows


def summary_of(frames, path) -> str:
    """Return the text of the Summary tab of a recording of these frames."""
    results = make_results(len(frames), sweeps=2)
    write_recording(replace(results, frames=frames), path)
    return rows(path, "/summary")[-1]["TextDocument:text"][0]


def test_the_summary_lists_the_reasons_that_lower_the_trust_and_their_cures(tmp_path):
    frames = make_results(4, sweeps=2).frames
    cures = ["smaller steps | use more photographs", "", "noise: state the precision", "history: wait"]
    frames = [
        replace(each, trust=trust, trust_penalties=cure)
        for each, trust, cure in zip(frames, (0.7, 0.1, 0.4, float("nan")), cures, strict=True)
    ]
    text = summary_of(frames, tmp_path / "run.rrd")
    listed = [line for line in text.splitlines() if line.startswith("- frame ")]
    assert listed == [
        "- frame 2, T 0.40: noise: state the precision",
        "- frame 0, T 0.70: smaller steps / use more photographs",
    ]
    assert "Reasons that lower T" in text


def test_the_summary_lists_the_reasons_of_the_least_trusted_frames_only(tmp_path):
    count = MAX_REASONS + 3
    frames = [
        replace(each, trust=0.1 + 0.1 * each.frame, trust_penalties="noise")
        for each in make_results(count, sweeps=2).frames
    ]
    listed = [line for line in summary_of(frames, tmp_path / "run.rrd").splitlines() if line.startswith("- frame ")]
    assert [line.split(",")[0] for line in listed] == [f"- frame {k}" for k in range(MAX_REASONS)]


def test_a_summary_without_reasons_has_no_list(tmp_path):
    assert "Reasons that lower T" not in summary_of(make_results(2, sweeps=2).frames, tmp_path / "run.rrd")
