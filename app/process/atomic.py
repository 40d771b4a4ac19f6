"""Atomic writes: a file, or a folder, appears whole or not at all."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PART = ".part"  # suffix of a file that is being written


@contextmanager
def replacing(file: Path) -> Iterator[Path]:
    """Give a temporary path to write to, which replaces `file` once the block ends without an error.

    An error of the disk names `file`, which the user knows, and not the temporary path.
    """
    file.parent.mkdir(parents=True, exist_ok=True)
    part = file.with_name(file.name + PART)
    part.unlink(missing_ok=True)  # of a process that was killed; or a link, through which it would be written elsewhere
    try:
        yield part
        os.replace(part, file)
    except OSError as error:
        _name_instead(error, part, file)
        raise
    finally:
        part.unlink(missing_ok=True)


@contextmanager
def replacing_folder(folder: Path) -> Iterator[Path]:
    """Give a temporary folder to fill, which becomes `folder` once the block ends without an error.

    Where the folder exists already, its files are replaced one by one at the end. An error of the disk names `folder`.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    part = folder.with_name(f".{folder.name}{PART}")
    shutil.rmtree(part, ignore_errors=True)  # of a process that was killed
    try:
        part.mkdir()
        yield part
        if folder.is_dir():
            _move_into(part, folder)
        else:
            os.replace(part, folder)
    except OSError as error:
        _name_instead(error, part, folder)
        raise
    finally:
        shutil.rmtree(part, ignore_errors=True)


def _name_instead(error: OSError, part: Path, target: Path) -> None:
    """Replace a temporary path, files inside it, and files whose names begin with it by the target's in an error."""
    for attribute in ("filename", "filename2"):
        name = str(getattr(error, attribute) or "")
        if name.startswith(f"{part}{os.sep}"):
            setattr(error, attribute, f"{target}{name.removeprefix(str(part))}")
        elif name.startswith(str(part)):
            setattr(error, attribute, str(target))


def _move_into(source: Path, target: Path) -> None:
    """Move every file of a folder into another one."""
    target.mkdir(exist_ok=True)
    for each in source.iterdir():
        if each.is_dir():
            _move_into(each, target / each.name)
        else:
            os.replace(each, target / each.name)


def write_atomically(file: Path, *parts: bytes | memoryview) -> None:
    """Replace a file by these bytes. Raises OSError with the name of the file that could not be written."""
    with replacing(file) as part:
        try:
            with part.open("wb") as stream:
                stream.writelines(parts)
        except OSError as error:
            if error.filename is None:  # an error of write() carries no name
                error.filename = str(part)
            raise
