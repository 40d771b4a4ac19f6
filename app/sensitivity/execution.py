"""Independent runs, one after the other here, on all cores, or on the machines of a dask scheduler.

What a run gives depends on its case alone, so that it is the same wherever and in whatever order runs are done.
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

from ..errors import InputError
from ..signals import answering

Common = TypeVar("Common")
Item = TypeVar("Item")
Result = TypeVar("Result")

ANSWER = 5.0  # [s] that a scheduler has to answer

_work: Callable[[Any], Any] | None = None  # of a worker process, what it does with an item


def run_all(
    work: Callable[[Common, Item], Result],
    common: Common,
    items: Sequence[Item],
    *,
    workers: int = 1,
    scheduler: str | None = None,
) -> Generator[tuple[int, Result], None, None]:
    """Do work(common, item) for every item; yields the item's number and the result, as they are finished.

    workers: processes on this machine, 1: none but this one; scheduler: address of a dask scheduler, instead.
    Closing the iterator ends whatever still runs. Raises InputError if the scheduler does not answer.
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
        await (await comm.connect(comm.normalize_address(address), timeout=ANSWER)).close()

    try:  # before there is a client: one that found nobody would take long to give up
        asyncio.run(greet())
    except (OSError, ValueError) as error:
        raise InputError("--scheduler", address, f"does not answer ({type(error).__name__})") from None


def _in_processes(
    work: Callable[[Common, Item], Result], common: Common, items: Sequence[Item], workers: int
) -> Generator[tuple[int, Result], None, None]:
    # A forked process would inherit the threads of a progress bar in whatever state they are.
    before = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), _begin, (work, common))
    finished = False
    try:
        # Workers that start meanwhile ignore Ctrl-C from their first moment on: it is for this process alone.
        with answering(signal.SIGINT, signal.SIG_IGN):
            numbers = {pool.submit(_do, item): number for number, item in enumerate(items)}
        for each in as_completed(numbers):
            yield numbers[each], each.result()
        finished = True
    finally:
        if not finished:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in set(multiprocessing.active_children()) - before:
                process.terminate()
        pool.shutdown()


def _begin(work: Callable[[Any, Any], Any], common: Any) -> None:
    """Make this worker ready. It ends with the process that asked for it, however that ends."""
    global _work
    asking = multiprocessing.parent_process()
    if asking is not None:
        threading.Thread(target=_end_with, args=(asking.sentinel,), daemon=True).start()
    _work = lambda item: work(common, item)  # noqa: E731


def _end_with(sentinel: int) -> None:
    """Wait for the end of a process, and end this one: a queue that nobody fills any more is waited at for ever."""
    multiprocessing.connection.wait([sentinel])
    os._exit(1)


def _do(item: Any) -> Any:
    assert _work is not None
    return _work(item)


def _on_scheduler(
    work: Callable[[Common, Item], Result], common: Common, items: Sequence[Item], address: str
) -> Generator[tuple[int, Result], None, None]:
    reach_scheduler(address)
    from dask import distributed  # pyright: ignore[reportMissingImports]

    with distributed.Client(address, timeout=ANSWER, set_as_default=False) as client:
        shared = client.scatter(common, broadcast=True)
        numbers = {client.submit(work, shared, item, pure=False): number for number, item in enumerate(items)}
        try:
            for each in distributed.as_completed(list(numbers), loop=client.loop):
                yield numbers[each], each.result()
        finally:
            client.cancel(list(numbers))
