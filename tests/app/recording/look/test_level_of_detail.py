"""Of a large packing the strongest contacts are drawn; statistics use all contacts."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.recording.files.finished_run import write_recording
from rodsight.recording.look import entities, level_of_detail
from rodsight.results.checkpoint import flatten
from rodsight.results.schema import entries

from tests.app.recording.fake_results import make_results
from tests.app.recording.rows import latest

DRAWN = 7


@pytest.fixture
def small_limits(monkeypatch):
    monkeypatch.setattr(level_of_detail, "MAX_DRAWN_CONTACTS", DRAWN)
    monkeypatch.setattr(level_of_detail, "MAX_OUTLINED", 3)


def test_all_of_a_packing_of_usual_size_is_drawn(results):
    assert level_of_detail.drawn_contacts(results.frames[0]) is results.frames[0]
    assert level_of_detail.describe_detail(results.grains.count, results.frames[0].contacts.count) == ""
    assert level_of_detail.kept_sweeps(40, 1172) == 40


def test_the_strongest_contacts_are_drawn_in_their_order(small_limits, results):
    forces = results.frames[1]
    drawn = level_of_detail.drawn_contacts(forces)
    rows = np.sort(np.argsort(-forces.fn, kind="stable")[:DRAWN])
    assert np.array_equal(drawn.fn, forces.fn[rows])
    assert np.array_equal(drawn.contacts.key, forces.contacts.key[rows])
    assert np.array_equal(drawn.history.fn, forces.history.fn[:, rows])


def test_quantities_of_contacts_are_selected_and_those_of_the_frame_unchanged(small_limits, results):
    forces = results.frames[1]
    whole, drawn = dict(flatten(forces)), dict(flatten(level_of_detail.drawn_contacts(forces)))
    assert whole.keys() == drawn.keys()
    of_contacts = {each.attribute for each in entries("frames") if each.dims[0] == "contact"}
    for name, values in drawn.items():
        if name in of_contacts:
            assert len(values) == DRAWN, name
        elif not name.startswith(("contacts.", "history.f")):
            assert np.array_equal(values, whole[name], equal_nan=values.dtype.kind == "f"), name


def test_fewer_sweeps_but_at_least_the_minimum_are_recorded_of_many_rods():
    assert level_of_detail.kept_sweeps(40, 10 * level_of_detail.MAX_COLOURS) == level_of_detail.MIN_SWEEPS
    assert level_of_detail.kept_sweeps(0, 1172) == 0
    assert level_of_detail.kept_sweeps(40, 100_000) == 20


@pytest.mark.thorough
def test_a_recording_reports_its_reductions_and_draws_no_more(small_limits, tmp_path, monkeypatch):
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
    monkeypatch.setattr(level_of_detail, "MAX_DRAWN_CONTACTS", 10**6)
    written = write_recording(results, tmp_path / "whole.rrd")
    assert len(shown(entities.FORCES, "LineStrips2D:strips")) > DRAWN
    assert shown(entities.UNBALANCE_MAP, "Points2D:colors") == some  # contacts that are not drawn count as well
