"""The server of recordings: its first address opens once, its page's file goes with its process."""

from __future__ import annotations

import http.client
import os
import signal
import stat
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from rodsight.recording.viewing import recording_server
from rodsight.recording.viewing.recording_server import RecordingServer


@pytest.fixture
def server(tmp_path: Path) -> Iterator[RecordingServer]:
    file = tmp_path / "recording.rrd"
    file.write_bytes(b"a recording")
    server = RecordingServer([file])
    yield server
    server.close()


def get(server: RecordingServer, path: str, **headers: str) -> tuple[int, http.client.HTTPMessage, str]:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=20)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    content = answer.status, answer.headers, answer.read().decode()
    connection.close()
    return content


def test_the_token_opens_one_browser_which_may_come_again(server):
    path = f"/?token={server.gate.token}"
    status, headers, _ = get(server, path)
    assert status == 303
    cookie = headers["Set-Cookie"].split(";")[0]
    status, headers, sentence = get(server, path)
    assert (status, headers["Set-Cookie"]) == (403, None)
    assert "opens once" in sentence
    assert get(server, path, Cookie=cookie)[0] == 303
    assert get(server, "/", Cookie=cookie)[0] == 200


BROWSER = """#!/bin/sh
echo "$1" > "$PLACE"
"""


@pytest.mark.skipif(sys.platform == "win32", reason="the stand-in for a browser is a shell script")
def test_a_server_process_opens_its_page_by_a_file_that_ends_with_it(tmp_path, monkeypatch):
    browser, place, recording = tmp_path / "browser", tmp_path / "place", tmp_path / "recording.rrd"
    browser.write_text(BROWSER)
    browser.chmod(0o700)
    recording.write_bytes(b"")
    for name, value in {"BROWSER": str(browser), "PLACE": str(place), "TMPDIR": str(tmp_path)}.items():
        monkeypatch.setenv(name, value)
    started: list[subprocess.Popen] = []
    begin = subprocess.Popen
    monkeypatch.setattr(
        recording_server.subprocess, "Popen", lambda *a, **k: started.append(begin(*a, **k)) or started[-1]
    )
    address = recording_server.start_server_process([recording], browser=True)
    (process,) = started
    try:
        patience = time.monotonic() + 30.0
        while not (place.exists() and place.read_text().strip()) and time.monotonic() < patience:
            time.sleep(0.05)
        file = Path(place.read_text().strip().removeprefix("file://"))
        assert address in file.read_text()
        assert stat.S_IMODE(file.stat().st_mode) == 0o600
        if Path("/proc/self/cmdline").exists():
            assert address.rpartition("=")[2].encode() not in Path(f"/proc/{process.pid}/cmdline").read_bytes()
    finally:
        process.send_signal(signal.SIGTERM)
        process.wait(20)
    assert not file.exists()
    assert not os.path.exists(file.parent)
