"""The web viewer's files come out of the installed package, whatever listens on this machine."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from rodsight.recording.viewing import web_viewer
from rodsight.recording.viewing.web_viewer import MODULE_START, SCRIPT_START, read_web_viewer

SCRIPT = SCRIPT_START + b" return exports; })({});\n"
SECTIONS = b"\x01\x02ab" + b"\x00\x81\x01" + b"x" * 129 + b"\x0a\x00"
PAGE = b"<!doctype html>"


@pytest.fixture
def program(tmp_path: Path) -> Path:
    file = tmp_path / "viewer"
    file.write_bytes(b"\x7fELF" + b"\0" * 100 + SCRIPT + MODULE_START + SECTIONS + PAGE)
    return file


def test_both_files_are_cut_out_of_the_program(program):
    found = read_web_viewer(program)
    assert found.script == SCRIPT
    assert found.module == MODULE_START + SECTIONS


def test_a_program_without_them_is_refused(tmp_path):
    (tmp_path / "viewer").write_bytes(b"\x7fELF" + b"\0" * 100)
    with pytest.raises(RuntimeError, match="reinstall"):
        read_web_viewer(tmp_path / "viewer")


def test_the_installed_viewer_is_read_without_a_process_and_without_a_port(monkeypatch):
    def started(*_: object, **__: object) -> None:
        pytest.fail("a program was started")

    monkeypatch.setattr(subprocess, "Popen", started)
    monkeypatch.setattr("socket.socket.connect", started)
    found = read_web_viewer()
    assert found.script.rstrip().endswith(b"})({ __proto__: null });")
    assert len(found.module) > 10_000_000


def test_a_program_that_differs_from_its_package_is_refused(program, monkeypatch):
    class Stated:
        class hash:
            mode, value = "sha256", "another"

        name = program.name

        @staticmethod
        def locate() -> Path:
            return program

    monkeypatch.setattr(web_viewer, "viewer_binary", lambda: program)
    monkeypatch.setattr(web_viewer, "distribution", lambda _: type("Package", (), {"files": [Stated]}))
    with pytest.raises(RuntimeError, match="differs from its package"):
        read_web_viewer()
