"""Read input files with one content for a whole run: a file that changes during the run is refused."""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Callable, Sequence
from pathlib import Path

from ...process.errors import InputError, RunError


def regular(file: Path) -> Path:
    """Return the file if it is neither a device nor a pipe, which may never end. Raises InputError, OSError."""
    kind = file.stat().st_mode
    if not (stat.S_ISREG(kind) or stat.S_ISDIR(kind)):  # opening a folder raises its own error
        raise InputError(file, "", "is a device or a pipe, not a file")
    return file


def read_text_file(file: Path) -> bytes:
    """Return the bytes of a text file. Raises InputError where it is empty or has holes, OSError.

    A hole is read as NULs, which no text holds, and takes no disk: the file can be larger than any memory.
    """
    if hasattr(os, "SEEK_HOLE"):
        with regular(file).open("rb") as stream:
            size = os.fstat(stream.fileno()).st_size
            hole = os.lseek(stream.fileno(), 0, os.SEEK_HOLE) if size else 0
        if hole < size:
            raise InputError(file, "", f"is no text: it has a hole at byte {hole} of {size}")
    content = regular(file).read_bytes()
    if not content:
        raise InputError(file, "", "is empty: it has 0 bytes")
    return content


class InputFiles:
    """Reader of input files that keeps the hash of the bytes it returned.

    A file that is read again must be unchanged, so that no result is stored under the hash of another content.

    Parameters
    ----------
    root : Path, optional
        Folder outside of which nothing is read, wherever `..`, links and absolute names lead.
    """

    def __init__(self, root: Path | None = None) -> None:
        self._root = None if root is None else root.resolve()
        self._sums: dict[Path, str] = {}  # SHA-256 by file
        self.unused_columns: dict[Path, tuple[str, ...]] = {}  # of tables: names that nothing has read
        self._listed: dict[str, tuple[Path, ...]] = {}
        self.intact: set[tuple[Path, ...]] = set()  # photographs that were read whole, all of one size

    def refuse_outside(self, file: Path) -> None:
        """Raise InputError for a file outside of the root."""
        if self._root is None:
            return
        try:
            inside = file.resolve().is_relative_to(self._root)
        except (OSError, ValueError, RuntimeError):  # a name that no file can have, or links in a circle
            raise InputError(file, "", "is no name of a file") from None
        if not inside:
            raise InputError(file, "", f"lies outside of {self._root}: open the folder that holds both")

    def read(self, file: Path, *, text: bool = False) -> bytes:
        """Return the bytes of a file; text: it is one, and has no holes.

        Raises OSError, InputError outside of the root, and RunError where it has changed since it was first read.
        """
        self.refuse_outside(file)
        content = read_text_file(file) if text else regular(file).read_bytes()
        digest = hashlib.sha256(content).hexdigest()
        if self._sums.setdefault(file, digest) != digest:
            raise RunError(
                f"{file}: has changed while it was in use; run the same command again, which uses the new content"
            )
        return content

    def note_columns(self, file: Path, unused: Sequence[str]) -> None:
        """Note the columns of a table that its reader does not use; another reader of the file may use them."""
        former = self.unused_columns.get(file)
        self.unused_columns[file] = tuple(name for name in unused if former is None or name in former)

    def checksum(self, file: Path) -> str:
        """Return the SHA-256 of a file as it was first read. Raises OSError."""
        if file not in self._sums:
            self.read(file)
        return self._sums[file]

    def listed(self, pattern: str, find: Callable[[], tuple[Path, ...]]) -> tuple[Path, ...]:
        """Return the files that match a pattern, as they were first found. Raises InputError outside of the root."""
        if pattern not in self._listed:
            self._listed[pattern] = find()
            for file in self._listed[pattern]:
                self.refuse_outside(file)
        return self._listed[pattern]
