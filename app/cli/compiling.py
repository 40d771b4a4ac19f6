"""Count of kernels under compilation, to explain the wait of the first command after an installation."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

COMPILATION_NOTE = "Kernels are compiled once for this machine: the first run takes about a minute longer."


@contextmanager
def count_compilations(report: Callable[[int], None]) -> Iterator[None]:
    """In this context, report the number of compiled kernels at the start of every compilation."""
    from numba.core import event  # imported only where needed

    class Counter(event.Listener):
        count = 0

        def on_start(self, event: Any) -> None:
            self.count += 1
            report(self.count)

        def on_end(self, event: Any) -> None:
            """Required by numba; ends are not counted."""

    with event.install_listener("numba:compile", Counter()):
        yield
