from __future__ import annotations

import glob
import socket
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rodsight.recording.files.recorder import record
from rodsight.recording.look.texts import _ALIKE, _RANGES, _SIGNS, printable
from rodsight.recording.tabs.blueprint import Tab
from rodsight.recording.viewing import viewer
from rodsight.recording.viewing.viewer import open_viewer, view_command

SECONDS = 60.0  # a viewer that draws in software on a busy machine


def test_the_command_names_the_viewer_of_the_installed_wheel(tmp_path):
    command = view_command(tmp_path / "run.rrd")
    assert command == [str(viewer.viewer_binary()), str(tmp_path / "run.rrd")]
    assert viewer.viewer_binary().is_file()
    web = view_command(tmp_path / "run.rrd", web=True)
    assert web[1:4] == ["--web-viewer", "--bind", "127.0.0.1"]


def test_the_viewer_knows_the_options_that_are_used():
    known = subprocess.run([viewer.viewer_binary(), "--help"], capture_output=True, text=True, timeout=60).stdout
    assert "--web-viewer" in known
    assert "--bind" in known


def test_without_a_display_one_line_says_how_to_look(recording, monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    hint = open_viewer(recording.path, "native")
    assert hint is not None
    assert "--web" in hint
    assert "\n" not in hint


def test_with_a_display_the_native_viewer_is_started(recording, monkeypatch):
    started = []
    monkeypatch.setenv("DISPLAY", ":7")
    monkeypatch.setattr(subprocess, "Popen", lambda command, **_: started.append(command))
    assert open_viewer(recording.path, "native") is None
    assert started == [view_command(recording.path)]


def test_no_viewer_is_started_when_none_is_asked_for(recording, monkeypatch):
    monkeypatch.setattr(subprocess, "Popen", lambda *_, **__: pytest.fail("a viewer was started"))
    assert "rodsight view" in str(open_viewer(recording.path, "none"))


def test_a_missing_recording_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"nowhere\.rrd"):
        open_viewer(tmp_path / "nowhere.rrd")


def test_the_viewer_draws_the_forces_and_every_printable_character(results, tmp_path):
    characters = "".join(chr(code) for low, high in _RANGES for code in range(low, high + 1))
    characters += "".join(sorted(_SIGNS - {"\n"})) + "".join(_ALIKE.values())
    assert printable(characters) == characters
    named = replace(results, name="all", configuration=characters)
    frames = [replace(forces, reason=characters) for forces in results.frames]
    named = replace(named, frames=frames)
    forces, summary = (
        record(named, tmp_path / f"{tab.name}.rrd", active=tab).path for tab in (Tab.EXPERIMENT, Tab.SUMMARY)
    )
    # The summary shows the characters in proportional and in monospaced type.
    network, text = pixels(take_picture(forces, "Force network")), pixels(take_picture(summary, "Summary"))
    warm = (network[..., 0].astype(int) - network[..., 2] > 80).mean()
    assert 0.01 < warm < 0.5  # share of the picture that strong forces and the legend cover
    assert len(np.unique(network.reshape(-1, network.shape[-1]), axis=0)) > 100
    assert np.ptp(text[..., 0]) > 100


def take_picture(path: Path, view: str) -> bytes:
    """A view as PNG, from a viewer of its own without a window; skips where nothing can draw."""
    if sys.platform.startswith("linux") and not glob.glob("/usr/share/vulkan/icd.d/*.json"):
        pytest.skip("no Vulkan driver: apt-get install mesa-vulkan-drivers libvulkan1")
    from rerun.experimental import ViewerClient

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with ViewerClient.spawn(
        headless=True, port=port, hide_welcome_screen=True, executable_path=str(viewer.viewer_binary())
    ) as client:
        client.open(str(path))
        end, last = time.monotonic() + SECONDS, b""
        while time.monotonic() < end:
            client.take_screenshot(max_size=64)  # a view has an id once it was drawn
            state = client.get_state()
            found = [shown.view_id for shown in state.views if shown.name == view]
            if found and not state.loading:
                picture = picture_of(client, found[0])
                if picture and picture == last:  # it has stopped changing: the viewer loads in the background
                    return picture
                last = picture
            time.sleep(0.2)
    pytest.fail(f"the viewer did not show {view} in {SECONDS:.0f} s")


def picture_of(client, view_id) -> bytes:
    """The view as PNG; nothing while the viewer is still laying it out."""
    try:
        return client.take_screenshot(view_id)
    except ConnectionError as error:
        if "NotFound" in str(error):
            return b""
        raise


def pixels(png: bytes) -> np.ndarray:
    import cv2

    assert png[:8] == b"\x89PNG\r\n\x1a\n"
    return cv2.cvtColor(cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)
