"""One run at a time in a folder: a lock that names the process and the machine that hold it."""

from __future__ import annotations

import json
import os
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path

from .errors import RunError

try:
    import fcntl
except ImportError:  # pragma: no cover - Windows: the lock is told, but two may take it in the same moment
    fcntl = None

LOCK = ".lock"


@dataclass(frozen=True, slots=True)
class Holder:
    """A process that holds a folder."""

    process: int
    began: str  # when the process began, in the machine's own count: a number is used again by another process
    host: str

    @classmethod
    def this(cls) -> Holder:
        return cls(os.getpid(), _beginning(os.getpid()), socket.gethostname())

    @property
    def lives(self) -> bool:
        """Whether the process still runs, on this machine."""
        return _beginning(self.process) == self.began


@contextmanager
def holding(folder: Path, tell: Callable[[str], None]) -> Iterator[None]:
    """Hold a folder, which is made where there is none; one that stays empty is removed.

    tell: hears that a lock was left behind and has been taken over. Raises RunError while another process holds it.
    """
    made = [each for each in (folder, *folder.parents) if not each.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    lock = folder / LOCK
    left = _take(lock)
    try:
        if left is not None:
            tell(f"Process {left.process} ended here without a word: its lock was taken over.")
        yield
    finally:
        lock.unlink(missing_ok=True)
        with suppress(OSError):  # not empty
            for each in made:
                each.rmdir()


def _take(lock: Path) -> Holder | None:
    """Write our name into a lock; gives the dead process that it was left by, if any."""
    while True:
        handle = os.open(lock, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            if fcntl is not None:
                fcntl.flock(handle, fcntl.LOCK_EX)  # for the moment that it takes to read and write it
            if os.fstat(handle).st_nlink == 0:
                continue  # the one who held it has just gone
            holder = _read(handle)
            if holder is not None:
                _refuse_living(lock, holder)
            os.ftruncate(handle, 0)
            os.pwrite(handle, json.dumps(asdict(Holder.this())).encode(), 0)
            return holder
        finally:
            os.close(handle)


def _read(handle: int) -> Holder | None:
    try:
        told = json.loads(os.pread(handle, 10_000, 0))
        return Holder(int(told["process"]), str(told["began"]), str(told["host"]))
    except (ValueError, KeyError, TypeError, RecursionError):  # empty, or torn as it was written
        return None


def _refuse_living(lock: Path, holder: Holder) -> None:
    if holder.host != Holder.this().host:
        raise RunError(
            f"{lock.parent}: is held by process {holder.process} on {holder.host}, which cannot be asked from here; if "
            f"no run goes on there, delete {lock}"
        )
    if holder.lives:
        raise RunError(f"{lock.parent}: process {holder.process} is at work in it; wait for it, or take another --out")


def _beginning(process: int) -> str:
    """When a process began, in clock ticks since the machine did; empty: there is none."""
    try:
        told = Path(f"/proc/{process}/stat").read_text(encoding="utf-8", errors="replace")
        return told.rpartition(")")[2].split()[19]
    except (OSError, IndexError):
        return "" if not _answers(process) else "unknown"


def _answers(process: int) -> bool:
    if Path("/proc/self/stat").exists():
        return False
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
