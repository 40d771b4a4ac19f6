"""Execution of independent runs: one after the other, on several cores, or by a dask scheduler.

The result of a run depends on its case alone, not on the place or the order of execution.
"""

from __future__ import annotations

import asyncio
import multiprocessing
import multiprocessing.connection
import os
import signal
import threading
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from typing import Any, TypeVar

from ..process.errors import InputError
from ..process.signals import signal_handler

Common = TypeVar("Common")
Item = TypeVar("Item")
Result = TypeVar("Result")

SCHEDULER_TIMEOUT = 5.0  # [s] to connect

_work: Callable[[Any], Any] | None = None  # of a worker process: the function applied to each item


def run_all(
    work: Callable[[Common, Item], Result],
    common: Common,
    items: Sequence[Item],
    *,
    workers: int = 1,
    scheduler: str | None = None,
) -> Generator[tuple[int, Result], None, None]:
    """Call work(common, item) for every item. Closing the iterator ends all runs that are not finished.

    Parameters
    ----------
    work : callable
    common : Any
        First argument of every call.
    items : sequence
    workers : int
        Processes on this machine; 1: this process alone.
    scheduler : str, optional
        Address of a dask scheduler to use instead.

    Yields
    ------
    int
        Number of a finished item.
    Any
        Its result.

    Raises
    ------
    InputError
        The scheduler does not answer.
    """
    if scheduler is not None:
        yield from _on_scheduler(work, common, items, scheduler)
    elif min(workers, len(items)) > 1:
        yield from _in_processes(work, common, items, min(workers, len(items)))
    else:
        for number, item in enumerate(items):
            yield number, work(common, item)


def reach_scheduler(address: str) -> None:
    """Raise InputError unless a dask scheduler answers at the address."""
    try:
        from dask.distributed import comm  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise InputError("--scheduler", address, "needs dask: pip install 'rodsight[cluster]'") from None

    async def greet() -> None:
        await (await comm.connect(comm.normalize_address(address), timeout=SCHEDULER_TIMEOUT)).close()

    try:  # before a client exists: without a scheduler its own time limit is long
        asyncio.run(greet())
    except (OSError, ValueError) as error:
        raise InputError("--scheduler", address, f"does not answer ({type(error).__name__})") from None


def _in_processes(
    work: Callable[[Common, Item], Result], common: Common, items: Sequence[Item], workers: int
) -> Generator[tuple[int, Result], None, None]:
    # A forked process would inherit the threads of a progress bar in an undefined state.
    before = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), _start_worker, (work, common))
    finished = False
    try:
        # Workers that start here ignore Ctrl-C from the beginning: this process alone handles it.
        with signal_handler(signal.SIGINT, signal.SIG_IGN):
            numbers = {pool.submit(_run_item, item): number for number, item in enumerate(items)}
        for each in as_completed(numbers):
            yield numbers[each], each.result()
        finished = True
    finally:
        if not finished:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in set(multiprocessing.active_children()) - before:
                process.terminate()
        pool.shutdown()


def _start_worker(work: Callable[[Any, Any], Any], common: Any) -> None:
    """Prepare this worker process; it ends when its parent ends, for whatever reason."""
    global _work
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_exit_after, args=(parent.sentinel,), daemon=True).start()
    _work = lambda item: work(common, item)  # noqa: E731


def _exit_after(sentinel: int) -> None:
    """Exit when the parent process has ended: without it a worker would wait at its empty queue for ever."""
    multiprocessing.connection.wait([sentinel])
    os._exit(1)


def _run_item(item: Any) -> Any:
    assert _work is not None
    return _work(item)


def _on_scheduler(
    work: Callable[[Common, Item], Result], common: Common, items: Sequence[Item], address: str
) -> Generator[tuple[int, Result], None, None]:
    reach_scheduler(address)
    from dask import distributed  # pyright: ignore[reportMissingImports]

    with distributed.Client(address, timeout=SCHEDULER_TIMEOUT, set_as_default=False) as client:
        shared = client.scatter(common, broadcast=True)
        numbers = {client.submit(work, shared, item, pure=False): number for number, item in enumerate(items)}
        try:
            for each in distributed.as_completed(list(numbers), loop=client.loop):
                yield numbers[each], each.result()
        finally:
            client.cancel(list(numbers))
