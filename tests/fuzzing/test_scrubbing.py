"""A recording of 10 000 photographs opens and shows any of them."""

from __future__ import annotations

import time
from functools import cache

import pytest
from rodsight.experiment.units import Scale
from rodsight.recording.files.finished_run import write_recording
from rodsight.recording.look import entities
from rodsight.recording.viewing.headless import HeadlessViewer, vulkan_drivers

from tests.app.recording.fake_photographs import PIXEL, SHAPE, photograph
from tests.app.recording.fake_results import make_results

from .long_runs import resident
from .table import note

PHOTOGRAPHS = 10_000
SHOWN = (0, 50, 4_999, 9_998)  # some of the first part, of the middle, of the last one
MAX_SECONDS = 20.0  # [s] for a picture


@pytest.mark.slow
@pytest.mark.skipif(not vulkan_drivers(), reason="no Vulkan driver")
def test_ten_thousand_photographs_open_and_any_is_shown(tmp_path):
    results = make_results(PHOTOGRAPHS, 5, 4, sweeps=6)
    cached = cache(photograph)
    began = time.perf_counter()
    file = write_recording(
        results,
        tmp_path / "recording.rrd",
        photograph=lambda k: cached(k % 50),
        scale=Scale(PIXEL, SHAPE[0]),
    )
    wrote = time.perf_counter() - began
    began = time.perf_counter()
    with HeadlessViewer(file.path, width=800, height=600) as viewer:
        opened = time.perf_counter() - began
        assert viewer.timeline(entities.FRAME) == (0, PHOTOGRAPHS - 1)
        pictures, seconds = [], []
        for frame in SHOWN:
            began = time.perf_counter()
            viewer.set_time(entities.FRAME, frame)
            pictures.append(viewer.picture())
            seconds.append(time.perf_counter() - began)
        assert viewer._process is not None
        memory = resident(viewer._process.pid)
    late = [each for each in seconds if each > MAX_SECONDS]
    note(
        "scrubbed", tried=PHOTOGRAPHS, wrong=len(late), files=file.parts, MB=round(1e-6 * file.size),
        written=f"in {wrote:.0f} s", opened=f"in {opened:.0f} s",
        sought=f"in {min(seconds):.1f} to {max(seconds):.1f} s",
        viewer=f"{1e-6 * memory:.0f} MB",
    )  # fmt: skip
    assert file.parts > 1
    assert not late
    assert len(set(pictures)) == len(SHOWN)
