"""Work that does not depend on each other's result, on several cores: the same results whatever their number.

Threads, for compiled kernels let others run beside them and everything stays where it is.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar, cast

Result = TypeVar("Result")


def available_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def work_together(
    tasks: Sequence[Callable[[], Result]],
    workers: int | None,
    more: Callable[[], Sequence[Callable[[], Result]]] | None = None,
) -> list[Result]:
    """The results of all tasks in their order, on so many threads; None: one for every core.

    more: makes further tasks, whose results follow; the first are under way meanwhile. Where some fail, the error is
    that of the first of them.
    """
    threads = available_cores() if workers is None else workers
    if more is None:
        threads = min(threads, len(tasks))
    if threads < 2:
        done = [task() for task in tasks]
        return done + [task() for task in (more() if more is not None else ())]
    with ThreadPoolExecutor(threads) as pool:
        begun = [pool.submit(task) for task in tasks]
        begun += [pool.submit(task) for task in (more() if more is not None else ())]
        return [each.result() for each in begun]


def one_ahead(items: Iterator[Result], workers: int | None) -> Iterator[Result]:
    """The same items, each made while the one before it is worked at; one worker: each when it is asked for.

    What making an item raises is raised in its place.
    """
    if (available_cores() if workers is None else workers) < 2:
        yield from items
        return
    ended = object()
    with ThreadPoolExecutor(1) as maker:
        coming = maker.submit(next, items, ended)
        while (item := coming.result()) is not ended:
            coming = maker.submit(next, items, ended)
            yield cast(Result, item)
