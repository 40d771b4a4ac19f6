"""A command that is asked to end says so in one line, keeps what it has, and leaves nobody behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading

import pytest
from rodsight.signals import Stopped, answering, stopping

from tests.program import KEPT, RODSIGHT, ROOT, TELLING, rodsight, wait_until_told

FEW = ("--set", "solver.estimator=nlgs", "--set", "solver.sweeps=20000", "--sweeps", "none", "--quiet")
ENDS = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGHUP: 129}

# A process that is asked to end at the moment when it imports a module.
WHILE_IMPORTING = """
import os, sys
class Asking:
    def find_spec(self, name, *where):
        if name == sys.argv[1]:
            os.kill(os.getpid(), int(sys.argv[2]))
sys.meta_path.insert(0, Asking())
from rodsight.cli.main import main
main(["settings"])
"""

# A process with two workers that never finish; they tell when they have begun.
WITH_WORKERS = f"""
import sys
sys.path.insert(0, {str(ROOT)!r})
if __name__ == "__main__":
    from rodsight.sensitivity.execution import run_all
    from tests.app.cli.test_signals import wait_for_ever
    list(run_all(wait_for_ever, None, [0, 1], workers=2))
"""


def wait_for_ever(common: None, item: int) -> None:
    os.write(sys.stdout.fileno(), b"begun\n")  # at once: two workers share the pipe
    threading.Event().wait()


@pytest.mark.screen
@pytest.mark.parametrize("number", ENDS, ids=lambda number: number.name)
def test_a_signal_ends_a_run_in_one_line_and_keeps_its_frames(tracked, tmp_path, number):
    out = tmp_path / "out"
    command = [*TELLING, "solve", str(tracked), "--out", str(out), *FEW]
    run = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    wait_until_told(run, KEPT, 2)
    run.send_signal(number)
    told, said = run.communicate(timeout=60)
    lines = [line for line in said.splitlines() if line != KEPT]
    assert run.returncode == ENDS[number]
    assert lines == ["rodsight: interrupted; the same command goes on from here"]
    assert told == ""
    assert len(list((out / ".unfinished" / "solving").glob("*.piece"))) >= 2


@pytest.mark.screen
@pytest.mark.parametrize("module", ["tyro", "rodsight.cli.commands.study", "rich.table"])
@pytest.mark.parametrize("number", ENDS, ids=lambda number: number.name)
def test_a_signal_while_modules_are_imported_is_one_line(module, number):
    command = [sys.executable, "-c", WHILE_IMPORTING, module, str(int(number))]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (ENDS[number], "")
    assert done.stderr == "rodsight: interrupted; the same command goes on from here\n"


def test_a_signal_that_was_ignored_stays_so():
    with answering(signal.SIGHUP, signal.SIG_IGN), stopping():
        os.kill(os.getpid(), signal.SIGHUP)


def test_a_signal_that_falls_into_a_destructor_is_not_lost():
    class Hidden:
        def __del__(self) -> None:
            os.kill(os.getpid(), signal.SIGTERM)
            for _ in range(1000):  # Python answers a signal between two of its steps
                pass

    def wait_for_the_end() -> None:
        with stopping():
            Hidden()
            threading.Event().wait(20.0)

    with pytest.raises(Stopped) as told:
        wait_for_the_end()
    assert told.value.status == 143


@pytest.mark.screen
def test_workers_end_with_a_process_that_is_killed(tmp_path):
    script = tmp_path / "with_workers.py"
    script.write_text(WITH_WORKERS)
    run = subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True)
    assert run.stdout is not None
    assert [run.stdout.readline() for _ in range(2)] == ["begun\n"] * 2
    run.kill()
    run.communicate(timeout=30)  # the pipe is open until the last worker has ended


def test_a_reader_who_has_had_enough_is_no_fault():
    run = subprocess.Popen([*RODSIGHT, "settings"], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert run.stdout is not None
    assert run.stderr is not None
    run.stdout.close()
    assert run.stderr.read() == b""
    assert run.wait(60) == 1
    run.stderr.close()


def test_in_this_process_a_command_leaves_the_answers_to_signals_as_they_were(capsys):
    before = [signal.getsignal(number) for number in ENDS]
    assert rodsight("--version") == 0
    assert [signal.getsignal(number) for number in ENDS] == before
