"""Commands on a system without what only Unix has, simulated in a process of its own."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.program import ROOT

ABSENT = """
import os, signal, sys
sys.modules["fcntl"] = sys.modules["pwd"] = sys.modules["resource"] = sys.modules["termios"] = None
for module, names in (
    (os, ("pread", "pwrite", "sched_getaffinity", "killpg", "getuid", "geteuid", "fork", "setsid", "getpgid")),
    (signal, ("SIGHUP", "SIGALRM", "setitimer", "SIGKILL", "SIGUSR1")),
):
    for name in names:
        delattr(module, name)
"""
COMMANDS = {
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


@pytest.mark.parametrize(
    "what", ["track", "verdict", pytest.param("solve", marks=pytest.mark.screen)]
)  # solve compiles anew, without the number of cores
def test_commands_need_nothing_that_only_unix_has(what, made_tracks, tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", ABSENT + COMMANDS[what], str(made_tracks), str(tmp_path / "run")],
        capture_output=True, text=True, check=False, cwd=ROOT, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert what != "verdict" or done.stdout.strip() == "2"
