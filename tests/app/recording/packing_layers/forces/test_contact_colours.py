from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.recording.files.finished_run import write_recording
from rodsight.recording.look import entities
from rodsight.recording.look.colours import OPEN, packed_one
from rodsight.recording.packing_layers.forces.contact_colours import COLOURINGS

from tests.app.recording.fake_results import make_results
from tests.app.recording.rows import latest


def coloured(tmp_path, frames) -> list[dict[str, list[int]]]:
    results = make_results(len(frames), sweeps=20)
    path = write_recording(replace(results, frames=frames), tmp_path / "run.rrd").path
    shown = [latest(path, entities.FORCES, entities.FRAME, frame) for frame in range(len(frames))]
    return [{name: each[f"by_{name}:colors"] for name in COLOURINGS} for each in shown]


def test_every_contact_has_a_colour_by_every_quantity_and_grey_if_unknown(tmp_path):
    frames = make_results(2, sweeps=20).frames
    slides = np.linspace(0.0, 1.0, frames[1].contacts.count)
    first, second = coloured(tmp_path, [frames[0], replace(frames[1], sliding_probability=slides)])
    grey = int(packed_one(OPEN))
    assert all(len(colours) == frames[0].contacts.count for colours in first.values())
    for unknown in (first["sliding"], first["bearing"], first["touching"], first["change"], second["bearing"]):
        assert set(unknown) == {grey}
    assert second["sliding"] == COLOURINGS["sliding"].colours(slides).tolist()
    assert second["sliding"][0] != second["sliding"][-1]


@pytest.mark.thorough
def test_the_change_is_that_of_each_contact_since_the_frame_before(tmp_path):
    frames = make_results(2, sweeps=20).frames
    same = replace(frames[0], frame=1)
    more = replace(same, fn=same.fn + np.where(np.arange(len(same.fn)) == 3, same.fn.mean(), 0.0))
    *_, unchanged = coloured(tmp_path, [frames[0], same])
    *_, changed = coloured(tmp_path, [frames[0], more])
    middle = int(COLOURINGS["change"].colours(np.array([0.5]))[0])
    assert set(unchanged["change"]) == {middle}
    differing = [row for row, colour in enumerate(changed["change"]) if colour != middle]
    assert differing == [3]


@pytest.mark.parametrize("name", COLOURINGS)
def test_a_colour_varies_along_its_ramp_and_is_clipped_at_its_ends(name):
    low, end, middle, high, beyond = COLOURINGS[name].colours(np.array([-1.0, 0.0, 0.5, 1.0, 7.0])).tolist()
    assert low == end
    assert high == beyond
    assert len({end, middle, high}) == 3
