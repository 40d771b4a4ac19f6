from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.cli.main import main
from rodsight.recording.comparison_layer import (
    DIFFERENCE,
    FIRST,
    R_FN,
    SECOND,
    describe,
    record_comparison,
)
from rodsight.recording.look import entities
from rodsight.recording.packing_layers.forces.difference import difference_colours
from rodsight.results.comparison import DifferentPackingError, compare_runs, compare_with_truth
from rodsight.results.results import TruthContacts

from tests.app.recording.fake_results import make_results, make_truth
from tests.app.recording.rows import latest, rows

ROUNDING = 1e-9


def test_a_run_agrees_exactly_with_itself(results, tmp_path):
    found = compare_runs(results, results)
    assert [each.r_fn for each in found.agreement] == pytest.approx([1.0] * 4)
    assert [each.relative_l2 for each in found.agreement] == [0.0] * 4
    assert found.notes == ()
    record_comparison(found, tmp_path / "same.rrd")
    shown = latest(tmp_path / "same.rrd", R_FN, entities.FRAME, 3)
    assert shown["Scalars:scalars"] == pytest.approx([1.0])
    difference = latest(tmp_path / "same.rrd", DIFFERENCE, entities.FRAME, 2)
    assert len(set(difference["LineStrips2D:colors"])) == 1


def test_doubled_forces_differ_by_the_original_forces(results, tmp_path):
    doubled = replace(results, frames=[replace(f, fn=2.0 * f.fn, ft=2.0 * f.ft) for f in results.frames])
    found = compare_runs(doubled, results, names=("double", "single"))
    assert [each.scale for each in found.agreement] == pytest.approx([2.0] * 4)
    assert [each.relative_l2 for each in found.agreement] == pytest.approx([1.0] * 4)
    record_comparison(found, tmp_path / "twice.rrd")
    shown = latest(tmp_path / "twice.rrd", DIFFERENCE, entities.FRAME, 1)
    assert np.allclose(np.array(shown["fn_first"]), 2.0 * np.array(shown["fn_second"]))
    assert "double against single" in describe(found)


def test_bodies_with_other_ids_are_matched_by_position(results):
    order = np.random.default_rng(5).permutation(results.grains.count)
    tracks = results.tracks
    moved = replace(
        tracks, id=np.arange(len(order)) + 5000, radius=tracks.radius[order], position=tracks.position[:, order],
        rotation=tracks.rotation[:, order], sigma=tracks.sigma[:, order], zncc=tracks.zncc[:, order],
        status=tracks.status[:, order],
    )  # fmt: skip
    row = np.empty(len(order) + results.walls.count, np.int64)
    row[order] = np.arange(len(order))
    row[len(order) :] = np.arange(len(order), len(row))
    frames = []
    for forces in results.frames:
        i, j = row[forces.contacts.i], row[forces.contacts.j]
        low, high = np.minimum(i, j).astype(np.int32), np.maximum(i, j).astype(np.int32)
        frames.append(replace(forces, contacts=replace(forces.contacts, i=low, j=high)))
    found = compare_runs(results, replace(results, tracks=moved, frames=frames))
    assert [each.r_fn for each in found.agreement] == pytest.approx([1.0] * 4, abs=ROUNDING)
    assert "matched by their positions" in found.notes[0]


def test_runs_over_other_frames_are_compared_where_they_overlap(results):
    late = replace(
        results, tracks=results.tracks.frames(1, 4), walls=results.walls.frames(1, 4),
        frames=[replace(f, frame=k) for k, f in enumerate(results.frames[1:])], statistics=results.statistics[1:],
    )  # fmt: skip
    found = compare_runs(results, late, starts=(0, 1))
    assert [each.r_fn for each in found.agreement] == pytest.approx([1.0] * 3)
    assert "Only 3 frames" in found.notes[0]
    with pytest.raises(DifferentPackingError, match="no frame"):
        compare_runs(results, late, starts=(0, 9))


def test_two_packings_are_not_compared():
    one, other = make_results(1), make_results(1, columns=5, rows=4)
    shifted = replace(other.tracks, position=other.tracks.position + 0.005)
    with pytest.raises(DifferentPackingError, match="not the same packing"):
        compare_runs(one, replace(other, tracks=shifted))


def test_the_own_forces_as_truth_give_the_friction_angle_of_the_run(results):
    frame = np.concatenate([np.full(f.contacts.count, f.frame) for f in results.frames])
    columns = [np.concatenate([getattr(f.contacts, k) for f in results.frames]).astype(np.int64) for k in "ij"]
    columns += [np.concatenate([getattr(f, k) for f in results.frames]) for k in ("fn", "ft")]
    found = compare_with_truth(results, TruthContacts(frame.astype(np.int64), *columns), name="run")
    assert [each.r_ft for each in found.agreement] == pytest.approx([1.0] * 4)
    from rodsight.solver.statistics.stress import friction_angle, love_weber_stress

    first = results.frames[0]
    stress = love_weber_stress(first.contacts, first.fn, first.ft, results.tracks.position[0], 1.0, 1.0)
    assert found.second.frames[0].friction_angle == pytest.approx(friction_angle(stress), rel=ROUNDING)


def test_a_truth_with_noise_differs_and_is_drawn(results, tmp_path):
    truth = make_truth(results, np.random.default_rng(3))
    found = compare_with_truth(results, truth, name="run")
    assert all(0.9 < each.r_fn < 1.0 for each in found.agreement)
    record_comparison(found, tmp_path / "truth.rrd")
    for path in (FIRST, SECOND):
        assert {row["frame"] for row in rows(tmp_path / "truth.rrd", path)} == set(range(4))


def test_colours_show_which_field_is_greater():
    more, less, equal = difference_colours(np.array([5.0, -5.0, 0.0]), 10.0)
    assert len({more, less, equal}) == 3
    assert more >> 24 > more >> 8 & 0xFF  # warm: red above blue
    assert less >> 24 < less >> 8 & 0xFF


@pytest.mark.slow
def test_the_command_compares_a_run_with_its_truth_and_with_itself(tracked, tmp_path, capsys):
    out = tmp_path / "out"
    few = ("--set", "solver.sweeps=50", "--quiet")
    for arguments in (
        ["solve", str(tracked), "--out", str(out), *few],
        ["compare", str(out), str(out / "results.h5"), "--out", str(tmp_path / "same.rrd")],
        ["compare", str(out), "--truth", "--out", str(tmp_path / "truth.rrd")],
    ):
        with pytest.raises(SystemExit) as end:
            main(arguments)
        assert not end.value.code
    output = capsys.readouterr().out
    assert "r(f_n) mean 1.000, least 1.000" in output
    assert "out against truth" in output
    assert (tmp_path / "same.rrd").stat().st_size > 0
    with pytest.raises(SystemExit) as end:
        main(["compare", str(out)])
    assert end.value.code == 2
