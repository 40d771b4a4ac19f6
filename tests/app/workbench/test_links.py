"""Links in the program's own folders, which may come with the folder of somebody else, lead it nowhere."""

from __future__ import annotations

import itertools
import json
import os
import shutil
import subprocess
import sys
import threading
from dataclasses import asdict
from pathlib import Path

import pytest
from rodsight.experiment.experiment import load_experiment
from rodsight.process.atomic import write_atomically
from rodsight.process.errors import InputError
from rodsight.process.lock import LOCK, Holder, hold_folder
from rodsight.run_folder import Run, hold_run
from rodsight.workbench.running.job import OUTPUT, PROCESS, Job
from rodsight.workbench.service.workbench import Workbench
from rodsight.workbench.setup.journal import PLACE

from .conftest import Visitor

OWN = (  # in the experiment's folder, and in that of its run
    f"{PLACE}/run.log", f"{PLACE}/journal.jsonl", f"{PLACE}/contents/", f"{PLACE}/", "run/.lock", "run/failures.log",
    "run/verdicts.jsonl", "run/results.h5", "run/summary.json", "run/recording.rrd", "run/.unfinished/",
    "run/.unfinished/solving/", "run/.tracked/", "run/",
)  # fmt: skip


@pytest.fixture
def root(tracked: Path, tmp_path: Path) -> Path:
    (tmp_path / "root").mkdir()
    shutil.move(tracked, tmp_path / "root" / "tracked")
    (tmp_path / "outside").mkdir()
    (tmp_path / "outside" / "file").write_text("of somebody else")
    return tmp_path / "root"


@pytest.mark.parametrize("name", OWN)
def test_the_workbench_follows_no_link_in_its_own_folders_to_the_outside(root, name):
    folder = root / "runs" / "tracked" if name.startswith("run/") else root / "tracked"
    place = folder / name.removeprefix("run/").rstrip("/")
    place = folder if name == "run/" else place
    place.parent.mkdir(parents=True, exist_ok=True)
    place.symlink_to(root.parent / "outside" / ("" if name.endswith("/") else "file"))
    visitor = Visitor(Workbench(root)).enter()
    for endpoint in ("run_start", "run_cancel", "project", "undo", "share"):
        assert "leads outside" in visitor.refused(endpoint, at="tracked")
    (listed,) = visitor.request("home")["experiments"]
    assert "leads outside" in listed["error"]
    assert [each.name for each in (root.parent / "outside").iterdir()] == ["file"]
    assert (root.parent / "outside" / "file").read_text() == "of somebody else"


def test_a_link_inside_the_root_is_followed(root):
    (root / "disk").mkdir()
    (root / "runs").symlink_to(root / "disk")
    assert Visitor(Workbench(root)).enter().request("project", at="tracked")["ready"]


@pytest.mark.parametrize("name", [LOCK, ".unfinished", ".tracked"])
def test_a_run_neither_empties_nor_overwrites_what_a_link_leads_to(root, name):
    folder, outside = root / "runs" / "tracked", root.parent / "outside"
    folder.mkdir(parents=True)
    (folder / name).symlink_to(outside / "file" if name == LOCK else outside)
    with pytest.raises(InputError, match="is a link"), hold_run(Run(load_experiment(root / "tracked"), folder)):
        pass
    if name == LOCK:
        with pytest.raises(InputError, match="is a link"), hold_folder(folder, print):
            pass
    assert (outside / "file").read_text() == "of somebody else"


def test_a_file_is_not_written_through_a_link_in_the_place_of_its_part(root):
    outside = root.parent / "outside" / "file"
    (root / "new.csv.part").symlink_to(outside)
    write_atomically(root / "new.csv", b"x")
    assert outside.read_text() == "of somebody else"
    assert (root / "new.csv").read_bytes() == b"x"


def test_a_log_under_a_second_name_keeps_its_content(root, monkeypatch):
    place, outside = root / "tracked" / PLACE, root.parent / "outside" / "file"
    place.mkdir()
    os.link(outside, place / OUTPUT)
    job = Job(root, root / "tracked", root / "runs" / "tracked", place)
    job.start("--no-such-option")
    job.close()
    assert outside.read_text() == "of somebody else"


@pytest.mark.parametrize("is_run", [False, True])
def test_only_a_run_is_found_and_ended_and_no_other_process_that_a_file_names(root, is_run, monkeypatch):
    """The file may come with the folder, and name any process of this user."""
    calls, polled, is_alive = itertools.count(), threading.Event(), Job._is_alive

    def counted(job, process):
        if next(calls) > 1:
            polled.set()
        return is_alive(job, process)

    monkeypatch.setattr(Job, "_is_alive", counted)
    place, results = root / "tracked" / PLACE, root / "runs" / "tracked"
    place.mkdir()
    marks = ("run" if is_run else "look", str(root / "tracked"), "--out", str(results))
    process = subprocess.Popen(
        [sys.executable, "-c", "import sys; print(flush=True); sys.stdin.read()", *marks],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE,
    )  # fmt: skip
    try:
        assert process.stdout is not None
        process.stdout.readline()  # until it has begun, the system may not name its command
        stored = asdict(Holder.of(process.pid)) | {"results": str(results)}
        (place / PROCESS).write_text(json.dumps(stored))
        job = Job(root, root / "tracked", results, place)
        job.find()
        if is_run:
            assert polled.wait(30.0)  # its log is missing, which is found out beside
        assert job.is_running == is_run
        if not is_run:
            job.close()
            assert process.poll() is None
    finally:
        process.kill()
        process.communicate()
