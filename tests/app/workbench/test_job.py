"""A run as a child process: what it says is taken in, an interrupt pauses it, and it is told what became of it."""

import json
import sys
import threading

import pytest
from rodsight.workbench.running import job as jobs
from rodsight.workbench.running.job import Job, State

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
        if thread is not threading.current_thread() and thread.daemon and "_listen" in thread.name:
            thread.join(20)
    return job.told()


def test_progress_words_and_alarms_are_told_apart(job):
    for done in (2, 4):
        job.hear(json.dumps({"stage": "tracking", "done": done, "total": 8}))
    for line in (json.dumps({"alarm": "1 rod lost: 7", "frame": 3}), "Results in runs/test/", "", "{not json"):
        job.hear(line)
    told = job.told()
    (stage,) = told["stages"]
    assert (stage["name"], stage["done"], stage["total"]) == ("tracking", 4, 8)
    assert stage["left"] >= 0.0
    assert told["alarms"] == [{"alarm": "1 rod lost: 7", "frame": 3}]
    assert told["said"] == ["Results in runs/test/", "{not json"]


def test_nothing_is_said_of_the_time_left_before_a_step_is_done(job):
    job.hear(json.dumps({"stage": "solving", "done": 3, "total": 8}))
    assert job.told()["stages"][0]["left"] is None


def test_a_pause_asks_the_run_to_end(job, monkeypatch):
    process = begin(job, monkeypatch, PATIENT)
    assert job.told()["state"] == State.RUNNING
    while "ready" not in job.told()["said"]:
        assert process.poll() is None
    job.pause()
    assert job.told()["state"] == State.PAUSING
    assert ended(job, process)["state"] == State.PAUSED


def test_cancelling_forgets_unfinished_frames(job, monkeypatch):
    unfinished = job.results / jobs.UNFINISHED / "solving"
    unfinished.mkdir(parents=True)
    process = begin(job, monkeypatch, PATIENT)
    while "ready" not in job.told()["said"]:
        assert process.poll() is None
    job.pause(forget=True)
    assert ended(job, process)["state"] == State.IDLE
    assert not unfinished.exists()


@pytest.mark.parametrize(("status", "state"), [(0, State.FINISHED), (1, State.FAILED), (2, State.FAILED)])
def test_the_exit_status_says_what_became_of_it(job, monkeypatch, status, state):
    process = begin(job, monkeypatch, f"import sys; print('so'); sys.exit({status})")
    told = ended(job, process)
    assert (told["state"], told["said"]) == (state, ["so"])


def test_a_run_cannot_begin_while_something_is_missing(visitor):
    told = visitor.ask("begin", roll=0, name="mine")
    assert "cannot begin" in visitor.refused("run_start", at=told["at"])
    assert visitor.ask("run_told", at=told["at"])["frames"] is None
    assert "no frame" in visitor.refused("network", at=told["at"], frame=0)
