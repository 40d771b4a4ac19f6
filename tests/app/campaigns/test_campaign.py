"""A table of experiments and settings is converted to runs, a catalogue and joint tables."""

from __future__ import annotations

import json
import os
import shutil
import signal
import sys
import time
from pathlib import Path

import pandas as pd
import pytest
import rodsight
from rodsight.campaigns.collect import collect
from rodsight.campaigns.plan import Case, read_plan
from rodsight.campaigns.report import write_report
from rodsight.campaigns.task import Outcome, run_case
from rodsight.campaigns.workers import COMMAND, run_cases, run_in_processes

from tests.program import rodsight as command

HEAD = "experiment,name,frames,material.friction,solver.sweeps"


def write_table(folder: Path) -> Path:
    """Three runs of one small experiment, one of which cannot be solved."""
    file = folder / "plan.csv"
    file.write_text(f"{HEAD}\ntracked,as it is,0:3,,20\ntracked,,,0.3,20\ntracked,beyond,0:99,,20\n")
    return file


@pytest.fixture
def table(tracked: Path) -> Path:
    return write_table(tracked.parent)


@pytest.fixture(scope="module")
def done(made_tracks: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Case], list[Outcome]]:
    folder = tmp_path_factory.mktemp("campaign") / "all"
    shutil.copytree(made_tracks, folder.parent / "tracked")
    cases = read_plan(write_table(folder.parent), record=False)
    return folder, cases, [run_case(case, str(folder)) for case in cases]


def test_rows_become_runs_with_unique_names(table, tracked):
    cases = read_plan(table)
    assert [case.name for case in cases] == ["as_it_is", "tracked-friction=0.3-sweeps=20", "beyond"]
    assert cases[0].frames == (0, 3, 1)
    assert cases[1].settings == ("material.friction=0.3", "solver.sweeps=20")
    assert Path(cases[1].experiment) == tracked.resolve()
    assert Case.of_plain(json.loads(json.dumps(cases[0].as_plain()))) == cases[0]


def test_a_pattern_selects_every_folder_with_an_experiment(table, tracked):
    (tracked.parent / "no_experiment").mkdir()
    table.write_text("experiment\n*\n*\n")
    assert [case.name for case in read_plan(table)] == ["tracked", "tracked-2"]


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("folder\ntracked\n", "row 1: must name columns"),
        (f"{HEAD}\n", "has no rows"),
        (f"{HEAD}\ntracked,,,0.3\n", "row 2: has 4 cells, not 5"),
        (f"{HEAD}\nelsewhere,,,,\n", "elsewhere: there is no such file"),
        (f"{HEAD}\nnothing*,,,,\n", "row 2, experiment = 'nothing*': matches no folder"),
        (f"{HEAD}\ntracked,,,25,\n", "row 2: "),
        (f"{HEAD}\ntracked,,3,,\n", "row 2, frames = '3': is not A:B"),
        ("experiment,material.frition\ntracked,0.3\n", "did you mean material.friction"),
    ],
)
def test_an_error_in_the_table_is_named_before_any_run(text, named, table, tmp_path, capsys):
    table.write_text(text)
    assert command("campaign", table, "--out", tmp_path / "all", "--quiet") == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert named in message
    assert not (tmp_path / "all").exists()


@pytest.mark.slow
def test_all_runs_are_collected_in_joint_tables(done):
    folder, cases, outcomes = done
    rows = collect(folder, cases, outcomes)
    assert [row["state"] for row in rows] == ["done", "done", "failed"]
    assert "0:99" in rows[2]["error"]
    contacts = pd.read_parquet(folder / "contacts.parquet")
    assert list(contacts["run"].unique()) == [case.name for case in cases[:2]]
    for case in cases[:2]:
        own = rodsight.open(folder / case.name).contacts()
        joint = contacts[contacts["run"] == case.name].drop(columns="run").reset_index(drop=True)
        pd.testing.assert_frame_equal(joint, own, check_dtype=False)
    frames = pd.read_parquet(folder / "frames.parquet")
    assert frames.groupby("run", sort=False).size().tolist() == [3, 5]
    catalogue = pd.read_csv(folder / "catalogue.csv")
    assert catalogue["material.friction"].tolist()[1] == 0.3
    page = write_report(folder, rows).read_text()
    assert 'class="failed"' in page
    assert page.count("<svg") == 3  # friction angle and trust over frames, and results over the coefficient of friction


