"""The robustness study: comparison, stored effects, and the command end to end."""

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
from rodsight.robustness.design import Case
from rodsight.robustness.networks import infer
from rodsight.robustness.study import EffectLog, compare, measure_case, run_study

from tests.app.robustness.conftest import FEW
from tests.program import DONE, REPORTING, rodsight, wait_for_report

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
    assert effect.frames == 1  # five photographs: only the last one is compared


def test_doubled_forces_have_a_scale_of_two(nominal):
    effect = compare(replace(nominal.networks, force=2.0 * nominal.networks.force), nominal)
    assert effect.r_fn == pytest.approx(1.0)
    assert effect.relative_l2 == pytest.approx(1.0)
    assert effect.scale == pytest.approx(2.0)


def test_principal_directions_differ_modulo_180_degrees(nominal):
    rotated = nominal.networks.principal_direction + np.pi - np.radians(2.0)
    effect = compare(replace(nominal.networks, principal_direction=rotated), nominal)
    assert effect.principal_direction_change == pytest.approx(-2.0)


def test_only_photographs_of_both_runs_are_compared(nominal):
    effect = measure_case(nominal, Case((("spacing", 2.0),)))
    assert effect.frames == 1
    assert effect.r_fn > 0.7  # the last photograph, reached in steps twice as wide


@pytest.mark.slow
def test_lower_friction_lowers_the_macroscopic_friction_angle(nominal):
    low, high = (measure_case(nominal, Case((("friction", value),))) for value in (0.6, 1.4))
    assert low.friction_angle_change < 0.0
    assert low.friction_angle_change < high.friction_angle_change


@pytest.mark.thorough
def test_inputs_that_were_not_varied_have_the_trust_of_the_run(nominal):
    again = infer(nominal.inputs)
    np.testing.assert_array_equal(again.trust, nominal.networks.trust)


@pytest.mark.thorough
def test_a_finished_run_is_not_run_again(nominal, tmp_path, monkeypatch):
    effect_log = EffectLog(tmp_path / "runs.jsonl", "x")
    first = run_study(nominal, [KAPPA], effect_log)
    measured: list[Case] = []

    def measure(_, case):
        measured.append(case)
        return first[0]

    monkeypatch.setattr("rodsight.robustness.study.measure_case", measure)
    again = run_study(nominal, [KAPPA, FRICTION], effect_log)
    assert measured == [FRICTION]
    assert again[0] == first[0]
    run_study(nominal, [KAPPA], EffectLog(tmp_path / "runs.jsonl", "another nominal run"))
    assert measured == [FRICTION, KAPPA]


def test_a_truncated_line_is_skipped(nominal, tmp_path):
    effect_log = EffectLog(tmp_path / "runs.jsonl", "x")
    effect = compare(nominal.networks, nominal)
    effect_log.write(KAPPA, effect)
    effect_log.file.write_bytes(effect_log.file.read_bytes() + effect_log.file.read_bytes()[:40])
    effect_log.write(FRICTION, replace(effect, trust=math.nan))
    found = effect_log.read()
    assert set(found) == {KAPPA.key, FRICTION.key}
    assert found[KAPPA.key] == effect
    assert math.isnan(found[FRICTION.key].trust)


def test_an_impossible_run_reports_its_failure_and_has_no_values(nominal):
    inputs = replace(nominal.inputs, settings=replace(nominal.inputs.settings, coordination=9.0))
    effect = measure_case(replace(nominal, inputs=inputs), KAPPA)
    assert "cannot be met" in effect.failure
    assert math.isnan(effect.r_fn)


@pytest.mark.slow
def test_the_command_ranks_the_varied_factors(made_tracks, tmp_path, capsys):
    out = tmp_path / "out"
    factors = ("--factors", "friction=0.5:1.5", "kappa", "first_frame=1:1")
    assert rodsight("sensitivity", made_tracks, "--out", out, *SET, *factors, "--workers", 1) == 0
    printed = capsys.readouterr().out
    with (out / "sensitivity.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert sorted(row["factor"] for row in rows) == ["first_frame", *2 * ["friction"], *2 * ["kappa"], "nominal"]
    assert len(rows) == 1 + 2 + 2 + 1
    table = pq.read_table(out / "sensitivity.parquet")
    assert table.num_rows == len(rows)
    assert set(table.column_names) == set(rows[0])
    stored = json.loads((out / "sensitivity.json").read_text())
    largest = max(rows[1:], key=lambda row: float(row["relative_l2"]))
    assert float(largest["relative_l2"]) > 0.1
    assert stored["ranking"][0]["factor"] == largest["factor"]
    assert f"Largest effects: {largest['factor']} (" in printed
    assert rodsight("sensitivity", made_tracks, "--out", out, *SET, *factors, "--json") == 0  # from the log
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


@pytest.mark.slow
def test_two_workers_give_the_results_of_one(nominal, tmp_path):
    cases = [KAPPA, FRICTION, Case((("position_noise", 1.0),), seed=4)]
    one = run_study(nominal, cases, EffectLog(tmp_path / "one.jsonl", "x"))
    two = run_study(nominal, cases, EffectLog(tmp_path / "two.jsonl", "x"), workers=2)
    assert one == two


@pytest.mark.slow
def test_ctrl_c_ends_the_study_and_the_same_command_resumes_it(made_tracks, tmp_path, capsys):
    out = tmp_path / "out"
    command = ("sensitivity", made_tracks, "--out", out, *SET, "--factors", "kappa=0.5:2", "sweeps=0.1:2000")
    study = subprocess.Popen(
        [*REPORTING, *(str(each) for each in command), "--workers", "2"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    effect_log = out / "sensitivity_runs.jsonl"
    wait_for_report(study, DONE, 3)  # × 0.1 and κ; × 2000 would last minutes
    os.killpg(study.pid, signal.SIGINT)  # as a terminal does: the workers receive it as well
    output, errors = study.communicate(timeout=60)
    assert study.returncode == 130
    assert errors.strip().splitlines()[-1] == "rodsight: interrupted; the same command resumes from here"
    assert "Traceback" not in errors
    assert output == ""
    before = effect_log.read_text()
    assert rodsight("sensitivity", made_tracks, "--out", out, *SET, "--factors", "kappa", "--quiet") == 0
    assert effect_log.read_text() == before
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("--factors", "viscosity"), "viscosity"),
        (("--factors", "friction=2:1"), "friction=2:1"),
        (("--set", "sensitivity.ranges.friction=[1.2, 0.8]"), "sensitivity.ranges.friction"),
        (("--set", "sensitivity.ranges.friction=3"), "key sensitivity.ranges"),
        (("--set", "sensitivity.range=3"), "sensitivity.range"),
        (("--samples", "9"), "--samples: 9"),
        (("--design", "sobol", "--samples", "9"), "--samples: 9"),
        (("--workers", "0"), "--workers: 0"),
        (("--seed", "-1"), "--seed: -1"),
        (("--frames", "3:99"), "3:99"),
        (("--scheduler", "tcp://127.0.0.1:9"), "--scheduler: tcp://127.0.0.1:9"),
    ],
)
def test_a_wrong_argument_is_reported_in_one_line_and_nothing_is_written(
    arguments, named, made_tracks, tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr("rodsight.robustness.execution.SCHEDULER_TIMEOUT", 0.2)  # [s]
    out = tmp_path / "out"
    assert rodsight("sensitivity", made_tracks, "--out", out, "--quiet", *arguments) == 2
    printed = capsys.readouterr()
    assert printed.err.count("\n") == 1
    assert printed.err.startswith("rodsight: ")
    assert named in printed.err
    assert printed.out == ""
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
