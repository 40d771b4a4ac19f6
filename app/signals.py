"""Another answer to a signal for a while, and signals that end a command as an interrupt does."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from types import FrameType
from typing import Any

# What ends a command in order, by its name on this system: the key, a scheduler, a terminal that is closed.
STOPPING = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)  # fmt: skip
AGAIN = 0.01  # [s] after which an interrupt that fell into a place without a way out is tried anew


class Stopped(KeyboardInterrupt):
    """A signal asked for the end; `number` says which."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number

    @property
    def status(self) -> int:
        """The exit status by which a shell knows it."""
        return 128 + self.number


@contextmanager
def answering(number: signal.Signals, handler: Any) -> Iterator[None]:
    """Have a signal answered by handler meanwhile; no change off the main thread, which alone may set handlers."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(number, handler)
    try:
        yield
    finally:
        signal.signal(number, before)


@contextmanager
def stopping() -> Iterator[None]:
    """Have signals that ask for the end raise Stopped meanwhile; those that are ignored stay ignored (nohup)."""
    with ExitStack() as stack:
        for number in STOPPING:
            if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
                stack.enter_context(answering(number, _stop))
        stack.enter_context(_nowhere_lost())
        yield


def _stop(number: int, place: FrameType | None) -> None:
    raise Stopped(number)


@contextmanager
def _nowhere_lost() -> Iterator[None]:
    """Raise Stopped once more where it fell into a destructor or a callback, which Python would print and pass over."""
    former = sys.unraisablehook

    def heard(told: Any) -> None:
        if not isinstance(told.exc_value, Stopped):
            former(told)
        elif hasattr(signal, "setitimer"):
            number = told.exc_value.number
            signal.signal(signal.SIGALRM, lambda *_: _stop(number, None))
            signal.setitimer(signal.ITIMER_REAL, AGAIN)
        else:  # pragma: no cover - Windows
            signal.raise_signal(told.exc_value.number)

    sys.unraisablehook = heard
    try:
        yield
    finally:
        sys.unraisablehook = former
