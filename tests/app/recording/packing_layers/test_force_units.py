"""Forces are printed in newtons where a load or the weight sets their scale, else in arbitrary units."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.recording.files.finished_run import write_recording
from rodsight.recording.look import entities

from tests.app.recording.fake_results import CONFIGURATION, make_results
from tests.app.recording.rows import rows

GRAVITY = f"{CONFIGURATION}gravity = [0.0, -9.81]\n"


@pytest.mark.parametrize(
    ("loaded", "configuration", "unit", "stated"),
    [
        (True, CONFIGURATION, "N", "(loaded: "),
        (False, GRAVITY, "N", "(none loaded: the weight sets the scale)"),
        (False, CONFIGURATION, "a.u.", "(none loaded: forces are known up to a factor)"),
    ],
)
def test_legends_captions_and_the_summary_have_the_unit(tmp_path, loaded, configuration, unit, stated):
    results = make_results(2, sweeps=2)
    walls = results.walls if loaded else replace(results.walls, pressure=np.full(results.walls.count, np.nan))
    results = replace(results, walls=walls, configuration=configuration)
    assert results.force_unit == unit
    path = write_recording(results, tmp_path / "run.rrd").path
    for entity in (entities.FORCE_LEGEND + entities.TICKS, entities.FILM_KEY + entities.TICKS):
        assert any(text.startswith("≥ ") and text.endswith(f" {unit}") for text in labels(path, entity)), entity
    assert f"mean f_n {results.statistics[1].mean_fn:.3g} {unit}" in text_of(path, entities.FRAME_CARD)
    summary = text_of(path, "/summary")
    assert stated in summary
    assert f" {unit} (half the mean)" in summary


def labels(path, entity) -> list[str]:
    return [text for row in rows(path, entity) for name in row if name.endswith(":labels") for text in row[name]]


def text_of(path, entity) -> str:
    return rows(path, entity)[-1]["TextDocument:text"][0]
