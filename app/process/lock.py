"""A lock file that lets one process at a time work in a folder and names that process and its machine.

The lock is held in three ways, because no one of them works everywhere: the system locks the open file until its
process ends, also for other containers of this machine and on most shared disks; a process of the same machine and the
same container is looked up; and the holder renews the file's time, a lease that others see on any disk.
"""

from __future__ import annotations

import ctypes
import json
import os
import socket
import subprocess
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path

from .errors import RunError
from .links import refuse_link

try:
    import fcntl
except ImportError:  # pragma: no cover - Windows: two processes may take the lock at the same moment
    fcntl = None

LOCK = ".lock"
LEASE = 600.0  # [s] without renewal after which a lock is free whose process cannot be looked up
RENEWAL = 20.0  # [s] between two renewals


@dataclass(frozen=True, slots=True)
class Holder:
    """The process that holds a folder."""

    process: int
    began: str  # start of the process in clock ticks since boot: process numbers are used again
    host: str
    boot: str = ""  # of the machine's system; empty in locks of earlier versions
    container: str = ""  # of process numbers

    @classmethod
    def this(cls) -> Holder:
        """Return the current process."""
        return cls.of(os.getpid())

    @classmethod
    def of(cls, process: int) -> Holder:
        """Return a process of this machine by its number."""
        return cls(process, _start_time(process), socket.gethostname(), _boot(), _container())

    @property
    def is_alive(self) -> bool:
        """Whether the process still runs on this machine."""
        return _start_time(self.process) == self.began

    @property
    def is_near(self) -> bool:
        """Whether the process, if it runs, can be looked up from here."""
        this = Holder.this()
        if not self.boot:
            return self.host == this.host
        return (self.boot, self.container) == (this.boot, this.container)


@contextmanager
def hold_folder(folder: Path, notify: Callable[[str], None]) -> Iterator[None]:
    """Hold a folder inside the block. The folder is created where it is missing, and removed if it stays empty.

    Parameters
    ----------
    folder
        The folder to hold.
    notify
        Receives a sentence if the lock of a dead process was taken over.

    Raises
    ------
    RunError
        Another process holds the folder, or took it over while this one was suspended for longer than its lease.
    """
    made = [each for each in (folder, *folder.parents) if not each.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    lock = folder / LOCK
    this = Holder.this()
    handle, dead = _take(lock, this)
    ended = threading.Event()
    renewal = threading.Thread(target=_renew, args=(handle, this, ended, threading.get_ident()), daemon=True)
    _held.add(handle)
    renewal.start()
    try:
        if dead is not None:
            notify(f"Process {dead.process} ended without releasing this folder: its lock was taken over.")
        yield
    except _TakenOver:
        raise RunError(f"{folder}: another process took it over while this one was suspended") from None
    finally:
        ended.set()
        renewal.join()
        if not _is_taken(handle, this):
            lock.unlink(missing_ok=True)
        _held.discard(handle)
        os.close(handle)
        with suppress(OSError):  # not empty
            for each in made:
                each.rmdir()


_held: set[int] = set()  # open locks of this process


def _close_in_child() -> None:
    """Close the locks of the parent: a child that outlives it does not hold its folder."""
    for handle in _held:
        with suppress(OSError):
            os.close(handle)
    _held.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_close_in_child)


def _take(lock: Path, this: Holder) -> tuple[int, Holder | None]:
    """Open a lock and write this process into it; return the dead process that left the lock, if any."""
    while True:
        refuse_link(lock)  # the file at its end would be emptied
        handle = os.open(lock, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o644)
        try:
            locked = _lock(handle)
            if fcntl is not None and os.fstat(handle).st_nlink == 0:  # its holder has just removed it
                os.close(handle)
                continue
            holder = _read(handle)
            if not locked and holder is None:
                raise RunError(f"{lock.parent}: another process works in it; wait for it, or choose another --out")
            if not locked and holder is not None:
                raise _in_use(lock, holder)
            if holder is not None:
                _refuse_living(lock, handle, holder)
            os.ftruncate(handle, 0)
            os.lseek(handle, 0, os.SEEK_SET)
            os.write(handle, json.dumps(asdict(this)).encode())
        except BaseException:
            with suppress(OSError):
                os.close(handle)
            raise
        return handle, holder


