from __future__ import annotations

import errno
import os
import re
import signal
import socket
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from rodsight.cli.main import main
from rodsight.recording.archive.readback import read_forces
from rodsight.recording.archive.repair import repair_recording
from rodsight.recording.files.live import LiveRecording
from rodsight.recording.files.live_process import LiveProcess, _MessageQueue

from tests.app.recording.fake_results import make_results
from tests.browser import forces_drawn, open_when_served, picture_of, wait_for_colour, wait_for_forces
from tests.program import REPORTING, SENT, wait_for_report

CANVAS = (13, 14, 18)  # background of a packing


def before(results):
    return replace(results, frames=(), statistics=())


@pytest.mark.thorough
def test_the_file_of_a_live_recording_is_complete(results, tmp_path):
    live = LiveRecording(tmp_path / "live.rrd", "none")
    live.start(before(results))
    for forces, statistics in zip(results.frames, results.statistics, strict=True):
        live.frame(forces, statistics)
    live.finish()
    live.close()
    found = read_forces(live.path)
    assert all(np.array_equal(found[forces.frame].fn, forces.fn) for forces in results.frames)
    assert live.notes == []
    # The file must be complete although the frames are written one by one.
    assert repair_recording(live.path, tmp_path / "again.rrd").frames == len(results.frames)


@pytest.mark.thorough
def test_every_finished_frame_is_in_the_file_before_the_next_begins(tmp_path):
    results = make_results(3, sweeps=20)
    live = LiveRecording(tmp_path / "live.rrd", "none")
    live.start(before(results))
    try:
        for count, (forces, statistics) in enumerate(zip(results.frames, results.statistics, strict=True), 1):
            live.frame(forces, statistics)
            copy = tmp_path / f"copy{count}.rrd"
            copy.write_bytes(live.path.read_bytes())  # as after a crash of the machine
            assert repair_recording(copy, tmp_path / f"repaired{count}.rrd").frames == count
    finally:
        live.close()


def test_requests_from_outside_this_machine_are_refused(results, tmp_path):
    live = LiveRecording(tmp_path / "live.rrd", "web")
    live.start(before(results))
    try:
        port = int(live.address.rsplit(":", 1)[1].split("/")[0])
        with socket.create_connection(("127.0.0.1", port), timeout=5):
            pass
        with pytest.raises(OSError, match=r"refused|unreachable|timed out|assign"):
            socket.create_connection((other_address(), port), timeout=2).close()
    finally:
        live.close()


def other_address() -> str:
    """Return another address of the loopback network, on which 0.0.0.0 would listen."""
    return "127.0.0.2"


def test_without_a_display_only_a_hint_is_given(results, tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    live = LiveRecording(tmp_path / "live.rrd", "native")
    live.start(before(results))
    live.close()
    assert "--view web" in live.hint


@pytest.mark.screen
def test_a_watched_run_ends_with_the_full_recording_only(tracked, tmp_path, capsys):
    out = tmp_path / "out"
    with pytest.raises(SystemExit) as end:
        main(["run", str(tracked), "--out", str(out), "--view", "web", "--set", "solver.sweeps=50"])
    assert not end.value.code
    output = capsys.readouterr().out
    assert "ssh -L" in output
    assert "http://127.0.0.1:" in output
    assert sorted(file.name for file in out.glob("*.rrd")) == ["recording.rrd"]
    assert len(read_forces(out / "recording.rrd")) == 5


@pytest.mark.slow
def test_the_recording_of_another_process_is_complete(results, tmp_path):
    messages: list[str] = []
    live = LiveProcess(tmp_path / "live.rrd", messages.append, viewer="web")
    live.start(before(results))
    for forces, statistics in zip(results.frames, results.statistics, strict=True):
        live.frame(forces, statistics)
    live.close(complete=True)
    found = read_forces(live.path)
    assert all(np.array_equal(found[forces.frame].fn, forces.fn) for forces in results.frames)
    assert ["Watch it at" in sentence for sentence in messages] == [True]
    assert not any(answers(port) for port in ports_of(messages[0]))


def test_a_killed_live_process_does_not_affect_the_run(results, tmp_path):
    messages: list[str] = []
    live = LiveProcess(tmp_path / "live.rrd", messages.append)
    live.start(before(results))
    live._process.kill()
    for forces, statistics in zip(results.frames, results.statistics, strict=True):
        live.frame(forces, statistics)
    live.close(complete=True)
    assert messages == ["The live view broke off, without harm to the run."]


@pytest.mark.thorough
def test_without_disk_space_for_waiting_frames_the_view_ends_and_the_run_continues(results, tmp_path, monkeypatch):
    messages: list[str] = []
    live = LiveProcess(tmp_path / "live.rrd", messages.append)
    live.start(replace(results, frames=(), statistics=()))

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(_MessageQueue, "put", full)
    live.frame(results.frames[0], results.statistics[0])
    live.close(complete=False)
    assert messages[0] == "The live view ends here, without harm to the run: No space left on device."


def test_a_run_that_solves_nothing_leaves_no_process_and_no_recording(tmp_path):
    messages: list[str] = []
    live = LiveProcess(tmp_path / "live.rrd", messages.append, viewer="web")
    live.close(complete=True)
    assert live._process.returncode is not None
    assert messages == []
    assert not live.path.exists()


@pytest.mark.screen
@pytest.mark.parametrize(
    "number",
    [signal.SIGKILL, *(pytest.param(each, marks=pytest.mark.slow) for each in (signal.SIGINT, signal.SIGTERM))],
    ids=lambda number: number.name,
)  # fmt: skip
def test_a_run_that_is_stopped_leaves_a_recording_that_opens_and_no_server(tracked, tmp_path, number):
    out = tmp_path / "out"
    command = [*REPORTING, "run", str(tracked), "--out", str(out), "--view", "web", "--set", "solver.sweeps=20000"]
    run = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)
    assert run.stdout is not None
    ports = ports_of(run.stdout.readline())
    wait_for_report(run, SENT, 2)  # frames not yet sent are lost if the run is killed
    os.killpg(run.pid, number)  # as a terminal does: all its processes
    output, errors = run.communicate(timeout=60)  # ends only if the processes of its servers have closed these pipes
    assert len(ports) == 1
    assert not any(answers(port) for port in ports)
    assert len(read_forces(out / "recording-live.rrd")) >= 2
    assert not (out / "recording.rrd").exists()
    if number == signal.SIGKILL:
        assert run.returncode == -signal.SIGKILL, errors
    else:
        assert run.returncode == 128 + number, errors
        assert "The frames solved so far" in output


def ports_of(hint: str) -> list[int]:
    return [int(port) for port in re.findall(r"-L (\d+):", hint)]


def answers(port: int) -> bool:
    try:
        socket.create_connection(("127.0.0.1", port), timeout=5).close()
    except OSError:
        return False
    return True


@pytest.mark.slow
@pytest.mark.screen
def test_the_live_page_draws_the_forces_as_they_come(results, tmp_path, page):
    live = LiveRecording(tmp_path / "live.rrd", "web")
    live.start(before(results))
    try:
        page.emulate_media(color_scheme="light")  # so that only a view is dark
        open_when_served(page, f"{live.address}&renderer=webgl")
        wait_for_colour(page, np.array([300, 400]), CANVAS, least=2000, reach=25)
        assert not forces_drawn(picture_of(page))  # no frame is solved yet
        for forces, statistics in zip(results.frames, results.statistics, strict=True):
            live.frame(forces, statistics)
        wait_for_forces(page)
    finally:
        live.close()
