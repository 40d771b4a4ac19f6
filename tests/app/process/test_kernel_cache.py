"""Compiled kernels belong to exactly the sources that they were compiled from."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
import time
import zipfile
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from rodsight.process import kernel_cache
from rodsight.process.kernel_cache import (
    KEPT,
    NAME_VARIABLE,
    PREFIX,
    RECENT,
    archive_name,
    choose_kernel_cache,
    folder_of_sources,
    kernel_key,
    remove_old,
)
from rodsight.process.machine import processor
from rodsight.process.machine.processor import V3, V4, level_of, processor_level
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
# /proc/cpuinfo of a processor for which no wheel has kernels; a program that takes this processor for such a one.
ARM = "processor\t: 0\nFeatures\t: fp asimd evtstrm aes\nCPU implementer\t: 0x41\nCPU part\t: 0xd0c"
ON_ARM = """
import platform
platform.machine = lambda: "aarch64"
from rodsight.process.kernel_cache import kernel_folder
"""
KERNELS_OF = "\nprint(*{each.name for each in kernel_folder().rglob('*.nbi')})"


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
        if "njit" in file.read_text(encoding="utf-8")
    }
    assert found
    assert found <= sources.compiled


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


def test_too_many_kernels_go_from_the_longest_unused_on_except_those_just_used(tmp_path, monkeypatch):
    monkeypatch.setattr(kernel_cache, "MOST", 250)
    ages = {"now": 0.0, "just": RECENT - 60.0, "earlier": RECENT + 60.0, "yesterday": 86400.0, "before": 2 * 86400.0}
    now = time.time()
    for name, age in ages.items():
        (tmp_path / f"{PREFIX}{name}" / "solver").mkdir(parents=True)
        (tmp_path / f"{PREFIX}{name}" / "solver" / "kernel.nbi").write_bytes(bytes(100))
        os.utime(tmp_path / f"{PREFIX}{name}", (now - age,) * 2)

    def left() -> set[str]:
        return {each.name.removeprefix(PREFIX) for each in tmp_path.iterdir()}

    remove_old(tmp_path, now)
    assert left() == {"now", "just", "earlier"}  # the third one makes them too many
    monkeypatch.setattr(kernel_cache, "MOST", 50)
    remove_old(tmp_path, now)
    assert left() == {"now", "just"}


def test_a_new_folder_of_kernels_removes_what_is_too_much(tmp_path, monkeypatch, new_process):
    monkeypatch.setattr(kernel_cache, "MOST", 50)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    (tmp_path / f"{PREFIX}large").mkdir()
    (tmp_path / f"{PREFIX}large" / "kernel.nbi").write_bytes(bytes(100))
    (tmp_path / f"{PREFIX}old").mkdir()
    for name, age in (("large", RECENT + 60.0), ("old", 2.0 * RECENT)):
        os.utime(tmp_path / f"{PREFIX}{name}", (time.time() - age,) * 2)
    choose_kernel_cache()
    assert {each.name for each in tmp_path.iterdir()} == {Path(os.environ["NUMBA_CACHE_DIR"]).name, f"{PREFIX}large"}


@pytest.mark.parametrize(
    ("flags", "level"),
    [(V4, "x86-64-v4"), (V4 - {"avx512vl"}, "x86-64-v3"), (V3 | {"avx512f"}, "x86-64-v3"), (V3 - {"avx2"}, None)],
)
def test_a_level_needs_all_its_flags(flags, level):
    assert level_of(flags) == level


def test_processors_of_one_level_have_the_same_key_and_those_of_none_keys_of_their_own(monkeypatch, tmp_path):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(kernel_cache, "_has_begun", lambda: False)
    keys = {}
    for level in ("x86-64-v4", None):
        for model in ("EPYC", "Xeon"):
            monkeypatch.delenv(NAME_VARIABLE, raising=False)
            monkeypatch.setattr(kernel_cache, "processor_level", lambda level=level: level)
            monkeypatch.setattr(kernel_cache, "described_processor", lambda model=model: [model])
            monkeypatch.setattr(kernel_cache, "_set", lambda variable, _, value: monkeypatch.setenv(variable, value))
            choose_kernel_cache()
            keys[level, model] = kernel_key()
    assert keys["x86-64-v4", "EPYC"] == keys["x86-64-v4", "Xeon"]
    assert len(set(keys.values())) == 3


def test_a_compiler_that_has_begun_for_this_processor_keeps_to_it(monkeypatch, tmp_path):
    import numba

    numba.njit(lambda x: x)  # kernels of the user's own
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.delenv(NAME_VARIABLE, raising=False)
    choose_kernel_cache()
    assert NAME_VARIABLE not in os.environ


@pytest.fixture
def shipped(tmp_path, monkeypatch, new_process) -> Path:
    """A wheel's archive with one kernel of this program."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    imported = SimpleNamespace(config=SimpleNamespace(), __spec__=find_spec("numba"))
    monkeypatch.setitem(sys.modules, "numba", imported)
    monkeypatch.setattr(kernel_cache, "SHIPPED", str(tmp_path))  # an absolute path replaces the package's folder
    archive = tmp_path / archive_name(kernel_key())
    with zipfile.ZipFile(archive, "w") as kernels:
        kernels.writestr("solver/nlgs/solve.f-1.py311.nbi", b"shipped")
    return archive


