"""Parallel execution: results do not depend on the number of threads, and the first error is raised."""

from __future__ import annotations

import threading
from dataclasses import fields, is_dataclass, replace
from functools import partial

import numba
import numpy as np
import pytest
from rodsight.solver.parallel import available_cores, parallel_map, prefetch
from rodsight.solver.posterior.posterior_settings import PosteriorSettings
from rodsight.solver.sequence.frames import solve_sequence

from tests.golden.forces import SETTINGS
from tests.solver.posterior.simulated import simulate_shear

SHORT_CHAIN = PosteriorSettings(annealing=20, burn_in=5, kept=10)


def test_results_come_in_the_order_of_the_tasks() -> None:
    tasks = [partial(pow, k, 2) for k in range(7)]
    for workers in (1, 2, 20, None):
        assert parallel_map(tasks, workers) == [k**2 for k in range(7)]
    assert parallel_map([], 2) == []
    assert available_cores() >= 1


def test_two_tasks_run_in_parallel() -> None:
    barrier = threading.Barrier(2, timeout=20.0)  # [s] timeout if they do not
    assert sorted(parallel_map([barrier.wait, barrier.wait], 2)) == [0, 1]


def test_further_tasks_are_created_while_the_first_run() -> None:
    barrier = threading.Barrier(2, timeout=20.0)

    def further() -> list[partial[int]]:
        barrier.wait()  # for the first task, which is running
        return [partial(pow, 3, 2), partial(pow, 4, 2)]

    assert parallel_map([lambda: barrier.wait() * 0], 2, further) == [0, 9, 16]
    assert parallel_map([partial(pow, 2, 2)], 1, lambda: [partial(pow, 3, 2)]) == [4, 9]


def test_an_item_is_computed_while_the_previous_one_is_used() -> None:
    computed_items = [threading.Event() for _ in range(3)]

    def items():
        for each in computed_items:
            each.set()
            yield each

    upcoming = prefetch(items(), 2)
    for k in range(2):
        next(upcoming)
        assert computed_items[k + 1].wait(20.0)
    assert list(upcoming) == computed_items[2:]
    assert [each.is_set() for each in computed_items] == [True] * 3


def test_with_one_worker_an_item_is_computed_on_request() -> None:
    computed: list[int] = []
    upcoming = prefetch((computed.append(k) or k for k in range(3)), 1)
    assert next(upcoming) == 0
    assert computed == [0]
    assert list(upcoming) == [1, 2]


@pytest.mark.parametrize("workers", [1, 2])
def test_an_error_of_an_item_is_raised_in_its_place(workers: int) -> None:
    def items():
        yield None  # an item like any other
        raise ValueError("the second")

    upcoming = prefetch(items(), workers)
    assert next(upcoming) is None
    with pytest.raises(ValueError, match="the second"):
        next(upcoming)


def test_the_error_is_that_of_the_first_failed_task() -> None:
    def fail(name: str) -> None:
        raise ValueError(name)

    with pytest.raises(ValueError, match="first"):
        parallel_map([partial(fail, "first"), partial(fail, "second")], 2)


@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")
def test_threads_change_no_bit_of_a_sequence() -> None:
    shear = simulate_shear(0.25, 4)
    settings = replace(SETTINGS["ensemble"], positions="always", posterior=SHORT_CHAIN, keep_members=True)
    single, threaded = (
        list(solve_sequence(shear.packing, shear.snapshots, replace(settings, workers=workers))) for workers in (1, 3)
    )
    assert len(single) == 4
    for one, other in zip(single, threaded, strict=True):
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
