"""A folder is held by one process, also across containers and machines, and never taken from a living one."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from dataclasses import asdict, replace
from pathlib import Path

import pytest
from rodsight.process import lock as locks
from rodsight.process.errors import RunError
from rodsight.process.lock import LEASE, LOCK, Holder, hold_folder

HOLDING = """
import sys
from pathlib import Path
from rodsight.process.lock import hold_folder
with hold_folder(Path(sys.argv[1]), print):
    print("held", flush=True)
    sys.stdin.read()
"""
NOWHERE = 2**22 + 1  # above the greatest number of a process


def left(folder: Path, silence: float, **changes: str) -> None:
    """Leave the lock of a process of another machine or container, last renewed so many seconds ago."""
    holder = replace(Holder.this(), process=NOWHERE, **changes)
    (folder / LOCK).write_text(json.dumps(asdict(holder)))
    now = (folder / LOCK).stat().st_mtime
    os.utime(folder / LOCK, (now - silence,) * 2)


@pytest.fixture
def holder(tmp_path):
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDING, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "held\n"
    yield process
    process.kill()
    process.communicate()


@pytest.mark.parametrize("written", ["another container", "nothing", "a dead process"])
def test_a_living_process_keeps_its_folder_whatever_can_be_looked_up(tmp_path, holder, written):
    stored = json.loads((tmp_path / LOCK).read_text())
    content = {
        "another container": json.dumps(stored | {"container": "another", "process": 1}),
        "nothing": "",
        "a dead process": json.dumps(stored | {"process": NOWHERE}),
    }[written]
    (tmp_path / LOCK).write_text(content)
    os.utime(tmp_path / LOCK, (0.0, 0.0))
    with (
        pytest.raises(RunError, match="works in it; wait for it, or choose another --out"),
        hold_folder(tmp_path, print),
    ):
        pass


def test_a_killed_process_leaves_a_folder_that_is_taken_over_at_once(tmp_path, holder):
    holder.kill()
    holder.wait()
    notes: list[str] = []
    with hold_folder(tmp_path, notes.append):
        pass
    assert len(notes) == 1


@pytest.mark.parametrize("place", [{"container": "another"}, {"boot": "another"}, {"boot": "another", "host": "far"}])
def test_a_lock_that_cannot_be_looked_up_holds_as_long_as_its_lease(tmp_path, place):
    left(tmp_path, LEASE - 30.0, **place)
    with pytest.raises(RunError, match=r"cannot be checked from here; .* delete"), hold_folder(tmp_path, print):
        pass
    left(tmp_path, LEASE + 30.0, **place)
    notes: list[str] = []
    with hold_folder(tmp_path, notes.append):
        assert json.loads((tmp_path / LOCK).read_text())["process"] == os.getpid()
    assert len(notes) == 1
    assert not list(tmp_path.iterdir())


def is_renewed(lock: Path) -> bool:
    """Whether the holder of a lock renews its lease within two seconds."""
    os.utime(lock, (0.0, 0.0))
    for _ in range(200):
        if lock.stat().st_mtime > 0.0:
            break
        locks.threading.Event().wait(0.01)
    return lock.stat().st_mtime > 0.0


def test_the_lease_is_renewed_while_the_folder_is_held(tmp_path, monkeypatch):
    monkeypatch.setattr(locks, "RENEWAL", 0.01)
    with hold_folder(tmp_path, print):
        assert is_renewed(tmp_path / LOCK)


def test_a_process_that_was_suspended_for_longer_than_its_lease_ends_and_leaves_the_new_lock(tmp_path, monkeypatch):
    monkeypatch.setattr(locks, "RENEWAL", 0.01)

    def lose_it() -> None:
        with hold_folder(tmp_path, print):
            left(tmp_path, 0.0, boot="another", host="far")
            for _ in range(2000):
                locks.threading.Event().wait(0.01)
            pytest.fail("nothing interrupted this block")

    with pytest.raises(RunError, match="took it over while this one was suspended"):
        lose_it()
    assert json.loads((tmp_path / LOCK).read_text())["host"] == "far"


def test_a_start_that_another_thread_reads_otherwise_is_no_other_process(tmp_path, monkeypatch):
    monkeypatch.setattr(locks, "RENEWAL", 0.01)
    this = locks.threading.get_ident()  # QEMU, which runs programs of other processors, gives each thread its own start
    monkeypatch.setattr(locks, "_start_time", lambda _: str(locks.threading.get_ident() == this))
    with hold_folder(tmp_path, print):
        assert is_renewed(tmp_path / LOCK)


def test_a_process_holds_a_folder_once(tmp_path):
    with (
        hold_folder(tmp_path, print),
        pytest.raises(RunError, match=f"process {os.getpid()} works in it"),
        hold_folder(tmp_path, print),
    ):
        pass


def test_a_process_that_has_ended_does_not_live_although_its_status_was_not_read():
    process = subprocess.Popen([sys.executable, "-c", "import sys; sys.stdin.read()"], stdin=subprocess.PIPE)
    assert process.stdin is not None
    holder = Holder.of(process.pid)
    assert holder.is_alive
    process.stdin.close()
    os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)  # ended, and still listed
    assert not holder.is_alive
    process.wait()


def test_a_number_that_is_used_again_is_another_process(tmp_path):
    assert Holder.this().is_alive
    assert not replace(Holder.this(), began="0").is_alive


def test_a_folder_that_was_made_for_nothing_is_removed(tmp_path):
    with hold_folder(tmp_path / "runs" / "test", print):
        pass
    assert list(tmp_path.iterdir()) == []
    with hold_folder(tmp_path / "runs" / "test", print):
        (tmp_path / "runs" / "test" / "results").touch()
    assert (tmp_path / "runs" / "test" / "results").exists()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes do not fork here")
def test_a_child_that_outlives_its_parent_does_not_hold_its_folder(tmp_path):
    in_child = "if os.fork() == 0:\n        print(os.getpid(), flush=True)\n    sys.stdin.read()"
    forking = HOLDING.replace("sys.stdin.read()", in_child)
    process = subprocess.Popen(
        [sys.executable, "-c", f"import os\n{forking}", str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        text=True,
    )  # fmt: skip
    assert process.stdout is not None
    assert process.stdout.readline() == "held\n"
    child = int(process.stdout.readline())
    process.kill()
    process.wait()
    try:
        notes: list[str] = []
        with hold_folder(tmp_path, notes.append):
            pass
        assert len(notes) == 1
    finally:
        os.kill(child, signal.SIGKILL)
        process.communicate()
