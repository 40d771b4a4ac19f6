"""The robustness study: what it compares, what it keeps, and the command end to end."""

import csv
import json
import math
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from rodsight.sensitivity.design import Case
from rodsight.sensitivity.networks import infer
from rodsight.sensitivity.study import Diary, compare, measure_case, run_study

from tests.app.sensitivity.conftest import FEW
from tests.program import DONE, TELLING, rodsight, wait_until_told

KAPPA = Case((("kappa", 2.0),))
FRICTION = Case((("friction", 0.8),))
SET = tuple(part for setting in FEW for part in ("--set", setting))


def test_the_nominal_inputs_give_the_nominal_forces_bit_for_bit(nominal):
    again = infer(nominal.inputs)
    assert np.array_equal(again.key, nominal.networks.key)
    assert np.array_equal(again.force, nominal.networks.force)


def test_the_nominal_run_has_no_effect_on_itself(nominal):
    effect = compare(nominal.networks, nominal)
    assert effect.r_fn == pytest.approx(1.0)
    assert effect.relative_l2 == 0.0
    assert effect.scale == 1.0
    assert effect.friction_angle_change == effect.principal_direction_change == 0.0
    assert effect.true_r_fn > 0.7  # 40 grains at 10 µm, few sweeps
    assert effect.frames == 1  # five photographs: none is past settling but the last


def test_forces_twice_as_large_are_seen_as_such(nominal):
    effect = compare(replace(nominal.networks, force=2.0 * nominal.networks.force), nominal)
    assert effect.r_fn == pytest.approx(1.0)
    assert effect.relative_l2 == pytest.approx(1.0)
    assert effect.scale == pytest.approx(2.0)


def test_a_turned_axis_has_no_sense_of_direction(nominal):
    turned = nominal.networks.principal_direction + np.pi - np.radians(2.0)
    effect = compare(replace(nominal.networks, principal_direction=turned), nominal)
    assert effect.principal_direction_change == pytest.approx(-2.0)


def test_only_photographs_of_both_runs_are_compared(nominal):
    effect = measure_case(nominal, Case((("spacing", 2.0),)))
    assert effect.frames == 1
    assert effect.r_fn > 0.7  # the last photograph, reached in steps twice as wide


def test_lower_friction_turns_the_stress_the_way_it_must(nominal):
    low, high = (measure_case(nominal, Case((("friction", value),))) for value in (0.6, 1.4))
    assert low.friction_angle_change < 0.0
    assert low.friction_angle_change < high.friction_angle_change


def test_a_finished_run_is_not_run_again(nominal, tmp_path, monkeypatch):
    diary = Diary(tmp_path / "runs.jsonl", "x")
    first = run_study(nominal, [KAPPA], diary)
    asked: list[Case] = []

    def measure(_, case):
        asked.append(case)
        return first[0]

    monkeypatch.setattr("rodsight.sensitivity.study.measure_case", measure)
    again = run_study(nominal, [KAPPA, FRICTION], diary)
    assert asked == [FRICTION]
    assert again[0] == first[0]
    run_study(nominal, [KAPPA], Diary(tmp_path / "runs.jsonl", "another nominal run"))
    assert asked == [FRICTION, KAPPA]


def test_a_line_that_was_cut_short_is_passed_over(nominal, tmp_path):
    diary = Diary(tmp_path / "runs.jsonl", "x")
    effect = compare(nominal.networks, nominal)
    diary.write(KAPPA, effect)
    diary.file.write_bytes(diary.file.read_bytes() + diary.file.read_bytes()[:40])
    diary.write(FRICTION, replace(effect, trust=math.nan))
    found = diary.read()
    assert set(found) == {KAPPA.key, FRICTION.key}
    assert found[KAPPA.key] == effect
    assert math.isnan(found[FRICTION.key].trust)


def test_a_run_that_is_not_possible_is_told_and_the_others_go_on(nominal):
    inputs = replace(nominal.inputs, settings=replace(nominal.inputs.settings, coordination=9.0))
    effect = measure_case(replace(nominal, inputs=inputs), KAPPA)
    assert "cannot be met" in effect.failure
    assert math.isnan(effect.r_fn)


