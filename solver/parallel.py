"""Parallel execution of independent tasks in threads; results do not depend on the number of threads.

Threads suffice because compiled kernels release the global interpreter lock, and no data is copied.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar, cast

Result = TypeVar("Result")


def available_cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def parallel_map(
    tasks: Sequence[Callable[[], Result]],
    workers: int | None,
    further: Callable[[], Sequence[Callable[[], Result]]] | None = None,
) -> list[Result]:
    """Run tasks in threads and return their results in order.

    Parameters
    ----------
    tasks : sequence of callables
        Independent tasks.
    workers : int or None
        Number of threads; None: one per core.
    further : callable, optional
        Creates further tasks while the first ones run; their results follow.

    Raises
    ------
    Exception
        The error of the first task, in order, that failed.
    """
    threads = available_cores() if workers is None else workers
    if further is None:
        threads = min(threads, len(tasks))
    if threads < 2:
        results = [task() for task in tasks]
        return results + [task() for task in (further() if further is not None else ())]
    with ThreadPoolExecutor(threads) as pool:
        futures = [pool.submit(task) for task in tasks]
        futures += [pool.submit(task) for task in (further() if further is not None else ())]
        return [each.result() for each in futures]


def prefetch(items: Iterator[Result], workers: int | None) -> Iterator[Result]:
    """Iterate over items, computing each one in a thread while the consumer uses the previous one.

    With one worker, items are computed on demand. An error in computing an item is raised in its place.
    """
    if (available_cores() if workers is None else workers) < 2:
        yield from items
        return
    end = object()
    with ThreadPoolExecutor(1) as executor:
        upcoming = executor.submit(next, items, end)
        while (item := upcoming.result()) is not end:
            upcoming = executor.submit(next, items, end)
            yield cast(Result, item)