def unpacked() -> Path:
    return Path(os.environ["NUMBA_CACHE_DIR"]) / folder_of_sources("solver/nlgs") / "solve.f-1.py311.nbi"


def test_kernels_of_the_wheel_are_unpacked_once(shipped):
    choose_kernel_cache()
    assert unpacked().read_bytes() == b"shipped"
    unpacked().write_bytes(b"with a kernel compiled since")
    choose_kernel_cache()
    assert unpacked().read_bytes() == b"with a kernel compiled since"


def test_kernels_of_the_wheel_are_unpacked_when_the_compiler_is_imported(shipped, monkeypatch):
    monkeypatch.delitem(sys.modules, "numba")
    monkeypatch.setattr(sys, "meta_path", list(sys.meta_path))
    choose_kernel_cache()
    finder, *_ = sys.meta_path
    assert finder.find_spec("numpy") is None
    assert not unpacked().exists()
    assert finder.find_spec("numba") is None
    assert unpacked().read_bytes() == b"shipped"
    assert finder not in sys.meta_path


def test_kernels_of_other_sources_than_the_installed_ones_are_not_used(shipped, monkeypatch):
    monkeypatch.setattr(kernel_cache, "hash_of_kernels", lambda: "an edited file")
    choose_kernel_cache()
    assert not unpacked().exists()


def test_a_processor_without_kernels_in_the_wheel_gets_none_of_another_and_no_level(shipped, monkeypatch):
    choose_kernel_cache()
    assert unpacked().exists()  # on this processor
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(shipped.parent / "other"))
    monkeypatch.delenv(NAME_VARIABLE)
    monkeypatch.setattr(platform, "machine", lambda: "aarch64")
    monkeypatch.setattr(processor, "_first_processor", lambda: ARM)
    assert processor_level() is None
    choose_kernel_cache()
    assert not unpacked().exists()
    assert NAME_VARIABLE not in os.environ


def test_the_folder_of_kernels_has_the_name_that_the_compiler_gives_it():
    from numba.core.caching import CacheImpl
    from rodsight.solver.nlgs.sweeping import kernels

    locate = CacheImpl._locator_classes[0].get_suitable_cache_subpath
    assert folder_of_sources("solver/nlgs/sweeping") == locate(kernels.__file__)


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


@pytest.mark.slow
def test_a_processor_of_no_level_compiles_for_itself_and_finds_the_same_forces(tmp_path):
    hidden = ("NUMBA_CACHE_DIR", NAME_VARIABLE, "NUMBA_CPU_FEATURES")
    environment = {name: value for name, value in os.environ.items() if name not in hidden}
    environment |= {
        "PYTHONPATH": os.pathsep.join((str(ROOT / ".editable"), str(ROOT))),
        "XDG_CACHE_HOME": str(tmp_path),
    }

    def lines(code: str) -> list[str]:
        done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
        return done.stdout.splitlines()

    forces, kernels = lines(ON_ARM + FORCES + KERNELS_OF)
    assert kernels
    (expected,) = lines(FORCES)
    np.testing.assert_allclose(*(np.frombuffer(bytes.fromhex(each)) for each in (forces, expected)), rtol=1e-9)
