"""The folder of the compiled kernels of exactly these sources, this compiler and this processor.

The compiler itself knows only the file of a compiled function, not those of the functions that it calls: kernels kept
beside the sources would stay as they are after an edit of a function that is inlined into them.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import stat
import sys
import time
from collections.abc import Iterable
from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from .sources import hash_of_kernels

CACHE_VARIABLE = "NUMBA_CACHE_DIR"
COMPILERS = ("numba", "llvmlite")
PREFIX = "rodsight-kernels-"
KEY_LENGTH = 16  # hexadecimal digits
KEPT = 30 * 86400.0  # [s] after the last use of the kernels of other sources until they are removed
TOUCHED = 86400.0  # [s] at least between two notes that a folder is used


def choose_kernel_cache() -> None:
    """Make the compiler keep kernels in the folder of these sources: below NUMBA_CACHE_DIR, else the user's caches.

    The folder is closed to others, because the compiler executes the code it reads there.
    """
    name = f"{PREFIX}{kernel_key()}"
    for parent in _parents():
        if _make_private(parent / name):
            os.environ[CACHE_VARIABLE] = str(parent / name)
            compiler = sys.modules.get("numba")
            if compiler is not None:  # it has read the variable already
                compiler.config.CACHE_DIR = str(parent / name)
            _note_use(parent / name)
            return


def kernel_key() -> str:
    """Return the name of everything that compiled kernels depend on: sources, compiler, processor."""
    facts = [hash_of_kernels(), sys.version, *map(_version, COMPILERS), *_processor()]
    return hashlib.sha256("\n".join(facts).encode()).hexdigest()[:KEY_LENGTH]


def remove_old(parent: Path, now: float) -> None:
    """Remove kernels of other sources that were not used for a while; now: time [s] since the epoch."""
    for folder in parent.glob(f"{PREFIX}*"):
        with suppress(OSError):
            if now - folder.stat().st_mtime > KEPT:
                shutil.rmtree(folder, ignore_errors=True)


def _parents() -> Iterable[Path]:
    """Yield folders to try: the one that is set, the user's caches, a temporary one."""
    given = os.environ.get(CACHE_VARIABLE)
    if given:
        place = Path(given)
        yield place.parent if place.name.startswith(PREFIX) else place  # this program's own choice, inherited
    yield Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")) / "rodsight"
    import tempfile  # most starts need no temporary folder

    user = os.getuid() if hasattr(os, "getuid") else "user"
    yield Path(tempfile.gettempdir()) / f"rodsight-{user}"
    with suppress(OSError):  # no folder can be made: the compiler reports it
        yield Path(tempfile.mkdtemp(prefix="rodsight-"))


def _make_private(folder: Path) -> bool:
    """Make a folder, and report whether it can be written to and no other user can put anything into it."""
    try:
        for each in (folder.parent, folder):
            each.parent.mkdir(parents=True, exist_ok=True)
            each.mkdir(mode=0o700, exist_ok=True)
        return all(map(_is_private, (folder.parent, folder))) and os.access(folder, os.W_OK)
    except OSError:
        return False


def _is_private(folder: Path) -> bool:
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode):
        return False
    return not hasattr(os, "getuid") or (status.st_uid == os.getuid() and not status.st_mode & 0o022)


def _note_use(folder: Path) -> None:
    """Note that a folder is used, and remove old ones, at most once a day."""
    now = time.time()
    with suppress(OSError):
        new = not any(folder.iterdir())
        if new or now - folder.stat().st_mtime > TOUCHED:
            os.utime(folder, (now, now))
            remove_old(folder.parent, now)


def _version(name: str) -> str:
    """Return the version of an installed package by the name of its folder of facts, without importing anything."""
    spec = find_spec(name)
    if spec is None or spec.origin is None:
        return ""
    place = Path(spec.origin).parents[1]
    found = (re.fullmatch(rf"{name}-(.+)\.(?:dist|egg)-info", each) for each in os.listdir(place))
    stated = sorted(each[1] for each in found if each)
    return " ".join(stated) if stated else _imported_version(name)


def _imported_version(name: str) -> str:
    return str(import_module(name).__version__)


def _processor() -> Iterable[str]:
    """Yield what the processor is and can do."""
    machine = os.uname().machine if hasattr(os, "uname") else os.environ.get("PROCESSOR_IDENTIFIER", "")
    yield machine
    try:
        described = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").split("\n\n")[0]
    except OSError:  # the compiler names the processor in its own files, too
        return
    known = ("vendor_id", "model name", "flags", "Features", "CPU part")
    yield from (line for line in described.splitlines() if line.startswith(known))
