"""Temporary signal handlers, and signals that end a command as an interrupt does."""

from __future__ import annotations

import os
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
RETRY_DELAY = 0.01  # [s] after which a stop is tried again where Python ignored it, or locks were being changed
# Attempts at one place until it counts as a wait, in which an exception leaves locks as they should be.
WAITING = 10
# Python's own modules that change locks in steps: an exception between two of them leaves a lock held for ever.
LOCKING = tuple(
    os.path.join(os.path.dirname(threading.__file__), name)
    for name in ("threading.py", "queue.py", os.path.join("concurrent", "futures"))
)


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
    """Raise Stopped on STOP_SIGNALS inside the block; signals that are ignored stay ignored (nohup).

    Where a lock of Python's threads is being changed, Stopped is raised once that is done.
    """
    attempt = _Attempt()
    with ExitStack() as stack:
        for number in STOP_SIGNALS:
            if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
                stack.enter_context(signal_handler(number, attempt.stop))
        stack.enter_context(_raise_ignored_again(attempt))
        stack.callback(attempt.forget)
        yield


class _Attempt:
    """Attempts to stop the main thread at a place where an exception does no harm."""

    def __init__(self) -> None:
        self._place: tuple[int, int] | None = None
        self._count = 0
        self._is_waiting = False

    def stop(self, number: int, frame: FrameType | None) -> None:
        """Raise Stopped, or try again later while the main thread changes locks."""
        if frame is not None and frame.f_code.co_filename.startswith(LOCKING) and hasattr(signal, "setitimer"):
            place = (id(frame), frame.f_lasti)
            self._count = self._count + 1 if place == self._place else 1
            self._place = place
            if self._count < WAITING:
                self.try_again(number)
                return
        raise Stopped(number)

    def try_again(self, number: int) -> None:
        """Attempt it once more after RETRY_DELAY."""
        if hasattr(signal, "setitimer"):
            self._is_waiting = True
            signal.signal(signal.SIGALRM, lambda _, frame: self.stop(number, frame))
            signal.setitimer(signal.ITIMER_REAL, RETRY_DELAY)
        else:  # pragma: no cover - Windows
            signal.raise_signal(number)

    def forget(self) -> None:
        """End the attempts: the block is left."""
        if self._is_waiting:
            signal.setitimer(signal.ITIMER_REAL, 0.0)


@contextmanager
def _raise_ignored_again(attempt: _Attempt) -> Iterator[None]:
    """Raise Stopped again where it came up in a destructor or a callback, from which Python prints and ignores it."""
    former = sys.unraisablehook

    def raise_again(unraisable: Any) -> None:
        if isinstance(unraisable.exc_value, Stopped):
            attempt.try_again(unraisable.exc_value.number)
        else:
            former(unraisable)

    sys.unraisablehook = raise_again
    try:
        yield
    finally:
        sys.unraisablehook = former
