"""Linear algebra uses one thread while forces are inferred, and in every process of the command."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from rodsight.process.machine.linear_algebra import one_thread_each
from threadpoolctl import threadpool_info, threadpool_limits


def _threads() -> set[int]:
    return {each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"}


def test_a_decorated_function_has_one_thread_and_leaves_as_many_as_before() -> None:
    with threadpool_limits(2, user_api="blas"):
        before = _threads()
        assert one_thread_each(_threads)() == {1}
        assert _threads() == before != {1}


def test_input_is_checked_and_forces_are_inferred_with_one_thread() -> None:
    from rodsight.inference.diagnosis.diagnose import diagnose, diagnose_solved
    from rodsight.inference.diagnosis.trial import solve_trial
    from rodsight.inference.infer_sequence import infer_sequence
    from rodsight.pipeline import check
    from rodsight.prediction import predict_accuracy

    for function in (infer_sequence, solve_trial, diagnose, diagnose_solved, check, predict_accuracy):
        assert hasattr(function, "__wrapped__")


@pytest.mark.thorough
@pytest.mark.parametrize(("name", "usual"), [("OPENBLAS_NUM_THREADS", "1"), ("MIMALLOC_PURGE_DELAY", "0")])
def test_the_command_sets_up_the_libraries_that_it_loads_unless_the_user_has(name: str, usual: str) -> None:
    code = (
        "import contextlib, os; from rodsight.cli.main import main\n"
        "with contextlib.suppress(SystemExit): main(['--version'])\n"
        f"print(os.environ['{name}'])"
    )
    for chosen, expected in (({}, usual), ({name: "3"}, "3")):
        environment = {each: value for each, value in os.environ.items() if each != name} | chosen
        found = subprocess.run(
            [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
        )  # fmt: skip
        assert found.stdout.split()[-1] == expected
