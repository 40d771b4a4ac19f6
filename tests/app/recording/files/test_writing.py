"""A disk that refuses a recording, or does not respond, raises an error in time."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
import threading
from collections import namedtuple
from collections.abc import Iterator
from pathlib import Path

import pytest
from rodsight.process.errors import RunError
from rodsight.recording.files import writing
from rodsight.recording.files.finished_run import write_recording

from tests.program import RODSIGHT, rodsight

FEW = ("--set", "solver.estimator=nlgs", "--set", "solver.sweeps=200", "--quiet")


@pytest.mark.parametrize("taken", [0, 1, 3])
def test_a_full_disk_is_reported_and_the_older_recording_kept(results, tmp_path, monkeypatch, taken):
    file = tmp_path / "recording.rrd"
    file.write_bytes(b"older")
    write_all, done = writing.write_all, []

    def filling(target: int, content: bytes) -> None:
        if len(done) == taken:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        done.append(write_all(target, content))

    monkeypatch.setattr(writing, "write_all", filling)
    with pytest.raises(OSError, match="No space left") as raised:
        write_recording(results, file)
    assert raised.value.filename == str(file)
    assert [each.name for each in tmp_path.iterdir()] == [file.name]
    assert file.read_bytes() == b"older"


def test_an_unresponsive_disk_raises_at_the_deadline(results, tmp_path, monkeypatch):
    answer = threading.Event()
    monkeypatch.setattr(writing, "write_all", lambda *_: answer.wait())
    monkeypatch.setattr(writing, "DEADLINE", 0.2)
    try:
        with pytest.raises(OSError, match="nothing could be written for") as raised:
            write_recording(results, tmp_path / "recording.rrd")
        assert raised.value.errno == errno.ETIMEDOUT
    finally:
        answer.set()


def test_free_space_is_checked_before_anything_is_written(results, tmp_path, monkeypatch):
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage(10**9, 10**9 - 1000, 1000))
    with pytest.raises(RunError, match=r"0\.001 MB free, and the recording needs more than"):
        write_recording(results, tmp_path / "recording.rrd")
    assert not any(tmp_path.iterdir())


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    place = tmp_path / "disk"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(place)]
    if shutil.which("mount") is None or subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("a disk cannot be mounted: that needs root")
    yield place
    subprocess.run(["umount", "--lazy", str(place)], check=True)


@pytest.mark.thorough
def test_a_full_disk_prevents_the_recording_and_nothing_else(tracked, tmp_path, small_disk):
    out = tmp_path / "out"
    assert rodsight("solve", tracked, "--out", out, *FEW) == 0
    for name in ("results.h5", "manifest.json"):
        shutil.copy2(out / name, small_disk)
    left = shutil.disk_usage(small_disk).free
    (small_disk / "others").write_bytes(bytes(left - 300_000))
    run = subprocess.run(
        [*RODSIGHT, "record", tracked, "--out", small_disk, *FEW], capture_output=True, text=True, timeout=120
    )
    assert run.returncode == 1, run.stderr
    assert "recording.rrd: No space left on device" in run.stderr
    assert run.stderr.splitlines()[-1].startswith("rodsight: ")
    assert sorted(each.name for each in small_disk.iterdir()) == ["manifest.json", "others", "results.h5"]
