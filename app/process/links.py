"""Links and files in the place of folders: the program makes no links, and follows none that lead elsewhere."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from .errors import InputError


def refuse_links(folder: Path, root: Path) -> None:
    """Raise InputError where a folder of the program's own files holds a link, or is one, that leads outside of a root.

    Hidden folders in it, and `contents`, are searched, too; files in them are replaced, not written to.
    """
    for place in (folder, *_links(folder)):
        if os.path.islink(place) and not _is_inside(place, root):  # no error for a name that no file can have
            raise InputError(place, "", f"is a link that leads outside of {root}: remove it")


def refuse_link(place: Path) -> None:
    """Raise InputError for a link in the place of a file or folder of the program's own."""
    if os.path.islink(place):
        raise InputError(place, "", "is a link, and belongs to the program: remove it")


def refuse_file(folder: Path) -> None:
    """Raise InputError where a folder of results is a file, or would be below one."""
    existing = next((each for each in (folder, *folder.parents) if os.path.lexists(each)), None)
    if existing is not None and not existing.is_dir():
        raise InputError(existing, "", "is a file, not a folder: choose a folder for the results with --out")


def _links(folder: Path) -> Iterator[Path]:
    try:
        with os.scandir(folder) as found:
            entries = list(found)
    except (OSError, ValueError):  # it is missing, may not be read, or has a name that no file can have
        return
    for each in entries:
        if each.is_symlink():
            yield Path(each.path)
        elif (each.name.startswith(".") or each.name == "contents") and each.is_dir(follow_symlinks=False):
            with os.scandir(each.path) as inner:
                yield from (Path(one.path) for one in inner if one.is_symlink())


def _is_inside(place: Path, root: Path) -> bool:
    try:
        return place.resolve().is_relative_to(root.resolve())
    except (OSError, RuntimeError):  # links in a circle
        return False
