"""A recording below the cell of a notebook."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import pytest
import rodsight
from rodsight.experiment.units import Scale
from rodsight.notebook import inline
from rodsight.recording.files.finished_run import RecordingOptions, write_recording

from tests.app.recording.fake_photographs import PIXEL, SHAPE, photograph
from tests.app.recording.fake_results import make_results


@pytest.fixture
def notebook(monkeypatch: pytest.MonkeyPatch) -> None:
    """Simulate a Jupyter kernel whose HTML object is its text."""
    shell = SimpleNamespace(kernel=object())
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    monkeypatch.setitem(sys.modules, "IPython.display", SimpleNamespace(HTML=str))


def test_only_a_kernel_is_a_notebook(notebook, monkeypatch):
    assert inline.in_notebook()
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: None))
    assert not inline.in_notebook()


def test_a_run_without_a_recording_is_refused():
    with pytest.raises(FileNotFoundError, match="no recording of this run"):
        rodsight.Run(make_results(2)).view()


@pytest.mark.slow
def test_all_parts_of_a_recording_are_in_the_cell_unless_it_is_too_large(notebook, tmp_path, monkeypatch):
    written = write_recording(
        make_results(frame_count=4), tmp_path / "recording.rrd", options=RecordingOptions(part_frames=3)
    )
    assert written.parts == 2
    shown = inline.show_recording(written.path)
    assert [f"recording-0-{k}&quot;" in shown for k in range(3)] == [True, True, False]
    monkeypatch.setattr(inline, "MAX_SIZE", written.size - 1)
    assert f"rodsight view {tmp_path}" in inline.show_recording(written.path)


@pytest.mark.slow  # the page of `share --html` draws the same recording in the lane of browsers
def test_the_recording_appears_in_a_frame_of_the_notebooks_page(notebook, page, tmp_path):
    results, scale = make_results(frame_count=4), Scale(PIXEL, SHAPE[0])
    path = write_recording(
        results, tmp_path / "run.rrd", photograph=photograph, scale=scale, options=RecordingOptions(part_frames=3)
    ).path
    shown = inline.show_recording(path)
    file = tmp_path / "notebook.html"
    shown = shown.replace("?? undefined", "?? &quot;webgl&quot;")  # the only renderer of a browser without a screen
    file.write_text(f"<!doctype html><title>notebook</title><body>{shown}</body>")
    page.goto(file.as_uri())
    frame = page.frame_locator("iframe")
    frame.locator("canvas").wait_for()
    inner = page.frames[1]
    inner.wait_for_function("window.rodsight !== undefined")
    assert inner.title() != "failed"
    assert frame.locator("#note").count() == 0
