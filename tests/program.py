"""The command, in this process and in one of its own."""

from __future__ import annotations

import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from rodsight.cli.main import main

ROOT = Path(__file__).parents[1]

RODSIGHT = (sys.executable, "-u", "-c", "from rodsight.cli.main import main; main()")

# The same, which reports on standard error when something is out of its reach: the moment to stop it.
REPORTING = (
    sys.executable, "-u", "-c",
    f"import sys; sys.path.insert(0, {str(ROOT)!r}); from tests.program import run_reporting; run_reporting()",
)  # fmt: skip
KEPT, DONE, SENT = "kept frame", "done case", "sent frame"  # on the disk, twice; on its way to the live recording


def rodsight(*arguments: object) -> int:
    """Run the command here; gives its exit status."""
    with pytest.raises(SystemExit) as end:
        main([str(each) for each in arguments])
    return int(end.value.code or 0)


def refuse(capsys: pytest.CaptureFixture, out: Path, *arguments: str) -> str:
    """Run the command on bad input, which it names in one line, writing nothing; gives that line."""
    assert rodsight(*arguments, "--out", out, "--quiet") == 2
    printed = capsys.readouterr()
    assert printed.err.count("\n") == 1
    assert printed.err.startswith("rodsight: ")
    assert printed.out == ""
    assert not out.exists() or not any(out.iterdir())
    return printed.err


def wait_for_report(process: subprocess.Popen[str], what: str, times: int) -> None:
    """Read the reports of a REPORTING process until one has come so many times."""
    assert process.stderr is not None
    lines: list[str] = []
    while lines.count(what) < times:
        line = process.stderr.readline()
        assert line, f"the process ended after {lines}"
        lines.append(line.strip())


def run_reporting() -> None:
    """Run the command as the process of REPORTING."""
    from rodsight.recording.files import live_process
    from rodsight.results.checkpoint import Checkpoint
    from rodsight.robustness.study import EffectLog

    def report(what: str) -> None:
        print(what, file=sys.stderr, flush=True)

    def reporting(work: Any, what: str) -> Any:
        def worked(*given: Any) -> None:
            work(*given)
            report(what)

        return worked

    class Waiting(live_process._MessageQueue):
        """Reports a message as sent when the next one is requested: it is in the pipe then."""

        before: str | None = None

        def get(self) -> bytes | None:
            if self.before is not None:
                report(f"sent {self.before}")
            content = super().get()
            self.before = None if content is None else pickle.loads(content)[0]
            return content

    Checkpoint.save = reporting(Checkpoint.save, KEPT)
    EffectLog.write = reporting(EffectLog.write, DONE)
    live_process._MessageQueue = Waiting
    main()
