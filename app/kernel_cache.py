"""Where compiled kernels are kept when neither the installation nor the home folder can be written to."""

from __future__ import annotations

import os
import stat
from pathlib import Path


def find_room_for_kernels(installation: Path) -> None:
    """Name a folder for compiled kernels where the usual ones cannot be written to; numba would refuse to start.

    The folder is our own and closed to others: what is read from it is run.
    """
    if "NUMBA_CACHE_DIR" in os.environ or os.access(installation, os.W_OK) or _can_be_made(_users()):
        return
    import tempfile  # not for every start

    user = os.getuid() if hasattr(os, "getuid") else "user"
    folder = Path(tempfile.gettempdir()) / f"rodsight-kernels-{user}"
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        if not _is_ours_alone(folder):
            folder = Path(tempfile.mkdtemp(prefix="rodsight-kernels-"))
    except OSError:  # nowhere at all: numba says so
        return
    os.environ["NUMBA_CACHE_DIR"] = str(folder)


def _users() -> Path:
    return Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")) / "numba"


def _can_be_made(folder: Path) -> bool:
    there = next((each for each in (folder, *folder.parents) if each.exists()), None)
    return there is not None and there.is_dir() and os.access(there, os.W_OK)


def _is_ours_alone(folder: Path) -> bool:
    told = folder.lstat()
    if not stat.S_ISDIR(told.st_mode):
        return False
    return not hasattr(os, "getuid") or (told.st_uid == os.getuid() and not told.st_mode & 0o077)
