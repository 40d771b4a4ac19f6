from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.drawing.force_range import ForceRange
from rodsight.recording.curve_layers.settling import ALL_TRACKED, SOME_CUT, SOME_INFERRED, SOME_LOST, tracking_state
from rodsight.recording.files.finished_run import RecordingOptions, write_recording
from rodsight.recording.look import entities
from rodsight.recording.look.canvas import Canvas
from rodsight.recording.look.force_style import ForceStyle
from rodsight.recording.look.written_schema import SCHEMA, Condition
from rodsight.recording.packing_layers.grains_and_walls import grain_colours
from rodsight.solver.frame_forces import FrameStatus
from rodsight.tracks import TrackStatus

from tests.app.recording.fake_results import make_results
from tests.app.recording.rows import components, latest, rows

pytestmark = pytest.mark.thorough


def expected(*absent: Condition) -> dict[str, tuple[set[str], set[str]]]:
    return {
        entity.path: (set(entity.when.timelines), set(entity.components))
        for entity in SCHEMA
        if entity.condition not in absent
    }


def written(path) -> dict[str, tuple[set[str], set[str]]]:
    """Return the entities in the file, those of single frames as one."""
    per_frame = {entity.path for entity in SCHEMA if entity.per_frame}
    found = {}
    for path_of, parts in components(path).items():
        head, _, frame = path_of.rpartition("/")
        if head in per_frame and frame.isdecimal():
            path_of = head
        if not path_of.startswith("/__properties"):
            found[path_of] = parts
    return found


def test_a_full_recording_contains_exactly_the_entities_of_the_schema(recording):
    assert written(recording.path) == expected(Condition.CELL)


def test_a_minimal_recording_contains_the_unconditional_part_of_the_schema(tmp_path):
    report = write_recording(make_results(1, sweeps=0, recorded=np.empty(0, int)), tmp_path / "bare.rrd")
    # The only frame is a reset, which is flagged.
    absent = (Condition.PHOTOGRAPHS, Condition.TRUTH, Condition.TOLERANCE, Condition.SWEPT, Condition.RADII)
    absent += (Condition.WALL_FORCES, Condition.BUDGET, Condition.KINEMATICS, Condition.FRINGES)
    assert written(report.path) == expected(*absent, Condition.CELL)


def test_every_entity_is_described_once():
    assert len({entity.path for entity in SCHEMA}) == len(SCHEMA)


def test_every_frame_begins_with_geometry_width_colour_and_values_in_one_row(recording, results):
    whole = {"LineStrips2D:strips", "LineStrips2D:radii", "LineStrips2D:colors", "fn", "ft", "i", "j"}
    by_frame: dict[int, list[dict]] = {}
    for row in rows(recording.path, entities.FORCES):
        by_frame.setdefault(row["frame"], []).append(row)
    assert sorted(by_frame) == list(range(len(results.frames)))
    for frame_rows in by_frame.values():
        first = min(frame_rows, key=lambda row: row["sweep"])
        assert whole <= set(first)
        assert sum("LineStrips2D:strips" in row for row in frame_rows) == 1
        count = len(first["LineStrips2D:strips"])
        assert all(len(row["LineStrips2D:radii"]) == len(row["LineStrips2D:colors"]) == count for row in frame_rows)


def test_both_timelines_end_a_frame_with_the_reported_field(tmp_path):
    results = make_results(3, sweeps=50)
    path = write_recording(results, tmp_path / "run.rrd").path
    style = ForceStyle.on(Canvas.around(results.tracks, None), ForceRange.of(results.frames))
    end = -1
    for forces in results.frames:
        end += forces.history.count + 1  # the reported field comes after the last sweep
        for timeline, at in ((entities.FRAME, forces.frame), (entities.SWEEP, end)):
            shown = latest(path, entities.FORCES, timeline, at)
            assert shown["LineStrips2D:radii"] == style.radii(forces.fn).tolist()
            assert shown["LineStrips2D:colors"] == style.colours(forces.fn).tolist()
            assert shown["fn"] == forces.fn.tolist()


def test_sliding_marks_are_cleared_at_the_start_of_the_next_frame(tmp_path):
    results = make_results(2, sweeps=30)
    path = write_recording(results, tmp_path / "run.rrd").path
    assert len(latest(path, entities.SLIDING, entities.SWEEP, 30)["Points2D:positions"]) > 0
    assert len(latest(path, entities.SLIDING, entities.SWEEP, 31)["Points2D:positions"]) == 0
    assert len(latest(path, entities.SLIDING, entities.FRAME, 1)["Points2D:positions"]) > 0


def test_every_sweep_has_its_residuals_for_any_choice_of_kept_forces(tmp_path):
    results = make_results(3, sweeps=50, recorded=np.array([0, 10, 49]))
    path = write_recording(results, tmp_path / "run.rrd", options=RecordingOptions(sweeps="none")).path
    logged = [row for row in rows(path, entities.SWEEP_NATURAL_MAP) if "Scalars:scalars" in row]
    found = [row for row in logged if "sweep" in row and "frame" not in row]
    assert [row["sweep"] for row in found] == [*range(50), *range(51, 101), *range(102, 152)]
    expected_values = np.concatenate([np.log10(frame.history.natural_map) for frame in results.frames])
    assert np.array_equal([row["Scalars:scalars"][0] for row in found], expected_values)
    reported = [row for row in logged if "frame" in row]  # on all timelines: the reported field, after the sweeps
    assert [(row["frame"], row["sweep"]) for row in reported] == [(0, 50), (1, 101), (2, 152)]
    values = [row["Scalars:scalars"][0] for row in reported]
    assert values == pytest.approx([np.log10(frame.natural_map) for frame in results.frames])


