"""Temporary signal handlers, and signals that end a command as an interrupt does."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from types import FrameType
from typing import Any

# Signals that end a command in order, where this system has them: Ctrl+C, a scheduler, a closed terminal.
STOP_SIGNALS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)  # fmt: skip
RETRY_DELAY = 0.01  # [s] after which Stopped is raised again where Python had ignored it


class Stopped(KeyboardInterrupt):
    """A signal ended the process; `number` is the signal's number."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number

    @property
    def status(self) -> int:
        """Exit status of a process that this signal ended, by the shell's convention."""
        return 128 + self.number


@contextmanager
def signal_handler(number: signal.Signals, handler: Any) -> Iterator[None]:
    """Handle a signal by `handler` inside the block; only the main thread may set handlers, others change nothing."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    former = signal.signal(number, handler)
    try:
        yield
    finally:
        signal.signal(number, former)


@contextmanager
def stop_on_signals() -> Iterator[None]:
    """Raise Stopped on STOP_SIGNALS inside the block; signals that are ignored stay ignored (nohup)."""
    with ExitStack() as stack:
        for number in STOP_SIGNALS:
            if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
                stack.enter_context(signal_handler(number, _stop))
        stack.enter_context(_raise_ignored_again())
        yield


def _stop(number: int, frame: FrameType | None) -> None:
    raise Stopped(number)


@contextmanager
def _raise_ignored_again() -> Iterator[None]:
    """Raise Stopped again where it came up in a destructor or a callback, from which Python prints and ignores it."""
    former = sys.unraisablehook

    def raise_again(unraisable: Any) -> None:
        if not isinstance(unraisable.exc_value, Stopped):
            former(unraisable)
        elif hasattr(signal, "setitimer"):
            number = unraisable.exc_value.number
            signal.signal(signal.SIGALRM, lambda *_: _stop(number, None))
            signal.setitimer(signal.ITIMER_REAL, RETRY_DELAY)
        else:  # pragma: no cover - Windows
            signal.raise_signal(unraisable.exc_value.number)

    sys.unraisablehook = raise_again
    try:
        yield
    finally:
        sys.unraisablehook = former
