"""Commands do not depend on paths, languages, terminals and access rights."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from rodsight.process.kernel_cache import choose_kernel_cache

from tests.program import RODSIGHT

FEW = ("--set", "solver.estimator=nlgs", "--set", "solver.sweeps=20")
UNUSUAL_NAME = 'it\'s "5°" of; shear & $HOME Ω\u00a0試験'


@pytest.mark.thorough
def test_a_minimal_environment_and_unusual_names_are_accepted(tracked, tmp_path):
    experiment = Path(shutil.move(tracked, tmp_path / UNUSUAL_NAME))
    bare = {
        "PATH": os.environ["PATH"], "PYTHONPATH": os.pathsep.join(filter(None, map(os.path.abspath, sys.path))),
        "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PYTHONIOENCODING": "ascii", "NO_COLOR": "1",
        "COLUMNS": "40", "TERM": "dumb",
    }  # fmt: skip
    out = tmp_path / f"{UNUSUAL_NAME} out"
    done = subprocess.run(
        [*RODSIGHT, "run", experiment, "--out", out, *FEW], env=bare, capture_output=True, timeout=120, cwd=tmp_path
    )
    assert done.stderr == b""
    assert done.returncode == 0
    assert b"\x1b[" not in done.stdout
    done.stdout.decode("ascii")
    assert {"results.h5", "recording.rrd", "summary.json"} <= {file.name for file in out.iterdir()}


@pytest.fixture
def read_only_home(tmp_path, monkeypatch):
    """No folder can be made in the home folder, but in the system's temporary folder."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")
    monkeypatch.delitem(sys.modules, "numba", raising=False)  # as before the compiler is imported
    (tmp_path / "home").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))


def test_kernels_are_cached_in_the_temporary_folder_where_the_home_folder_is_read_only(read_only_home, tmp_path):
    choose_kernel_cache()
    folder = Path(os.environ["NUMBA_CACHE_DIR"])
    assert folder.parent.parent == tmp_path
    assert folder.stat().st_mode & 0o077 == 0
    assert folder.parent.stat().st_mode & 0o077 == 0


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="needs Unix permissions")
def test_kernels_are_not_read_from_a_folder_that_others_can_write_to(read_only_home, tmp_path):
    writable = tmp_path / f"rodsight-{os.getuid()}"
    writable.mkdir()
    writable.chmod(0o777)
    choose_kernel_cache()
    assert Path(os.environ["NUMBA_CACHE_DIR"]).parent != writable
