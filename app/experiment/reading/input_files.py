"""Input files as they were read: one content for a whole run, whatever happens to the files meanwhile."""

from __future__ import annotations

import hashlib
import stat
from collections.abc import Callable
from pathlib import Path

from ...errors import InputError, RunError


def ordinary(file: Path) -> Path:
    """The file, if it is none that never ends or answers, such as a device or a pipe. Raises InputError, OSError."""
    kind = file.stat().st_mode
    if not (stat.S_ISREG(kind) or stat.S_ISDIR(kind)):  # a folder is refused by whoever opens it
        raise InputError(file, "", "is a device or a pipe, not a file")
    return file


class InputFiles:
    """Reads input files and keeps the hash of the very bytes that it handed out.

    A file that is read again must still be what it was: nothing is ever made from one content and filed under the hash
    of another.
    """

    def __init__(self) -> None:
        self._sums: dict[Path, str] = {}  # SHA-256 by file
        self._listed: dict[str, tuple[Path, ...]] = {}

    def read(self, file: Path) -> bytes:
        """The bytes of a file. Raises OSError, and RunError where it has changed since it was first read."""
        content = ordinary(file).read_bytes()
        digest = hashlib.sha256(content).hexdigest()
        if self._sums.setdefault(file, digest) != digest:
            raise RunError(
                f"{file}: has changed while it was in use; the same command starts again with what it is now"
            )
        return content

    def checksum(self, file: Path) -> str:
        """SHA-256 of a file, as it was first read. Raises OSError."""
        if file not in self._sums:
            self.read(file)
        return self._sums[file]

    def listed(self, pattern: str, find: Callable[[], tuple[Path, ...]]) -> tuple[Path, ...]:
        """The files that match a pattern, as they were first found."""
        if pattern not in self._listed:
            self._listed[pattern] = find()
        return self._listed[pattern]
