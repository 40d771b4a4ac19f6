"""Of a large packing the strongest contacts are drawn, and all of it counts."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.recording.files.finished_run import write_recording
from rodsight.recording.look import detail, entities
from rodsight.results.checkpoint import flatten
from rodsight.results.schema import entries

from tests.app.recording.fake_results import make_results
from tests.app.recording.rows import latest

DRAWN = 7


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr(detail, "MOST_CONTACTS", DRAWN)
    monkeypatch.setattr(detail, "MOST_OUTLINED", 3)


def test_a_packing_of_usual_size_is_drawn_whole(results):
    assert detail.drawn_contacts(results.frames[0]) is results.frames[0]
    assert detail.describe_detail(results.grains.count, results.frames[0].contacts.count) == ""
    assert detail.kept_sweeps(40, 1172) == 40


def test_the_strongest_are_drawn_in_their_order(few, results):
    forces = results.frames[1]
    drawn = detail.drawn_contacts(forces)
    rows = np.sort(np.argsort(-forces.fn, kind="stable")[:DRAWN])
    assert np.array_equal(drawn.fn, forces.fn[rows])
    assert np.array_equal(drawn.contacts.key, forces.contacts.key[rows])
    assert np.array_equal(drawn.history.fn, forces.history.fn[:, rows])


def test_whatever_a_contact_has_is_chosen_and_what_the_frame_has_stays(few, results):
    forces = results.frames[1]
    whole, drawn = dict(flatten(forces)), dict(flatten(detail.drawn_contacts(forces)))
    assert whole.keys() == drawn.keys()
    of_contacts = {each.attribute for each in entries("frames") if each.dims[0] == "contact"}
    for name, values in drawn.items():
        if name in of_contacts:
            assert len(values) == DRAWN, name
        elif not name.startswith(("contacts.", "history.f")):
            assert np.array_equal(values, whole[name], equal_nan=values.dtype.kind == "f"), name


def test_fewer_sweeps_are_recorded_of_many_rods_but_some():
    assert detail.kept_sweeps(40, 10 * detail.MOST_COLOURS) == detail.LEAST_SWEEPS
    assert detail.kept_sweeps(0, 1172) == 0
    assert detail.kept_sweeps(40, 100_000) == 20


def test_a_recording_says_what_it_leaves_out_and_draws_no_more(few, tmp_path, monkeypatch):
    results = make_results(frame_count=2)

    def shown(entity: str, component: str) -> list:
        return latest(written.path, entity, entities.FRAME, 1)[component]

    written = write_recording(results, tmp_path / "run.rrd")
    assert f"the {DRAWN} strongest are drawn" in written.notes[0]
    assert "without outlines" in written.notes[0]
    assert len(shown(entities.FORCES, "LineStrips2D:strips")) == DRAWN
    assert len(shown(entities.CHANGE_MAP, "LineStrips2D:strips")) == DRAWN
    assert len(shown(entities.CHANGE_MAP, "LineStrips2D:colors")) == DRAWN
    assert len(shown(entities.GRAINS, "Points2D:positions")) == results.grains.count
    some = shown(entities.UNBALANCE_MAP, "Points2D:colors")
    monkeypatch.setattr(detail, "MOST_CONTACTS", 10**6)
    written = write_recording(results, tmp_path / "whole.rrd")
    assert len(shown(entities.FORCES, "LineStrips2D:strips")) > DRAWN
    assert shown(entities.UNBALANCE_MAP, "Points2D:colors") == some  # every contact counts, drawn or not
