"""Compiled kernels belong to exactly the sources that they were compiled from."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from rodsight.process import kernel_cache
from rodsight.process.kernel_cache import KEPT, PREFIX, choose_kernel_cache, remove_old
from rodsight.process.sources import Sources

from tests.program import ROOT

HELPER = "solver/nlgs/sweeping/contact_law.py"  # inlined into the sweeps, which are in another file
CONE = "limit = friction * fn"
HALF = "limit = 0.5 * friction * fn"
FORCES = """
import numpy as np
from tests.packings import problem_of, squeezed_heap
from rodsight.solver.nlgs.solve import NlgsSettings, solve
problem, _ = problem_of(*squeezed_heap(np.random.default_rng(1)))
print(solve(problem, NlgsSettings(sweeps=50)).ft.tobytes().hex())
"""


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A copy of this program's source tree."""
    for name in ("app", "solver", ".editable"):
        ignored = shutil.ignore_patterns("__pycache__", "docs", "page")
        shutil.copytree(ROOT / name, tmp_path / "tree" / name, ignore=ignored)
    return tmp_path / "tree"


@pytest.fixture
def new_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """As in a process that has not imported the compiler, which would otherwise use the folder of a test."""
    monkeypatch.delitem(sys.modules, "numba", raising=False)


def edit(tree: Path, name: str, old: str, new: str) -> None:
    text = (tree / name).read_text(encoding="utf-8")
    assert old in text
    (tree / name).write_text(text.replace(old, new), encoding="utf-8")


def kernels_of(tree: Path) -> str:
    sources = Sources.of(tree / "app")
    return sources.hash_of(sources.needed_by(sources.compiled))


def test_an_edit_of_an_inlined_helper_or_of_a_constant_gives_other_kernels_and_its_reversal_those_of_before(tree):
    first = kernels_of(tree)
    for name, old, new in (
        (HELPER, CONE, HALF),
        ("solver/contacts/pairs.py", "import numpy as np", "import numpy as np  # edited"),  # imported by kernels
    ):
        edit(tree, name, old, new)
        assert kernels_of(tree) != first, name
        edit(tree, name, new, old)
        assert kernels_of(tree) == first, name


def test_an_edit_of_a_page_or_of_a_command_leaves_the_kernels(tree):
    first = kernels_of(tree)
    edit(tree, "app/cli/summary_table.py", "import", "import  ")
    assert kernels_of(tree) == first


def test_all_files_that_use_the_compiler_are_part_of_the_key():
    sources = Sources.of(ROOT / "app")
    found = {
        str(file.relative_to(ROOT)).removeprefix("app/")
        for room in ("app", "solver")
        for file in (ROOT / room).rglob("*.py")
        if "from numba import" in file.read_text(encoding="utf-8")
    }
    assert found
    assert found <= sources.compiled | {"process/sources.py"}


@pytest.mark.parametrize("fact", ["hash_of_kernels", "_version", "_processor"])
def test_the_key_depends_on_sources_compiler_and_processor(monkeypatch, fact):
    first = kernel_cache.kernel_key()
    assert kernel_cache.kernel_key() == first
    monkeypatch.setattr(kernel_cache, fact, lambda *_: "another")
    assert kernel_cache.kernel_key() != first


def test_a_folder_that_the_user_chose_holds_the_kernels_of_all_versions(tmp_path, monkeypatch, new_process):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    choose_kernel_cache()
    first = os.environ["NUMBA_CACHE_DIR"]
    assert Path(first).parent == tmp_path
    monkeypatch.setattr(kernel_cache, "hash_of_kernels", lambda: "other sources")
    choose_kernel_cache()  # in a process that inherited the choice
    assert Path(os.environ["NUMBA_CACHE_DIR"]).parent == tmp_path
    assert os.environ["NUMBA_CACHE_DIR"] != first


def test_kernels_that_were_not_used_for_a_while_are_removed(tmp_path):
    for name in (f"{PREFIX}old", f"{PREFIX}new", "others"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "kernel.nbi").touch()
    now = (tmp_path / f"{PREFIX}new").stat().st_mtime
    for name in (f"{PREFIX}old", "others"):
        os.utime(tmp_path / name, (now - KEPT - 60.0,) * 2)
    remove_old(tmp_path, now)
    assert sorted(each.name for each in tmp_path.iterdir()) == ["others", f"{PREFIX}new"]


@pytest.mark.slow
def test_half_the_coulomb_limit_in_a_helper_changes_the_forces_and_its_reversal_restores_them(tree, tmp_path):
    paths = os.pathsep.join((str(tree / ".editable"), str(ROOT)))
    environment = {**os.environ, "PYTHONPATH": paths, "NUMBA_CACHE_DIR": str(tmp_path / "kernels")}

    def forces() -> str:
        done = subprocess.run(
            [sys.executable, "-c", FORCES], env=environment, capture_output=True, text=True, check=True
        )
        return done.stdout

    first = forces()
    edit(tree, HELPER, CONE, HALF)
    assert forces() != first
    edit(tree, HELPER, HALF, CONE)
    assert forces() == first
