"""An interrupted command ends with one line, keeps finished frames and leaves no processes."""

from __future__ import annotations

import os
import queue
import signal
import subprocess
import sys
import threading

import pytest
from rodsight.process.signals import Stopped, signal_handler, stop_on_signals

from tests.program import KEPT, REPORTING, RODSIGHT, ROOT, rodsight, wait_for_report

FEW = ("--set", "solver.estimator=nlgs", "--set", "solver.sweeps=20000", "--sweeps", "none", "--quiet")
ENDS = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGHUP: 129}
SENT_TO_A_RUN = [signal.SIGINT, signal.SIGTERM, pytest.param(signal.SIGHUP, marks=pytest.mark.slow)]

# A process that receives a signal while it imports a module.
WHILE_IMPORTING = """
import os, sys
class Signalling:
    def find_spec(self, name, *where):
        if name == sys.argv[1]:
            os.kill(os.getpid(), int(sys.argv[2]))
sys.meta_path.insert(0, Signalling())
from rodsight.cli.main import main
main(["settings"])
"""

# A process with two workers that never finish and report their start.
WITH_WORKERS = f"""
import sys
sys.path.insert(0, {str(ROOT)!r})
if __name__ == "__main__":
    from rodsight.robustness.execution import run_all
    from tests.app.cli.test_signals import wait_for_ever
    list(run_all(wait_for_ever, None, [0, 1], workers=2))
"""


def wait_for_ever(common: None, item: int) -> None:
    os.write(sys.stdout.fileno(), b"begun\n")  # in one write, since two workers share the pipe
    threading.Event().wait()


@pytest.mark.screen
@pytest.mark.parametrize("number", SENT_TO_A_RUN, ids=lambda number: number.name)
def test_a_signal_ends_a_run_in_one_line_and_keeps_its_frames(tracked, tmp_path, number):
    out = tmp_path / "out"
    command = [*REPORTING, "solve", str(tracked), "--out", str(out), *FEW]
    run = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    wait_for_report(run, KEPT, 2)
    run.send_signal(number)
    output, errors = run.communicate(timeout=60)
    lines = [line for line in errors.splitlines() if line != KEPT]
    assert run.returncode == ENDS[number]
    assert lines == ["rodsight: interrupted; the same command resumes from here"]
    assert output == ""
    assert len(list((out / ".unfinished" / "solving").glob("*.piece"))) >= 2


@pytest.mark.screen
@pytest.mark.parametrize("module", ["tyro", "rodsight.cli.commands.study", "rich.table"])
@pytest.mark.parametrize("number", ENDS, ids=lambda number: number.name)
def test_a_signal_while_modules_are_imported_is_one_line(module, number):
    command = [sys.executable, "-c", WHILE_IMPORTING, module, str(int(number))]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (ENDS[number], "")
    assert done.stderr == "rodsight: interrupted; the same command resumes from here\n"


# A lock as those of Python's threads, which receives a signal between the steps of its change.
INTERRUPTED_LOCK = """
class Interrupted:
    held = False
    def __enter__(self):
        self.held = True
        os.kill(os.getpid(), number)
        for _ in range(1000):
            pass
        return self
    def __exit__(self, *_):
        self.held = False
def wait(gate):
    os.kill(os.getpid(), number)
    gate.get()
"""


@pytest.mark.parametrize("number", ENDS, ids=lambda number: number.name)
def test_a_signal_leaves_no_lock_held(number):
    names: dict = {"os": os, "number": number}
    exec(compile(INTERRUPTED_LOCK, threading.__file__, "exec"), names)  # as one of these modules
    lock, further = names["Interrupted"](), []

    def work() -> None:
        with stop_on_signals():
            with lock:
                further.append("changed")
            threading.Event().wait(20.0)

    with pytest.raises(Stopped) as stopped:
        work()
    assert not lock.held
    assert stopped.value.number == number


def test_a_wait_for_threads_is_interrupted():
    names: dict = {"os": os, "number": signal.SIGTERM}
    exec(compile(INTERRUPTED_LOCK, threading.__file__, "exec"), names)
    with pytest.raises(Stopped), stop_on_signals():
        names["wait"](queue.SimpleQueue())


def test_an_ignored_signal_stays_ignored():
    with signal_handler(signal.SIGHUP, signal.SIG_IGN), stop_on_signals():
        os.kill(os.getpid(), signal.SIGHUP)


def test_a_signal_during_a_destructor_is_not_lost():
    class Hidden:
        def __del__(self) -> None:
            os.kill(os.getpid(), signal.SIGTERM)
            for _ in range(1000):  # Python handles signals between bytecodes
                pass

    def wait_for_the_end() -> None:
        with stop_on_signals():
            Hidden()
            threading.Event().wait(20.0)

    with pytest.raises(Stopped) as stopped:
        wait_for_the_end()
    assert stopped.value.status == 143


@pytest.mark.screen
def test_workers_end_with_a_process_that_is_killed(tmp_path):
    script = tmp_path / "with_workers.py"
    script.write_text(WITH_WORKERS)
    run = subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True)
    assert run.stdout is not None
    assert [run.stdout.readline() for _ in range(2)] == ["begun\n"] * 2
    run.kill()
    run.communicate(timeout=30)  # the pipe is open until the last worker has ended


@pytest.mark.thorough
def test_a_closed_pipe_is_no_error():
    run = subprocess.Popen([*RODSIGHT, "settings"], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert run.stdout is not None
    assert run.stderr is not None
    run.stdout.close()
    assert run.stderr.read() == b""
    assert run.wait(60) == 1
    run.stderr.close()


def test_a_command_restores_the_signal_handlers_of_its_process(capsys):
    before = [signal.getsignal(number) for number in ENDS]
    assert rodsight("--version") == 0
    assert [signal.getsignal(number) for number in ENDS] == before
