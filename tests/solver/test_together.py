"""Several cores: the same results whatever their number, and the errors of the first that failed."""

from __future__ import annotations

import threading
from dataclasses import fields, is_dataclass, replace
from functools import partial

import numba
import numpy as np
import pytest

from solver.posterior.settings import PosteriorSettings
from solver.sequence.frames import solve_sequence
from solver.together import available_cores, work_together
from tests.golden.forces import SETTINGS
from tests.solver.posterior.simulated import simulate_shear

BRIEF = PosteriorSettings(annealing=20, settling=5, kept=10)


def test_results_come_in_the_order_of_the_tasks() -> None:
    tasks = [partial(pow, k, 2) for k in range(7)]
    for workers in (1, 2, 20, None):
        assert work_together(tasks, workers) == [k**2 for k in range(7)]
    assert work_together([], 2) == []
    assert available_cores() >= 1


def test_two_tasks_run_side_by_side() -> None:
    together = threading.Barrier(2, timeout=20.0)  # [s] until it is clear that they do not
    assert sorted(work_together([together.wait, together.wait], 2)) == [0, 1]


def test_the_error_is_that_of_the_first_task_that_failed() -> None:
    def fail(name: str) -> None:
        raise ValueError(name)

    with pytest.raises(ValueError, match="first"):
        work_together([partial(fail, "first"), partial(fail, "second")], 2)


@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")
def test_threads_change_no_bit_of_a_sequence() -> None:
    shear = simulate_shear(0.25, 4)
    settings = replace(SETTINGS["ensemble"], positions="always", posterior=BRIEF, keep_members=True)
    alone, beside = (
        list(solve_sequence(shear.packing, shear.snapshots, replace(settings, workers=workers))) for workers in (1, 3)
    )
    assert len(alone) == 4
    for one, other in zip(alone, beside, strict=True):
        assert is_same(one, other)


def is_same(one: object, other: object) -> bool:
    """Whether two values are the same, bit for bit, through dataclasses and tuples."""
    if is_dataclass(one):
        return all(is_same(getattr(one, each.name), getattr(other, each.name)) for each in fields(one))
    if isinstance(one, np.ndarray):
        return np.array_equal(one, other, equal_nan=one.dtype.kind == "f")
    if isinstance(one, tuple):
        assert isinstance(other, tuple)
        return all(is_same(a, b) for a, b in zip(one, other, strict=True))
    return one == other or (one != one and other != other)
