"""Apply every mutant to a copy of the tree, run the nearest tests there, and report the mutants that survive.

The copy keeps the files' times and has a copy of the compiled kernels, which all mutants outside of kernels share: the
program would compile all of them anew for every other file that they import. A mutant of a kernel is run without
compilation: the kernels of its callers would hide it otherwise. So could those that contain a constant: a survivor of
a file that kernels import is tried again with kernels of its own. Every run is a fork of one process that has imported
the external libraries, which takes longer than most tests.
"""

from __future__ import annotations

import ast
import hashlib
import multiprocessing
import os
import shutil
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

from rodsight.process.kernel_cache import kernel_folder
from rodsight.process.sources import program_sources

from tests.mutation.mutant import Mutant

ROOT = Path(__file__).resolve().parents[2]
COPIED = ("app", "solver", "tests", "sample_data", ".editable", "pyproject.toml", "README.md")
OWN = ("tests", "rodsight")  # packages that every run must import from its copy
# Without pytest's plugins: pytest must import those itself.
PRELOADED = (
    "numpy", "numba", "scipy.spatial", "scipy.sparse.csgraph", "scipy.linalg", "scipy.stats", "scipy.ndimage",
    "h5py", "clarabel", "cv2", "pydantic", "pytest", "playwright.sync_api",
)  # fmt: skip
KERNELS = Path(
    "kernels", "rodsight-kernels-of-all-mutants"
)  # beside the copy; the prefix marks a choice of the program
TIME_LIMIT = 300.0  # seconds; a mutant that exceeds it is killed
COMPILING = 900.0  # seconds beside it, where all kernels are compiled first
MAX_SURVIVAL = 0.10  # fraction of the mutants that may survive


class UnsoundTestsError(RuntimeError):
    """The nearest tests fail without any mutant."""


@dataclass(frozen=True, slots=True)
class Verdict:
    mutant: Mutant
    file: Path
    killed: bool
    by: str  # the test that failed, or the end of the run
    seconds: float


def judge_mutants(mutants: Sequence[Mutant], folder: Path) -> Iterator[Verdict]:
    """Try mutants one by one in a copy of the tree in `folder`. Errors: StaleMutantError, UnsoundTestsError."""
    files = [mutant.locate(ROOT) for mutant in mutants]
    kernel = [in_kernel(ROOT / file, mutant.old) for mutant, file in zip(mutants, files, strict=True)]
    tree = copy_tree(folder)
    for tests, interpreted in sorted({(m.tests, k) for m, k in zip(mutants, kernel, strict=True)}):
        code, result = run_tests(tree, tests, compile_kernels=not interpreted)
        if code != 0:
            raise UnsoundTestsError(f"without a mutant {' '.join(tests)} do not pass: {result}")
    for mutant, file in zip(mutants, files, strict=True):
        yield judge(mutant, file, tree)


def judge(mutant: Mutant, file: Path, tree: Path) -> Verdict:
    """Try one mutant in the copy, and put the file back."""
    start = perf_counter()
    text = (tree / file).read_text(encoding="utf-8")
    (tree / file).write_text(text.replace(mutant.old, mutant.new), encoding="utf-8")
    try:
        interpreted = in_kernel(ROOT / file, mutant.old)
        code, result = run_tests(tree, mutant.tests, compile_kernels=not interpreted)
        if code == 0 and not interpreted and is_compiled_in(file):
            code, result = run_tests(tree, mutant.tests, compile_kernels=True, own_kernels=True)
    finally:
        shutil.copy2(ROOT / file, tree / file)
    if code > 1:  # neither passed nor failed: no test was run at all
        result = f"pytest ended with {code}: {result}"
    return Verdict(mutant, file, code != 0, result, perf_counter() - start)


def copy_tree(folder: Path) -> Path:
    """Copy the files that the tests need, with the caches of compiled kernels."""
    for name in COPIED:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, folder / name)
        else:
            shutil.copy2(ROOT / name, folder / name)
    copy_kernels(folder)
    return folder


def copy_kernels(tree: Path) -> None:
    """Copy the compiled kernels of this tree to where those of the copy are looked for."""
    (tree / KERNELS).mkdir(parents=True)
    kept = kernel_folder()
    for file in program_sources().compiled if kept else ():
        source = source_of(file).parent
        there = kept / cache_name(ROOT / source)
        if there.is_dir() and not (tree / KERNELS / cache_name(tree / source)).exists():
            shutil.copytree(there, tree / KERNELS / cache_name(tree / source))


