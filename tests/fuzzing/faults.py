"""Faults of the operating system: the n-th opened, renamed, removed or listed file fails, or file sizes are limited."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import h5py
import numpy as np

KINDS = {"open": "open", "os.rename": "rename", "os.mkdir": "mkdir", "os.remove": "remove", "os.listdir": "list"}
ERRORS = (errno.ENOSPC, errno.EACCES, errno.EIO)


class FileFault:
    """An audit hook that counts operations on files of a folder and makes the n-th of a kind fail once."""

    def __init__(self, folder: Path, kind: str, number: int, error: int) -> None:
        self._folder, self._kind, self._left, self._error = os.fspath(folder), kind, number, error
        self.refused = ""

    def __call__(self, event: str, given: tuple[Any, ...]) -> None:
        if KINDS.get(event) != self._kind or self.refused or not given:
            return
        name = given[0]
        if isinstance(name, bytes):
            name = os.fsdecode(name)
        if isinstance(name, str) and os.path.abspath(name).startswith(self._folder):
            if self._left == 0:
                self.refused = name
                raise OSError(self._error, os.strerror(self._error), name)
            self._left -= 1


def install_fault(fault: FileFault) -> None:
    """Install the audit hook, which cannot be removed from this process."""
    sys.addaudithook(fault)


def refuse_stores(number: int, error: int) -> None:
    """Make the n-th write of a dataset, or its reading, fail with the message of the HDF5 library."""
    left = [number]

    def failing(work: Callable[..., Any]) -> Callable[..., Any]:
        def wrapped(*given: Any, **named: Any) -> Any:
            if left[0] == 0:
                left[0] -= 1
                text = f"[Errno {error}] Can't synchronously write data (file write failed: errno = {error})"
                raise OSError(error, text)
            left[0] -= 1
            return work(*given, **named)

        return wrapped

    h5py.Group.create_dataset = failing(h5py.Group.create_dataset)  # type: ignore[method-assign]
    h5py.Dataset.__getitem__ = failing(h5py.Dataset.__getitem__)  # type: ignore[method-assign]


def limit_files(size: int) -> None:
    """Limit the size of files, as a full disk does."""
    import resource
    import signal

    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    with suppress(ValueError):
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def forces_of(out: Path) -> np.ndarray:
    with h5py.File(out / "results.h5") as store:
        return store["forces/fn"][()]
