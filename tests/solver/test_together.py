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
from solver.together import available_cores, one_ahead, work_together
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


def test_further_tasks_are_made_while_the_first_run_and_their_results_follow() -> None:
    together = threading.Barrier(2, timeout=20.0)

    def more() -> list[partial[int]]:
        together.wait()  # for the first task, which is under way
        return [partial(pow, 3, 2), partial(pow, 4, 2)]

    assert work_together([lambda: together.wait() * 0], 2, more) == [0, 9, 16]
    assert work_together([partial(pow, 2, 2)], 1, lambda: [partial(pow, 3, 2)]) == [4, 9]


def test_an_item_is_made_while_the_one_before_it_is_worked_at() -> None:
    made = [threading.Event() for _ in range(3)]

    def items():
        for each in made:
            each.set()
            yield each

    coming = one_ahead(items(), 2)
    for k in range(2):
        next(coming)
        assert made[k + 1].wait(20.0)
    assert list(coming) == made[2:]
    assert [each.is_set() for each in made] == [True] * 3


def test_with_one_worker_an_item_is_made_when_it_is_asked_for() -> None:
    asked: list[int] = []
    coming = one_ahead((asked.append(k) or k for k in range(3)), 1)
    assert next(coming) == 0
    assert asked == [0]
    assert list(coming) == [1, 2]


@pytest.mark.parametrize("workers", [1, 2])
def test_what_making_an_item_raises_comes_in_its_place(workers: int) -> None:
    def items():
        yield None  # an item like any other
        raise ValueError("the second")

    coming = one_ahead(items(), workers)
    assert next(coming) is None
    with pytest.raises(ValueError, match="the second"):
        next(coming)


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
