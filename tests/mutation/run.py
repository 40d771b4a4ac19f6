"""Apply every mutant to a copy of the tree, run the nearest tests there, and tell which of them nothing notices.

The copy keeps the files' times, so that compiled kernels that no mutant touches are found in their caches. A mutant of
a kernel is run without compilation: its lines are the same, and its callers could not know of it otherwise.
"""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

from tests.mutation.mutant import Mutant

ROOT = Path(__file__).resolve().parents[2]
COPIED = ("app", "solver", "tests", "sample_data", ".editable", "pyproject.toml", "README.md")
TIME_LIMIT = 300.0  # seconds; a mutant that never ends is noticed, too
GREATEST_SURVIVAL = 0.10  # share of the mutants that may survive


class UnsoundTestsError(RuntimeError):
    """The nearest tests fail without any mutant: they could tell nothing."""


@dataclass(frozen=True, slots=True)
class Verdict:
    mutant: Mutant
    file: Path
    killed: bool
    by: str  # the test that noticed it, or how it ended
    seconds: float


def judge_mutants(mutants: Sequence[Mutant], folder: Path) -> Iterator[Verdict]:
    """Try mutants one by one in a copy of the tree in `folder`. Errors: StaleMutantError, UnsoundTestsError."""
    files = [mutant.locate(ROOT) for mutant in mutants]
    kernel = [in_kernel(ROOT / file, mutant.old) for mutant, file in zip(mutants, files, strict=True)]
    tree = copy_tree(folder)
    for tests, interpreted in sorted({(m.tests, k) for m, k in zip(mutants, kernel, strict=True)}):
        code, told = run_tests(tree, tests, compile_kernels=not interpreted)
        if code != 0:
            raise UnsoundTestsError(f"without a mutant {' '.join(tests)} do not pass: {told}")
    for mutant, file in zip(mutants, files, strict=True):
        yield judge(mutant, file, tree)


def judge(mutant: Mutant, file: Path, tree: Path) -> Verdict:
    """Try one mutant in the copy, and put the file back."""
    start = perf_counter()
    text = (tree / file).read_text(encoding="utf-8")
    (tree / file).write_text(text.replace(mutant.old, mutant.new), encoding="utf-8")
    try:
        kernel = in_kernel(ROOT / file, mutant.old)
        code, told = run_tests(tree, mutant.tests, compile_kernels=not kernel)
    finally:
        shutil.copy2(ROOT / file, tree / file)
    if code > 1:  # neither passed nor failed: no test was run at all
        told = f"pytest ended with {code}: {told}"
    return Verdict(mutant, file, code != 0, told, perf_counter() - start)


def copy_tree(folder: Path) -> Path:
    """Copy what the tests need, caches of compiled kernels included."""
    for name in COPIED:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, folder / name)
        else:
            shutil.copy2(ROOT / name, folder / name)
    return folder


def in_kernel(file: Path, text: str) -> bool:
    """Whether a text stands in a compiled function, or at the top of a file that has some."""
    code = file.read_text(encoding="utf-8")
    if "@njit" not in code:
        return False
    line = code[: code.index(text)].count("\n") + 1 + text[: len(text) - len(text.lstrip("\n"))].count("\n")
    for node in ast.parse(code).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.lineno <= line <= (node.end_lineno or line):
            return any("njit" in ast.unparse(decorator) for decorator in node.decorator_list)
    return True


def run_tests(tree: Path, tests: Sequence[str], *, compile_kernels: bool) -> tuple[int, str]:
    """pytest's exit code, and its last words; without compilation only tests that can do without."""
    environment = {
        **os.environ,
        "PYTHONPATH": f"{tree / '.editable'}{os.pathsep}{tree}",
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "--no-header", "--tb=no"]
    if not compile_kernels:
        environment["NUMBA_DISABLE_JIT"] = "1"
        command += ["-m", "unit and not slow"]
    try:
        done = subprocess.run(
            [*command, *tests], cwd=tree, env=environment, capture_output=True, text=True, timeout=TIME_LIMIT
        )
    except subprocess.TimeoutExpired:
        return 1, "ran out of time"
    failed = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    last = (failed or done.stdout.splitlines() or done.stderr.splitlines() or [""])[-1]
    return done.returncode, last.removeprefix("FAILED ").split(" - ")[0]


def format_table(verdicts: Sequence[Verdict]) -> str:
    """Killed and survived by room, and every survivor, as Markdown."""
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
    return sum(not verdict.killed for verdict in verdicts) / max(len(verdicts), 1)