def _lock(handle: int) -> bool:
    """Lock an open file until it is closed, also by the end of the process; False where another process holds it."""
    if fcntl is None:
        return True
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # this disk has no locks
        return True
    return True


class _TakenOver(BaseException):
    """Ends the block of a thread whose folder another process took over; no handler of errors may go on."""


def _renew(handle: int, this: Holder, ended: threading.Event, thread: int) -> None:
    """Renew the lease until the end of the block; end the block where another process took the folder over."""
    while not ended.wait(RENEWAL):
        if _is_taken(handle, this):
            # Not the signal of Ctrl+C, which a process in the background ignores.
            ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), ctypes.py_object(_TakenOver))
            return
        with suppress(OSError):  # the disk is away for a while
            os.utime(handle)


def _is_taken(handle: int, this: Holder) -> bool:
    """Whether another process stands in a lock that this one took: its lease expired while this one was suspended.

    It is compared with what was written: an emulator (QEMU) gives each thread another start of its process.
    """
    try:
        holder = _read(handle)
    except OSError:  # the disk is away for a while
        return False
    return holder is not None and holder != this


def _read(handle: int) -> Holder | None:
    try:
        os.lseek(handle, 0, os.SEEK_SET)  # pread and pwrite are missing on Windows
        stored = json.loads(os.read(handle, 10_000))
        place = (str(stored.get(key, "")) for key in ("boot", "container"))
        return Holder(int(stored["process"]), str(stored["began"]), str(stored["host"]), *place)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):  # empty, or written in part
        return None


def _refuse_living(lock: Path, handle: int, holder: Holder) -> None:
    """Raise RunError unless the process is known to have ended, or its lease has expired."""
    if holder.is_near:
        if holder.is_alive:
            raise _in_use(lock, holder)
        return
    if not holder.boot:  # of an earlier version, which renewed nothing
        silence = 0.0
    else:
        silence = _time_of_disk(lock) - os.fstat(handle).st_mtime
    if silence < LEASE:
        raise RunError(
            f"{lock.parent}: is held by process {holder.process} on {holder.host}, which cannot be checked from here; "
            f"if no run is active there, delete {lock}"
        )


def _in_use(lock: Path, holder: Holder) -> RunError:
    process = f"{holder.process}{'' if holder.is_near else f' of {holder.host}'}"
    return RunError(f"{lock.parent}: process {process} works in it; wait for it, or choose another --out")


def _time_of_disk(lock: Path) -> float:
    """Return the present time [s] by the clock that stamps files of this folder."""
    probe = lock.with_name(f"{LOCK}.{os.getpid()}.part")
    try:
        probe.touch()
        return probe.stat().st_mtime
    finally:
        probe.unlink(missing_ok=True)


def _boot() -> str:
    """Return the name of the running system since its start; where it has none, that of the machine."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text(encoding="utf-8").strip()
    except OSError:
        return socket.gethostname()


def _container() -> str:
    """Return the name of the set of process numbers that this process sees."""
    try:
        return str(os.stat("/proc/self/ns/pid").st_ino)
    except OSError:
        return ""


def _start_time(process: int) -> str:
    """Return when a process started, in clock ticks since boot; empty where there is no such process."""
    try:
        status = Path(f"/proc/{process}/stat").read_text(encoding="utf-8", errors="replace")
        fields = status.rpartition(")")[2].split()
        return "" if fields[0] == "Z" else fields[19]  # Z: it has ended, and nobody has read its status
    except (OSError, IndexError):
        return "" if not _exists_without_proc(process) else "unknown"


def _exists_without_proc(process: int) -> bool:
    """Whether a process exists, on systems without /proc."""
    if Path("/proc/self/stat").exists():
        return False
    if os.name == "nt":  # there os.kill(process, 0) ends the process
        return _exists_on_windows(process)
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


def _exists_on_windows(process: int) -> bool:
    """Whether a process exists; True where Windows does not answer, so that its folder stays closed."""
    listed = subprocess.run(
        ["tasklist", "/FI", f"PID eq {process}", "/NH", "/FO", "CSV"], capture_output=True, text=True, check=False
    )
    return listed.returncode != 0 or f'"{process}"' in listed.stdout
