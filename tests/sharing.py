"""Experiments that are simulated once for all processes of a test run: each copies them."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable
from pathlib import Path

import pytest

POLL = 0.05  # [s]
PATIENCE = 120.0  # [s] with the process that makes it


def made_once(factory: pytest.TempPathFactory, name: str, make: Callable[[Path], object]) -> Path:
    """Return a folder of this process with what `make` writes into it; of several processes, the first one makes it."""
    own = factory.mktemp("synthetic") / name
    if "PYTEST_XDIST_WORKER" not in os.environ:
        make(own)
        return own
    shared = factory.getbasetemp().parent / f"made_once_{name}"
    try:
        shared.mkdir()
    except FileExistsError:
        until = time.monotonic() + PATIENCE
        while not (shared / name).exists() and time.monotonic() < until:
            time.sleep(POLL)
    else:
        make(shared / "unfinished" / name)
        (shared / "unfinished" / name).rename(shared / name)
    if (shared / name).exists():
        shutil.copytree(shared / name, own)
    else:  # the first one failed: fail in the same way
        make(own)
    return own
