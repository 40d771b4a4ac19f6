"""Who waits for the first command after an install is told why: kernels are compiled for the machine, once."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

SENTENCE = "Kernels are compiled for this machine, once: the first commands after an install take minutes longer."


@contextmanager
def hearing_of_compilation(heard: Callable[[int], None]) -> Iterator[None]:
    """While this lasts, tell how many kernels were not found compiled, each as its compilation begins."""
    from numba.core import event  # not for every start

    class Counter(event.Listener):
        count = 0

        def on_start(self, event: Any) -> None:
            self.count += 1
            heard(self.count)

        def on_end(self, event: Any) -> None:
            """Nothing is told of it."""

    with event.install_listener("numba:compile", Counter()):
        yield
