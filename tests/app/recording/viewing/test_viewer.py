from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rodsight.recording.files.finished_run import RecordingOptions, write_recording
from rodsight.recording.look.printable_text import _RANGES, _SIGNS, _SUBSTITUTES, printable
from rodsight.recording.tabs.blueprint import Tab
from rodsight.recording.viewing import viewer
from rodsight.recording.viewing.headless import HeadlessViewer, vulkan_drivers
from rodsight.recording.viewing.open_viewer import open_viewer

from tests.browser import read_picture, warm_fraction


def test_the_installed_wheel_holds_the_viewer():
    assert viewer.viewer_binary().is_file()


def test_the_viewer_has_the_options_that_are_used():
    known = subprocess.run([viewer.viewer_binary(), "--help"], capture_output=True, text=True, timeout=60).stdout
    assert "--bind" in known
    assert "--hide-welcome-screen" in known


def test_a_viewer_stores_no_usage_data(recording, tmp_path, monkeypatch):
    for name in ("XDG_CONFIG_HOME", "XDG_DATA_HOME", "CI"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("FORCE_RERUN_ANALYTICS", "1")

    def kept_of(home, environment) -> list[str]:
        home.mkdir()
        command = [viewer.viewer_binary(), "rrd", "stats", str(recording.path)]
        subprocess.run(command, env={**environment, "HOME": str(home)}, capture_output=True, timeout=60, check=True)
        return [file.name for file in home.rglob("*analytics*")]

    assert kept_of(tmp_path / "ours", viewer.viewer_environment()) == []
    if sys.platform == "linux":
        assert kept_of(tmp_path / "as it comes", dict(os.environ)) != []


def test_every_viewer_is_started_with_the_environment_without_analytics():
    for file in Path(viewer.__file__).parents[1].rglob("*.py"):
        text = file.read_text(encoding="utf-8")
        starts = text.count("viewer_binary()") - text.count("def viewer_binary()")
        if "subprocess." in text and starts:
            assert "viewer_environment()" in text, file


def test_without_a_display_one_line_states_the_command(recording, monkeypatch):
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
    assert started == [[str(viewer.viewer_binary()), str(recording.path)]]


def test_no_viewer_is_started_if_none_is_requested(recording, monkeypatch):
    monkeypatch.setattr(subprocess, "Popen", lambda *_, **__: pytest.fail("a viewer was started"))
    assert "rodsight view" in str(open_viewer(recording.path, "none"))


def test_a_missing_recording_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"nowhere\.rrd"):
        open_viewer(tmp_path / "nowhere.rrd")


@pytest.mark.skipif(not vulkan_drivers(), reason="no Vulkan driver: apt-get install mesa-vulkan-drivers")
@pytest.mark.screen
def test_the_viewer_draws_the_forces_and_every_printable_character(results, tmp_path):
    characters = "".join(chr(code) for low, high in _RANGES for code in range(low, high + 1))
    characters += "".join(sorted(_SIGNS - {"\n"})) + "".join(_SUBSTITUTES.values())
    assert printable(characters) == characters
    named = replace(results, name="all", configuration=characters)
    frames = [replace(forces, reason=characters) for forces in results.frames]
    path = write_recording(
        replace(named, frames=frames), tmp_path / "all.rrd", options=RecordingOptions(active=Tab.SUMMARY)
    ).path
    with HeadlessViewer(path) as viewer:
        front = viewer.picture()
        viewer.show_tab(Tab.SUMMARY)
        assert viewer.picture() == front  # the requested tab was in front at the start
        # The summary shows the characters in proportional and in monospaced type.
        text, network = read_picture(viewer.picture("The run")), read_picture(viewer.picture("Force network"))
    assert 0.01 < warm_fraction(network) < 0.5  # fraction of the picture covered by strong forces and the legend
    assert len(np.unique(network.reshape(-1, network.shape[-1]), axis=0)) > 100
    assert np.ptp(text[..., 0]) > 100
