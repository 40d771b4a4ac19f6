"""Commands without what only Unix has, or without the packages that a node of a cluster does without."""

from __future__ import annotations

import subprocess
import sys
import tomllib

import pytest
from packaging.requirements import Requirement

from tests.program import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))

ABSENT = """
import os, signal, sys
sys.modules["fcntl"] = sys.modules["pwd"] = sys.modules["resource"] = sys.modules["termios"] = None
for module, names in (
    (os, ("pread", "pwrite", "sched_getaffinity", "killpg", "getuid", "geteuid", "fork", "setsid", "getpgid", "nice",
          "mkfifo", "register_at_fork")),
    (signal, ("SIGHUP", "SIGALRM", "setitimer", "SIGKILL", "SIGUSR1")),
):
    for name in names:
        delattr(module, name)
"""
# Packages that `pip install --group solve` leaves out, by the names of their modules.
NOT_ON_A_NODE = (
    "pyarrow",
    "pandas",
    "rerun",
    "rerun_cli",
    "matplotlib",
    "xarray",
    "h5netcdf",
    "jinja2",
    "starlette",
    "uvicorn",
    "h11",
)
HIDE = f"import sys; sys.modules |= dict.fromkeys({NOT_ON_A_NODE!r})"
COMMANDS = {
    "check": "from rodsight.cli.main import main; main(['check', sys.argv[1], '--no-budget'])",
    "track": "from rodsight.cli.main import main; main(['track', sys.argv[1], '--out', sys.argv[2], '--quiet'])",
    "solve": "from rodsight.cli.main import main; main(['solve', sys.argv[1], '--out', sys.argv[2], '--quiet', "
    "'--set', 'solver.sweeps=20'])",
    "verdict": """
from pathlib import Path
from rodsight.verdicts.log import VERDICTS, Entry, Verdict, VerdictLog
log = VerdictLog(Path(sys.argv[2]) / VERDICTS)
for k in (1, 2):
    log.append_all([Entry(k, "anna", 0, 1, Verdict.CONTACT)])
print(len(VerdictLog(log.file).entries()))
""",
}


@pytest.mark.thorough
@pytest.mark.parametrize(
    "what",
    [
        "track",
        *(pytest.param(each, marks=pytest.mark.slow) for each in ("check", "verdict", "solve")),
    ],
)  # solve compiles anew, without the number of cores
def test_commands_need_nothing_that_only_unix_has(what, made_tracks, tmp_path):
    done = run(ABSENT + COMMANDS[what], made_tracks, tmp_path / "run")
    assert what != "verdict" or done.stdout.strip() == "2"


def run(code: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Run a program, which must succeed."""
    done = subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)],
        capture_output=True, text=True, check=False, cwd=ROOT, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done


@pytest.mark.thorough
@pytest.mark.parametrize("folder", ["made_tracks", pytest.param("made_photographs", marks=pytest.mark.slow)])
def test_a_node_of_a_cluster_solves_without_the_other_packages(folder, tmp_path, request):
    run(f"{HIDE}\n{COMMANDS['solve']}", request.getfixturevalue(folder), tmp_path / "run")
    assert (tmp_path / "run/results.h5").is_file()


def test_the_packages_of_a_node_are_those_of_the_program_with_the_same_bounds():
    required = {each.name: each for each in map(Requirement, PROJECT["project"]["dependencies"])}
    node = {each.name: each for each in map(Requirement, PROJECT["dependency-groups"]["solve"])}
    assert node.keys() < required.keys()
    assert {name: each.specifier for name, each in node.items()} == {name: required[name].specifier for name in node}
    left_out = {name.replace("-sdk", "") for name in required.keys() - node.keys()}
    assert left_out - {"markdown-it-py"} == set(NOT_ON_A_NODE) - {"rerun_cli"}