def cache_name(folder: Path) -> str:
    """The name that the compiler gives to the kernels of a folder of sources, see `folder_of_sources`."""
    return f"{folder.name}_{hashlib.sha1(str(folder).encode()).hexdigest()}"


def source_of(name: str) -> Path:
    """The file of the tree with a name in the package, such as tracking/tracker.py."""
    return Path(name) if name.startswith("solver/") else Path("app", name)


def is_compiled_in(file: Path) -> bool:
    """Whether kernels may contain something of a file: one of their own files, or one that these import."""
    sources = program_sources()
    return any(source_of(name) == file for name in sources.needed_by(sources.compiled))


def in_kernel(file: Path, text: str) -> bool:
    """Whether a text is in a compiled function, or at the top level of a file with compiled functions."""
    code = file.read_text(encoding="utf-8")
    if "@njit" not in code:
        return False
    line = code[: code.index(text)].count("\n") + 1
    for node in ast.parse(code).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.lineno <= line <= (node.end_lineno or line):
            return any("njit" in ast.unparse(decorator) for decorator in node.decorator_list)
    return True


def run_tests(tree: Path, tests: Sequence[str], *, compile_kernels: bool, own_kernels: bool = False) -> tuple[int, str]:
    """Return pytest's exit code and the test that failed; without compilation, of unit tests alone."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(PRELOADED))
    report = tree / "report.txt"
    run = context.Process(target=_run_here, args=(tree, tuple(tests), compile_kernels, own_kernels, report))
    run.start()
    run.join(TIME_LIMIT + (COMPILING if own_kernels else 0.0))
    if run.is_alive():
        run.kill()
        run.join()
        return 1, "ran out of time"
    lines = report.read_text(encoding="utf-8", errors="replace").splitlines()
    failed = [line for line in lines if line.startswith(("FAILED", "ERROR"))]
    last = (failed or lines or [""])[-1]
    return run.exitcode or 0, last.removeprefix("FAILED ").split(" - ")[0]


def _run_here(tree: Path, tests: Sequence[str], compile_kernels: bool, own_kernels: bool, report: Path) -> None:
    """Run the tests in a process that imports from the copy of the tree."""
    import numba
    import pytest

    handle = os.open(report, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    for stream in (1, 2):
        os.dup2(handle, stream)
    for name in [name for name in sys.modules if name.split(".")[0] in OWN]:
        del sys.modules[name]
    sys.dont_write_bytecode = True
    external = [path for path in sys.path if path and Path(path) not in (ROOT, ROOT / ".editable")]
    sys.path[:] = [str(tree / ".editable"), str(tree), *external]
    os.environ["PYTHONPATH"] = os.pathsep.join(sys.path[:2])
    os.chdir(tree)
    os.environ["NUMBA_CACHE_DIR"] = str(tree / KERNELS.parent)
    import rodsight  # noqa: F401  which chooses a folder there for the kernels of exactly these sources

    if not own_kernels:
        os.environ["NUMBA_CACHE_DIR"] = numba.config.CACHE_DIR = str(tree / KERNELS)
    options = ["-x", "-q", "-p", "no:cacheprovider", "--no-header", "--tb=no", "--hypothesis-profile=mutants", *tests]
    if compile_kernels:
        options += ["-m", "not slow and not screen"]  # the thorough tests, too
    else:
        numba.config.DISABLE_JIT = True
        options += ["-m", "unit and not slow"]
    sys.exit(pytest.main(options))


def format_table(verdicts: Sequence[Verdict]) -> str:
    """Format killed and survived by folder, and every survivor, as Markdown."""
    lines = ["| room | mutants | killed | survived |", "|---|---:|---:|---:|"]
    for room in sorted({verdict.mutant.room for verdict in verdicts}):
        of = [verdict.killed for verdict in verdicts if verdict.mutant.room == room]
        lines.append(f"| {room} | {len(of)} | {sum(of)} | {len(of) - sum(of)} |")
    killed = sum(verdict.killed for verdict in verdicts)
    lines.append(f"| all | {len(verdicts)} | {killed} | {len(verdicts) - killed} |")
    survivors = [verdict for verdict in verdicts if not verdict.killed]
    if survivors:
        lines += ["", "Survivors:", ""]
        for each in survivors:
            old, new = (" ⏎ ".join(part.strip().splitlines()) for part in (each.mutant.old, each.mutant.new))
            lines.append(f"- {each.file}: `{old}` → `{new}`")
    return "\n".join(lines) + "\n"


def survival(verdicts: Sequence[Verdict]) -> float:
    """Fraction of the mutants that survived."""
    return sum(not verdict.killed for verdict in verdicts) / max(len(verdicts), 1)
