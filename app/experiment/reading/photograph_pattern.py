"""Photographs that a pattern names, and what was probably meant where it names none."""

from __future__ import annotations

import errno
import os
from collections import Counter
from pathlib import Path

from ...process.errors import InputError


def photographs_of(folder: Path, pattern: str, place: Path | str) -> list[Path]:
    """Return the files whose names match a pattern relative to a folder; InputError, at this place, for none."""
    try:
        found = _matches(folder, pattern)
    except ValueError as error:
        raise InputError(place, f"photographs.files = {pattern!r}", str(error)) from None
    except OSError as error:
        if error.errno != errno.ENAMETOOLONG:
            raise
        raise InputError(place, f"photographs.files = {pattern[:60]!r} …", "is too long for a name") from None
    for broken in sorted(file for file in found if file.is_symlink() and not file.exists()):
        raise InputError(broken, "", "is a link to a file that does not exist")
    files = [file for file in found if file.is_file()]
    if not files:
        meant = _meant(folder, pattern)
        cure = f"; write {meant!r}" if meant else ""
        raise InputError(place, f"photographs.files = {pattern!r}", f"no file matches{cure}")
    return files


def _matches(folder: Path, pattern: str) -> list[Path]:
    path = Path(pattern)
    if path.is_absolute():
        return list(Path(path.anchor).glob(str(path.relative_to(path.anchor))))
    return list(folder.glob(pattern))


def _meant(folder: Path, pattern: str) -> str:
    """Return a pattern that matches: of a folder's files, or of what is seen from the current folder; empty: none."""
    for base in (folder.absolute(), Path.cwd()):
        for each in (base / pattern, base / pattern / f"*{_commonest_suffix(base / pattern)}"):
            if any(file.is_file() for file in _matches(base, str(each))):
                return str(each) if Path(pattern).is_absolute() else Path(os.path.relpath(each, folder)).as_posix()
    return ""


def _commonest_suffix(folder: Path) -> str:
    """Return the suffix that most files of a folder have; empty: there is no such folder, or it is empty."""
    if not folder.is_dir():
        return ""
    counts = Counter(file.suffix for file in folder.iterdir() if file.is_file())
    return counts.most_common(1)[0][0] if counts else ""
