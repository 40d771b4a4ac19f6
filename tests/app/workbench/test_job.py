"""A run as a child process: its output is read, a signal pauses it, its exit status is kept."""

import json
import sys
import threading

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
    return Job(tmp_path, tmp_path / "test", tmp_path / "runs" / "test")


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