def test_the_curves_of_a_frame_end_with_the_unbalance_of_the_reported_field(tmp_path):
    results = make_results(2, sweeps=20)
    frames = [replace(each, unbalance=1e-3 * (1 + each.frame)) for each in results.frames]
    path = write_recording(replace(results, frames=frames), tmp_path / "run.rrd").path
    for frame in frames:
        curve = latest(path, entities.SWEEP_UNBALANCE, entities.FRAME, frame.frame)["Scalars:scalars"]
        assert curve == pytest.approx([np.log10(frame.unbalance)])
        mark = latest(path, entities.RESIDUAL_REPORTED, entities.FRAME, frame.frame)
        assert mark["Points2D:labels"] == ["reported"]


def test_the_caption_states_when_how_strained_and_how_far_to_trust_and_sweeps_are_not_reported(tmp_path):
    results = make_results(2, sweeps=20)
    frames = [replace(each, shear=0.02 * each.frame, trust=0.8) for each in results.frames]
    path = write_recording(replace(results, frames=frames), tmp_path / "run.rrd").path
    (text,) = latest(path, entities.CAPTION, entities.FRAME, 1)["Points2D:labels"]
    assert text.startswith(f"frame 1 · {results.tracks.time[1]:.4g} s · shear 1.15°")
    assert text.endswith(f"{frames[1].status.name.lower()} · trust 0.80")
    (forming,) = latest(path, entities.CAPTION, entities.SWEEP, 25)["Points2D:labels"]
    assert "not yet the reported field" in forming
    card = latest(path, entities.FRAME_CARD, entities.FRAME, 1)["TextDocument:text"][0]
    assert "trust **0.80**" in card
    frame = replace(frames[1], status=FrameStatus.SETTLED, reason="history agrees", trust_penalties="noise of 12 µm")
    path = write_recording(replace(results, frames=[frames[0], frame]), tmp_path / "settled.rrd").path
    card = latest(path, entities.FRAME_CARD, entities.FRAME, 1)["TextDocument:text"][0]
    assert f"{results.statistics[1].contact_count} of {frame.contacts.count} contacts bear force" in card
    assert card.endswith("What lowers the trust:\n\n- noise of 12 µm\n\n"
                         "Why settled, and how the forces were found:\n\n- history agrees")  # fmt: skip


def test_a_lost_grain_is_crossed_out_flagged_and_keeps_its_row(recording, results):
    grains = latest(recording.path, entities.GRAINS, entities.FRAME, 3)
    assert len(grains["Ellipses2D:centers"]) == results.grains.count
    assert np.all(np.isfinite(grains["Ellipses2D:centers"]))
    assert grains["status"][20] == "lost"
    assert len(latest(recording.path, entities.GRAINS_LOST, entities.FRAME, 1)["LineStrips2D:strips"]) == 0
    assert len(latest(recording.path, entities.GRAINS_LOST, entities.FRAME, 2)["LineStrips2D:strips"]) == 2
    flags = [row["TextLog:text"][0] for row in rows(recording.path, entities.FLAGS)]
    assert any("grain 120 is lost" in flag for flag in flags)


def test_the_last_sweep_of_the_chain_is_shown_before_the_reported_field(tmp_path):
    results = make_results(2, sweeps=50)
    other = [replace(frame, fn=0.5 * frame.fn) for frame in results.frames]  # reported by another estimator
    path = write_recording(replace(results, frames=other), tmp_path / "run.rrd").path
    style = ForceStyle.on(Canvas.around(results.tracks, None), ForceRange.of(other))
    frame = other[0]
    chain = latest(path, entities.FORCES, entities.SWEEP, 49)["LineStrips2D:radii"]
    assert chain == style.radii(frame.history.fn[-1]).tolist()
    reported = latest(path, entities.FORCES, entities.SWEEP, 50)["LineStrips2D:radii"]
    assert reported == style.radii(frame.fn).tolist() != chain


def _with_status(results, *, status, visible: bool, frame: int = 2, row: int = 20):
    tracks = results.tracks
    changed, position = tracks.status.copy(), tracks.position.copy()
    changed[frame, row] = status
    if not visible:
        position[frame, row] = np.nan
    return replace(tracks, status=changed, position=position)


def test_the_tracking_lane_distinguishes_lost_cut_and_inferred_grains():
    results = make_results(3)
    assert tracking_state(results.tracks, 2) == ALL_TRACKED
    assert tracking_state(_with_status(results, status=TrackStatus.LOST, visible=False), 2) == SOME_LOST
    assert tracking_state(_with_status(results, status=TrackStatus.OUT_OF_FRAME, visible=False), 2) == SOME_CUT
    inferred = _with_status(results, status=TrackStatus.INFERRED, visible=True)
    assert tracking_state(inferred, 2) == SOME_INFERRED
    assert tracking_state(inferred, 1) == ALL_TRACKED


def test_a_grain_cut_by_the_border_is_not_counted_as_lost():
    results = make_results(3)
    cut = _with_status(results, status=TrackStatus.OUT_OF_FRAME, visible=False)
    assert cut.describe_missing() == "0 poses lost, 1 rod cut by the picture's border (1 pose)"
    assert not cut.lost.any()
    unseen = replace(results.tracks, inferred=np.arange(results.grains.count) == 20)
    assert unseen.describe_missing() == "0 poses lost, 1 rod inferred"


def test_an_inferred_rod_has_a_distinct_colour():
    status = np.array([TrackStatus.OK, TrackStatus.SUSPECT, TrackStatus.INFERRED, TrackStatus.LOST], np.uint8)
    colours = grain_colours(status, np.array([True, True, True, False]))
    assert len(set(colours.tolist())) == 4