@pytest.mark.thorough
def test_finished_runs_are_reused(done):
    folder, cases, outcomes = done
    before = (folder / cases[0].name / "results.h5").stat().st_mtime_ns
    again = run_case(cases[0], str(folder))
    assert again.reused
    assert not outcomes[0].reused
    assert (folder / cases[0].name / "results.h5").stat().st_mtime_ns == before


# Dies at the first attempt at the run "unlucky".
DYING = """
import json, os, signal, sys
from pathlib import Path
request = json.loads(sys.argv[1])
name, mark = request["case"]["name"], Path(request["folder"]) / "tried"
if name == "unlucky" and not mark.exists():
    mark.touch()
    os.kill(os.getpid(), signal.SIGKILL)
print(json.dumps({"name": name}))
"""


def test_a_lost_process_affects_only_its_own_run(tmp_path):
    cases = [Case(name, "nowhere") for name in ("lucky", "unlucky", "other")]
    outcomes = list(run_in_processes(cases, tmp_path, workers=2, command=(sys.executable, "-c", DYING)))
    assert sorted(each.name for each in outcomes) == ["lucky", "other", "unlucky"]
    assert not any(each.error for each in outcomes)


def test_a_run_whose_process_always_ends_fails_with_its_status(tmp_path):
    ending = (sys.executable, "-c", "import sys; sys.exit(3)")
    (outcome,) = run_in_processes([Case("bad", "nowhere")], tmp_path, workers=1, command=ending)
    assert "ended with status 3" in outcome.error


@pytest.mark.slow
def test_one_of_two_working_processes_is_killed_and_all_runs_end(table, tmp_path):
    """The first process that has a folder is killed."""
    cases = read_plan(table, record=False)[:2]
    mark = tmp_path / "killed"
    killer = (
        f"import os, signal, sys, threading, time\nfrom pathlib import Path\nmark = Path({str(mark)!r})\n"
        "def kill():\n    while not list(Path(sys.argv[1] and __import__('json').loads(sys.argv[1])['folder']).rglob("
        "'.unfinished')):\n        time.sleep(0.01)\n"
        "    if not mark.exists():\n        mark.touch()\n        os.kill(os.getpid(), signal.SIGKILL)\n"
        "threading.Thread(target=kill, daemon=True).start()\n"
    )
    outcomes = list(run_in_processes(cases, tmp_path / "all", workers=2, command=(*COMMAND[:2], killer + COMMAND[2])))
    assert mark.exists()
    assert [each.error for each in outcomes] == ["", ""]


@pytest.mark.slow
def test_a_worker_of_a_cluster_is_killed_and_all_runs_end(table, tmp_path):
    distributed = pytest.importorskip("dask.distributed", reason="needs the extra cluster")
    cases = read_plan(table, record=False)[:2]
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, protocol="tcp", host="127.0.0.1"
    ) as cluster:
        running = run_cases(cases, tmp_path / "all", workers=1, scheduler=cluster.scheduler_address)
        victim = next(iter(cluster.workers.values())).pid
        killed = False
        outcomes = []
        for outcome in running:
            outcomes.append(outcome)
            if not killed:
                os.kill(victim, signal.SIGKILL)
                killed = True
                time.sleep(0.1)
    assert sorted(each.name for each in outcomes) == sorted(case.name for case in cases)
    assert not any(each.error for each in outcomes)
