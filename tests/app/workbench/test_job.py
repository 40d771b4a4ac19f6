"""A run as a child process: its output is read, a signal pauses it, its exit status is kept."""

import json
import os
import subprocess
import sys
import threading
import time

import pytest
from rodsight.workbench.running import job as jobs
from rodsight.workbench.running.job import Job, JobState

PATIENT = """
import json, signal, sys, threading
print(json.dumps({"stage": "solving", "done": 1, "total": 4}), flush=True)
print("words for a person", flush=True)
signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
print("ready", flush=True)
threading.Event().wait(60)
"""


@pytest.fixture
def job(tmp_path):
    return Job(tmp_path, tmp_path / "test", tmp_path / "runs" / "test", tmp_path / ".rodsight")


def begin(job, monkeypatch, program):
    monkeypatch.setattr(jobs, "PROGRAM", (sys.executable, "-c", program))
    job.start()
    return job.process


def ended(job, process):
    process.wait(20)
    for thread in threading.enumerate():
        if thread is not threading.current_thread() and thread.daemon and "_read_output" in thread.name:
            thread.join(20)
    return job.as_values()


def test_progress_messages_and_alarms_are_distinguished(job):
    for done in (2, 4):
        job.read_line(json.dumps({"stage": "tracking", "done": done, "total": 8}))
    for line in (json.dumps({"alarm": "1 rod lost: 7", "frame": 3}), "Results in runs/test/", "", "{not json"):
        job.read_line(line)
    state = job.as_values()
    (stage,) = state["stages"]
    assert (stage["name"], stage["done"], stage["total"]) == ("tracking", 4, 8)
    assert stage["left"] >= 0.0
    assert state["alarms"] == [{"alarm": "1 rod lost: 7", "frame": 3}]
    assert state["messages"] == ["Results in runs/test/", "{not json"]


def test_no_time_left_is_stated_before_a_step_is_done(job):
    job.read_line(json.dumps({"stage": "solving", "done": 3, "total": 8}))
    assert job.as_values()["stages"][0]["left"] is None


def test_a_pause_ends_the_run(job, monkeypatch):
    process = begin(job, monkeypatch, PATIENT)
    assert job.as_values()["state"] == JobState.RUNNING
    while "ready" not in job.as_values()["messages"]:
        assert process.poll() is None
    job.pause()
    assert job.as_values()["state"] == JobState.PAUSING
    assert ended(job, process)["state"] == JobState.PAUSED


def test_cancelling_removes_unfinished_frames(job, monkeypatch):
    unfinished = job.results / jobs.UNFINISHED / "solving"
    unfinished.mkdir(parents=True)
    process = begin(job, monkeypatch, PATIENT)
    while "ready" not in job.as_values()["messages"]:
        assert process.poll() is None
    job.pause(discard=True)
    assert ended(job, process)["state"] == JobState.IDLE
    assert not unfinished.exists()


@pytest.mark.parametrize(("status", "state"), [(0, JobState.FINISHED), (1, JobState.FAILED), (2, JobState.FAILED)])
def test_the_exit_status_decides_between_finished_and_failed(job, monkeypatch, status, state):
    process = begin(job, monkeypatch, f"import sys; print('so'); sys.exit({status})")
    values = ended(job, process)
    assert (values["state"], values["messages"]) == (state, ["so"])


def test_a_run_cannot_begin_while_something_is_missing(visitor):
    at = visitor.request("begin", folder="my photographs/pictures", suffix=".jpg", name="mine")["at"]
    assert "cannot begin" in visitor.refused("run_start", at=at)
    assert visitor.request("run_state", at=at)["frames"] is None
    assert "no frame" in visitor.refused("network", at=at, frame=0)


SERVER = """
import sys, time
from pathlib import Path
from rodsight.workbench.running import job as jobs
jobs.PROGRAM = (sys.executable, "-c", sys.argv[2])
root = Path(sys.argv[1])
job = jobs.Job(root, root / "test", root / "runs" / "test", root / ".rodsight")
job.start()
while "ready" not in job.as_values()["messages"]:
    time.sleep(0.05)
print("started", flush=True)
time.sleep(60)
"""
TALKING = """
import json, signal, sys, time
signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
print("ready", flush=True)
for done in range(600):
    print(json.dumps({"stage": "solving", "done": done, "total": 600}), flush=True)
    time.sleep(0.1)
"""


@pytest.fixture
def orphan(job):
    """A run whose server was killed while it was writing."""
    server = subprocess.Popen(
        [sys.executable, "-c", SERVER, str(job.root), TALKING], stdout=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )  # fmt: skip
    with server:
        assert server.stdout is not None
        assert server.stdout.readline() == "started\n"
        server.kill()
    yield job
    job.close()


def wait_until(test):
    patience = time.monotonic() + 30.0
    while not test():
        assert time.monotonic() < patience
        time.sleep(0.05)


@pytest.mark.thorough
def test_a_run_outlives_its_server_and_is_found_again(orphan):
    log = orphan.place / jobs.OUTPUT
    size = log.stat().st_size
    wait_until(lambda: log.stat().st_size > size)  # it writes without its server
    orphan.find()
    assert orphan.as_values()["state"] == JobState.RUNNING
    assert "ready" in orphan.as_values()["messages"] or not orphan.as_values()["messages"]
    wait_until(lambda: orphan.as_values()["stages"])
    before = orphan.as_values()["stages"][0]["done"]
    wait_until(lambda: orphan.as_values()["stages"][0]["done"] > before)
    orphan.start()  # one run at a time
    assert orphan.process is None
    orphan.pause()
    wait_until(lambda: orphan.as_values()["state"] == JobState.PAUSED)
    assert not orphan.is_running
    orphan.find()
    assert not orphan.is_running


def test_a_process_that_is_no_run_is_left_alone(job):
    job.place.mkdir()
    others = {"process": os.getpid(), "began": "1", "host": "elsewhere", "boot": "x", "container": "y"}
    for stored in (b"", b"[]", b"{}", json.dumps(others).encode(), json.dumps(others | {"results": 3}).encode()):
        (job.place / jobs.PROCESS).write_bytes(stored)
        job.find()
        assert not job.is_running


def test_the_status_that_a_run_has_written_counts_where_it_is_no_child(job):
    job.read_line(json.dumps({"exit": 0}))
    job._read_output(None)
    assert job.as_values()["state"] == JobState.FINISHED
