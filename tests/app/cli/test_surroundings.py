"""Places, languages and rights as they are found: a command does not depend on them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from rodsight.kernel_cache import find_room_for_kernels

from tests.program import RODSIGHT

FEW = ("--set", "solver.estimator=nlgs", "--set", "solver.sweeps=20")
STRANGE = 'it\'s "5°" of; shear & $HOME Ω\u00a0試験'


@pytest.mark.screen
def test_a_bare_environment_and_a_strange_name_are_fine(tracked, tmp_path):
    experiment = Path(shutil.move(tracked, tmp_path / STRANGE))
    bare = {
        "PATH": os.environ["PATH"], "PYTHONPATH": os.pathsep.join(filter(None, map(os.path.abspath, sys.path))),
        "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PYTHONIOENCODING": "ascii", "NO_COLOR": "1",
        "COLUMNS": "40", "TERM": "dumb",
    }  # fmt: skip
    out = tmp_path / f"{STRANGE} out"
    done = subprocess.run(
        [*RODSIGHT, "run", experiment, "--out", out, *FEW], env=bare, capture_output=True, timeout=120, cwd=tmp_path
    )
    assert done.stderr == b""
    assert done.returncode == 0
    assert b"\x1b[" not in done.stdout
    done.stdout.decode("ascii")
    assert {"results.h5", "recording.rrd", "summary.json"} <= {file.name for file in out.iterdir()}


@pytest.fixture
def nowhere_to_write(tmp_path, monkeypatch):
    """Neither installation nor home can be written to; the system's folder for what is temporary can."""
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    monkeypatch.setattr(os, "access", lambda *_: False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))


def test_kernels_find_room_where_nothing_else_can_be_written_to(nowhere_to_write, tmp_path):
    find_room_for_kernels(tmp_path / "installed")
    folder = Path(os.environ["NUMBA_CACHE_DIR"])
    assert folder.parent == tmp_path
    assert folder.stat().st_mode & 0o077 == 0


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="rights as Unix has them")
def test_kernels_are_not_read_from_a_folder_that_others_can_write_to(nowhere_to_write, tmp_path):
    laid_out = tmp_path / f"rodsight-kernels-{os.getuid()}"
    laid_out.mkdir()
    laid_out.chmod(0o777)
    find_room_for_kernels(tmp_path / "installed")
    assert Path(os.environ["NUMBA_CACHE_DIR"]) != laid_out


def test_kernels_stay_where_they_are_if_they_can(tmp_path, monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    find_room_for_kernels(tmp_path)
    assert "NUMBA_CACHE_DIR" not in os.environ
