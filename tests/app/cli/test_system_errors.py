"""Errors of the operating system end a command with one line, and exit status 1 unless an argument causes them."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Any

import pytest

from tests.program import rodsight

FEW = ("--set", "solver.estimator=nlgs", "--set", "solver.sweeps=20", "--sweeps", "none", "--quiet")


@pytest.mark.thorough
@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EACCES])
def test_a_file_that_cannot_be_written_is_one_line(tracked, tmp_path, capsys, monkeypatch, number):
    given = Path.open

    def refuse(self: Path, mode: str = "r", *args: Any, **options: Any) -> Any:
        if mode == "wb" and self.is_relative_to(tmp_path / "out"):
            raise OSError(number, os.strerror(number), str(self))
        return given(self, mode, *args, **options)

    monkeypatch.setattr(Path, "open", refuse)
    assert rodsight("solve", tracked, "--out", tmp_path / "out", *FEW) == 1
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert os.strerror(number) in printed.err
    assert str(tmp_path / "out") in printed.err
    assert not (tmp_path / "out" / "results.h5").exists()


@pytest.mark.parametrize("command", ["solve", "campaign"])
def test_a_folder_that_is_a_file_is_one_line(command, tracked, tmp_path, capsys):
    (tmp_path / "out").write_text("mine")
    table = tmp_path / "table.csv"
    table.write_text(f"experiment\n{tracked}\n")
    given = (tracked, *FEW) if command == "solve" else (table,)
    assert rodsight(command, *given, "--out", tmp_path / "out") == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    assert f"{tmp_path / 'out'}: is a file, not a folder" in line
    assert (tmp_path / "out").read_text() == "mine"


def test_a_simulation_that_does_not_come_to_rest_is_one_line(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("rodsight.synthetic.dense_packing.LOADING_ROUNDS", 0)
    assert rodsight("synth", tmp_path / "out", "--grains", "30", "--no-photographs", "--quiet") == 1
    printed = capsys.readouterr().err
    assert printed.count("\n") == 1
    assert "did not come to rest" in printed
    assert not (tmp_path / "out").exists()
