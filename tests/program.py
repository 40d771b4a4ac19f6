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

# The same, which tells on standard error what it has just put beyond its own reach: the moment to stop it.
TELLING = (
    sys.executable, "-u", "-c",
    f"import sys; sys.path.insert(0, {str(ROOT)!r}); from tests.program import run_telling; run_telling()",
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
    told = capsys.readouterr()
    assert told.err.count("\n") == 1
    assert told.err.startswith("rodsight: ")
    assert told.out == ""
    assert not out.exists() or not any(out.iterdir())
    return told.err


def wait_until_told(process: subprocess.Popen[str], what: str, times: int) -> None:
    """Read what a TELLING process says until it has told something so many times."""
    assert process.stderr is not None
    said = []
    while said.count(what) < times:
        line = process.stderr.readline()
        assert line, f"the process ended, saying {said}"
        said.append(line.strip())


def run_telling() -> None:
    """The process of TELLING."""
    from rodsight.recording.files import live_process
    from rodsight.results.checkpoint import Checkpoint
    from rodsight.sensitivity.study import Diary

    def tell(what: str) -> None:
        print(what, file=sys.stderr, flush=True)

    def telling(work: Any, what: str) -> Any:
        def worked(*given: Any) -> None:
            work(*given)
            tell(what)

        return worked

    class Waiting(live_process._Waiting):
        """Says what was sent when it is asked for the next message: the one before is in the pipe."""

        before: str | None = None

        def get(self) -> bytes | None:
            if self.before is not None:
                tell(f"sent {self.before}")
            content = super().get()
            self.before = None if content is None else pickle.loads(content)[0]
            return content

    Checkpoint.save = telling(Checkpoint.save, KEPT)
    Diary.write = telling(Diary.write, DONE)
    live_process._Waiting = Waiting
    main()
