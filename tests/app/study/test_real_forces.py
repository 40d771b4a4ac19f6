"""Photoelastic forces with two noisy readings, compared with a run and motion-free baselines."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rodsight.cli.main import main
from rodsight.process.frame_range import FrameRange
from rodsight.results.results import Results, TruthContacts
from rodsight.study.real.real_forces import RealStudy, as_json, correlate_sides, study_real
from rodsight.study.real.real_page import describe_limits, real_page, rows_of
from rodsight.synthetic.photoelastic.pegs_files import make_photoelastic

from tests.app.recording.fake_results import make_results
from tests.app.study.test_baselines import own_forces
from tests.program import rodsight


@pytest.fixture(scope="module")
def results() -> Results:
    return make_results(frame_count=2)


@pytest.fixture(scope="module")
def same(results: Results) -> RealStudy:
    """A run compared with its own forces."""
    return study_real(results, own_forces(results), [0.7, float("nan")])


def test_forces_that_are_the_truth_agree_in_everything(same: RealStudy) -> None:
    for row in same.frames:
        assert [row.ours.r, row.ours.matched, row.ours.pressure] == pytest.approx([1.0, 1.0, 1.0])
        assert row.recall == pytest.approx(1.0)
        assert row.static.r < 0.999


def test_a_direction_is_compared_without_its_sense(results: Results, same: RealStudy) -> None:
    for row in same.frames:
        assert 0.0 <= row.direction < 180.0
        assert -90.0 <= row.direction_error("uniform") < 90.0
        assert abs(row.direction_error("ours")) < 10.0  # the true direction is computed without tangential forces


def test_the_standard_deviation_of_the_direction_is_held_against_its_error(results: Results, same: RealStudy) -> None:
    error = [abs(row.direction_error("ours")) for row in same.frames]
    sds = np.radians([1.1 * error[0], 0.6 * error[1]])
    stated = [replace(each, principal_direction_sd=sd) for each, sd in zip(results.statistics, sds, strict=True)]
    found = study_real(replace(results, statistics=stated), own_forces(results), [0.7, float("nan")])
    mean, one, two = found.direction_coverage()
    assert mean == pytest.approx(np.degrees(sds).mean())
    assert (one, two) == (0.5, 1.0)
    assert "cover the true one in 50 and 100 % of the frames" in describe_limits(found)
    unknown = [replace(each, principal_direction_sd=float("nan")) for each in stated]
    none = study_real(replace(results, statistics=unknown), own_forces(results), [0.7, float("nan")])
    assert "standard deviation of the principal direction" not in describe_limits(none)


def test_the_ceiling_is_nearer_to_the_truth_than_a_baseline(same: RealStudy) -> None:
    for row in same.frames:
        assert row.ceiling.r > row.static.r


def test_order_and_unit_of_the_truth_do_not_matter(results: Results, same: RealStudy) -> None:
    exact = own_forces(results)
    order = np.lexsort([-exact.i, exact.frame])
    direction_error = TruthContacts(
        exact.frame[order], exact.i[order], exact.j[order], 1e-3 * exact.fn[order], 1e-3 * exact.ft[order]
    )
    found = study_real(results, direction_error, [0.7, float("nan")])
    assert [row.ours.r for row in found.frames] == pytest.approx([row.ours.r for row in same.frames])
    assert [row.direction for row in found.frames] == pytest.approx([row.direction for row in same.frames])


def test_the_page_holds_three_pictures_and_every_row(same: RealStudy) -> None:
    page = real_page(same)
    assert page.count("<svg") == 3
    for row in rows_of(same):
        assert all(f"<td>{cell}</td>" in page for cell in row)
    assert "correlate by 0.700" in describe_limits(same)
    assert "http" not in page


def test_the_total_force_is_followed_over_time_and_trust_is_held_against_r() -> None:
    results = make_results(frame_count=4)
    exact = own_forces(results)
    rising = 1.0 + exact.frame  # the true forces grow while those of the run stay
    truth = TruthContacts(exact.frame, exact.i, exact.j, rising * exact.fn, rising * exact.ft)
    follows = [replace(frame, fn=(k + 1.0) * frame.fn, trust=0.9) for k, frame in enumerate(results.frames)]
    reverse = [replace(frame, fn=frame.fn / (k + 1.0), trust=np.nan) for k, frame in enumerate(results.frames)]
    sides = [float("nan")] * 4
    good, inverted = (study_real(replace(results, frames=each), truth, sides) for each in (follows, reverse))
    assert good.total_correlation("ours") == pytest.approx(1.0)
    assert inverted.total_correlation("ours") < 0.0
    assert good.count_excess() == (0, 4)
    assert inverted.count_excess() == (0, 0)
    assert "There is no trust" in describe_limits(inverted)
    sure = [replace(frame, fn=frame.fn[::-1].copy(), trust=1.0) for frame in results.frames]
    wrong = study_real(replace(results, frames=sure), truth, sides)
    assert wrong.count_excess() == (4, 4)
    assert as_json(wrong)["frames_above_r"] == 4
    assert "in 4 of 4 frames" in describe_limits(wrong)
    assert rows_of(good)[0][-1] == "1.00"


def test_json_has_no_number_that_does_not_exist(same: RealStudy) -> None:
    found = json.loads(json.dumps(as_json(same), allow_nan=False))
    assert found["sides"] == [0.7, None]
    assert found["ours"]["r"] == pytest.approx([1.0, 1.0])
    assert set(found["mean"]) == {"ours", "static", "overlap", "uniform", "ceiling"}


def test_both_readings_are_correlated_where_there_are_two(tmp_path: Path) -> None:
    file = tmp_path / "truth.csv"
    file.write_text("frame,i,j,fn,ft,fn_i,fn_j\n3,0,1,2,0,1,3\n3,0,2,3,0,2,6\n3,1,2,3,0,3,\n4,0,1,1,0,,1\n")
    found = correlate_sides(file, FrameRange(3), 2)
    assert found[0] == pytest.approx(1.0)
    assert np.isnan(found[1])
    file.write_text("frame,i,j,fn,ft,fn_i,fn_j\n3,0,1,2,0,1.5,1.5\n3,0,2,3,0,2.5,2.5000000001\n")
    assert np.isnan(correlate_sides(file, FrameRange(3), 1)[0])  # copies are no second reading
    file.write_text("frame,i,j,fn,ft\n3,0,1,2,0\n")
    assert np.isnan(correlate_sides(file, FrameRange(3), 1)[0])


@pytest.mark.slow
def test_photoelastic_discs_are_imported_solved_and_compared(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = make_photoelastic(tmp_path / "solved", 1, grains=120)
    for arguments in (
        ["import", "pegs", tmp_path / "solved", tmp_path / "test", "--pixel-size", made.pixel_size],
        ["solve", tmp_path / "test", "--out", tmp_path / "run", "--quiet"],
        ["study", "real", tmp_path / "run", "--json", "--page", tmp_path / "real.html"],
    ):
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            main(list(map(str, arguments)))
        assert not end.value.code
    found = json.loads(capsys.readouterr().out)
    assert 0.5 < np.mean(found["sides"]) < 0.95
    assert found["mean"]["ours"]["r"] > found["mean"]["uniform"]["r"]
    assert (tmp_path / "real.html").read_text().count("<svg") == 3


def test_standard_deviations_cover_the_truth_in_its_own_unit(results: Results) -> None:
    exact = own_forces(results)
    other_unit = replace(exact, fn=1e-3 * exact.fn, ft=1e-3 * exact.ft)
    wide = replace(results, frames=[replace(frame, fn_sd=np.full(len(frame.fn), 1e-9)) for frame in results.frames])
    found = study_real(wide, other_unit, [float("nan")] * len(results.frames))
    assert all(row.covered == (1.0, 1.0) for row in found.frames)
    assert "cover 100 and 100 %" in describe_limits(found)
    rng = np.random.default_rng(2)
    noise = 0.5 * exact.fn.mean() * rng.standard_normal(len(exact.fn))
    noisy = study_real(wide, replace(exact, fn=exact.fn + noise), [float("nan")] * len(results.frames))
    assert all(row.covered[1] < 0.2 for row in noisy.frames)


@pytest.mark.slow
def test_files_of_measured_forces_are_solved_and_compared_by_one_command(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    make_photoelastic(tmp_path / "discs", 3, grains=60)
    for _ in range(2):  # the second time the results are there
        assert rodsight("study", "real", "discs", "--json") == 0
        found = json.loads(capsys.readouterr().out)
        assert found["mean"]["ours"]["r"] > found["mean"]["uniform"]["r"]
    assert (tmp_path / "runs" / "real" / "discs" / "run" / "results.h5").is_file()


@pytest.mark.parametrize(
    ("files", "reason"),
    [((), "is neither a run"), (("particle_positions.txt",), "holds no measured forces to compare with")],
)
def test_a_folder_without_measured_forces_is_refused_before_it_is_solved(tmp_path, capsys, files, reason) -> None:
    for name in files:
        (tmp_path / name).write_text("0 0 1 1 1 0\n")
    assert rodsight("study", "real", tmp_path) == 2
    assert reason in capsys.readouterr().err
