"""Work that does not depend on each other's result, on several cores: the same results whatever their number.

Threads, for compiled kernels let others run beside them and everything stays where it is.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

Result = TypeVar("Result")


def available_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def work_together(tasks: Sequence[Callable[[], Result]], workers: int | None) -> list[Result]:
    """The results of all tasks in their order, on so many threads; None: one for every core.

    Where some fail, the error is that of the first of them.
    """
    threads = min(available_cores() if workers is None else workers, len(tasks))
    if threads < 2:
        return [task() for task in tasks]
    with ThreadPoolExecutor(threads) as pool:
        return [each.result() for each in [pool.submit(task) for task in tasks]]