@pytest.mark.slow
def test_the_command_ranks_what_it_varied(made_tracks, tmp_path, capsys):
    out = tmp_path / "out"
    factors = ("--factors", "friction=0.5:1.5", "kappa", "first_frame=1:1")
    assert rodsight("sensitivity", made_tracks, "--out", out, *SET, *factors, "--workers", 1) == 0
    told = capsys.readouterr().out
    assert "What matters most: friction (× 0.5" in told
    with (out / "sensitivity.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["factor"] for row in rows[:3]] == ["nominal", "friction", "friction"]
    assert len(rows) == 1 + 2 + 2 + 1
    assert float(rows[1]["relative_l2"]) > 0.1
    table = pq.read_table(out / "sensitivity.parquet")
    assert table.num_rows == len(rows)
    assert set(table.column_names) == set(rows[0])
    stored = json.loads((out / "sensitivity.json").read_text())
    assert stored["ranking"][0]["factor"] == "friction"
    assert rodsight("sensitivity", made_tracks, "--out", out, *SET, *factors, "--json") == 0  # from the diary
    assert json.loads(capsys.readouterr().out) == stored


@pytest.mark.slow
def test_a_design_divides_the_variance(made_tracks, tmp_path, capsys):
    out = tmp_path / "out"
    design = ("--design", "sobol", "--samples", 6, "--factors", "friction=0.5:1.5", "kappa", "--workers", 1)
    assert rodsight("sensitivity", made_tracks, "--out", out, *SET, *design, "--frames", "0:3") == 0
    assert "6 runs of a Sobol design" in capsys.readouterr().out
    stored = json.loads((out / "sensitivity.json").read_text())
    assert set(stored["main_effects"]["scale"]["index"]) == {"friction", "kappa"}
    assert len(stored["runs"]) == 6
    assert (out / "sensitivity.csv").read_text().splitlines()[0].startswith("friction,kappa,")


@pytest.mark.screen
def test_two_workers_find_what_one_finds(nominal, tmp_path):
    cases = [KAPPA, FRICTION, Case((("position_noise", 1.0),), seed=4)]
    one = run_study(nominal, cases, Diary(tmp_path / "one.jsonl", "x"))
    two = run_study(nominal, cases, Diary(tmp_path / "two.jsonl", "x"), workers=2)
    assert one == two


@pytest.mark.screen
def test_ctrl_c_ends_the_study_and_the_same_command_goes_on(made_tracks, tmp_path, capsys):
    out = tmp_path / "out"
    command = ("sensitivity", made_tracks, "--out", out, *SET, "--factors", "kappa=0.5:2", "sweeps=0.1:2000")
    study = subprocess.Popen(
        [*TELLING, *(str(each) for each in command), "--workers", "2"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    diary = out / "sensitivity_runs.jsonl"
    wait_until_told(study, DONE, 3)  # × 0.1 and κ; × 2000 goes on for minutes
    os.killpg(study.pid, signal.SIGINT)  # as a terminal does: the workers hear it, too
    told, errors = study.communicate(timeout=60)
    assert study.returncode == 130
    assert errors.strip().splitlines()[-1] == "rodsight: interrupted; the same command goes on from here"
    assert "Traceback" not in errors
    assert told == ""
    before = diary.read_text()
    assert rodsight("sensitivity", made_tracks, "--out", out, *SET, "--factors", "kappa", "--quiet") == 0
    assert diary.read_text() == before
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("--factors", "viscosity"), "viscosity"),
        (("--factors", "friction=2:1"), "friction=2:1"),
        (("--set", "sensitivity.ranges.friction=[1.2, 0.8]"), "sensitivity.ranges.friction"),
        (("--set", "sensitivity.ranges.friction=3"), "sensitivity.ranges.friction"),
        (("--set", "sensitivity.range=3"), "sensitivity.range"),
        (("--samples", "9"), "--samples: 9"),
        (("--design", "sobol", "--samples", "9"), "--samples: 9"),
        (("--workers", "0"), "--workers: 0"),
        (("--seed", "-1"), "--seed: -1"),
        (("--frames", "3:99"), "3:99"),
        (("--scheduler", "tcp://127.0.0.1:9"), "--scheduler: tcp://127.0.0.1:9"),
    ],
)
def test_a_mistake_is_named_in_one_line_and_nothing_is_written(
    arguments, named, made_tracks, tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr("rodsight.sensitivity.execution.ANSWER", 0.2)  # [s]
    out = tmp_path / "out"
    assert rodsight("sensitivity", made_tracks, "--out", out, "--quiet", *arguments) == 2
    told = capsys.readouterr()
    assert told.err.count("\n") == 1
    assert told.err.startswith("rodsight: ")
    assert named in told.err
    assert told.out == ""
    assert not out.exists()


@pytest.mark.slow
def test_a_scheduler_runs_the_study_on_its_workers(made_tracks, tmp_path, capsys):
    distributed = pytest.importorskip("dask.distributed", reason="needs the extra cluster")
    here, there = tmp_path / "here", tmp_path / "there"
    command = ("sensitivity", made_tracks, *SET, "--factors", "kappa", "--frames", "0:3", "--quiet")
    assert rodsight(*command, "--out", here, "--workers", 1) == 0
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None, protocol="tcp", host="127.0.0.1"
    ) as cluster:
        assert rodsight(*command, "--out", there, "--scheduler", cluster.scheduler_address) == 0
    assert (here / "sensitivity.csv").read_text() == (there / "sensitivity.csv").read_text()
    capsys.readouterr()


def test_without_dask_a_scheduler_is_refused_in_one_line(made_tracks, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "dask.distributed", None)
    out = tmp_path / "out"
    assert rodsight("sensitivity", made_tracks, "--out", out, "--scheduler", "tcp://127.0.0.1:9") == 2
    assert capsys.readouterr().err == (
        "rodsight: --scheduler: tcp://127.0.0.1:9: needs dask: pip install 'rodsight[cluster]'\n"
    )
    assert not Path(out).exists()
