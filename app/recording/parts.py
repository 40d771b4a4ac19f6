"""The parts of a long recording: several files, each of which opens alone and all together as one recording.

All parts carry the identity of the recording, by which viewers recognise them as one.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rerun.chunk import Chunk

PART_MARK = "-part-"


def part_of(recording: Path, number: int) -> Path:
    """Return the file of part 1, 2, …; the first has the name of the recording."""
    return recording if number == 1 else recording.with_name(f"{recording.stem}{PART_MARK}{number}{recording.suffix}")


def is_later_part(file: Path) -> bool:
    """Return whether a file is named as the second or a later part of a recording."""
    stem, mark, number = file.stem.rpartition(PART_MARK)
    return bool(stem and mark) and number.isdecimal()


def parts_of(recording: Path) -> list[Path]:
    """Return the files of a recording in order, from its first file; parts of another recording are left out."""
    found, number = [recording], 2
    while (file := part_of(recording, number)).is_file():
        found.append(file)
        number += 1
    if len(found) == 1:
        return found
    name = _identity(recording)
    return [recording, *(file for file in found[1:] if _identity(file) == name)]


def remove_parts(recording: Path, first: int) -> None:
    """Delete the parts from number `first` on."""
    while (file := part_of(recording, first)).is_file():
        file.unlink()
        first += 1


def read_chunks(recording: Path, *, timeline: str | None = None, content: str | None = None) -> Iterator[Chunk]:
    """Yield the chunks of all parts of a recording, where given only those on a timeline or of an entity."""
    from rerun.chunk import RrdReader

    for file in parts_of(recording):
        stream = RrdReader(str(file)).store().stream()
        if timeline is not None:
            stream = stream.filter(has_timeline=timeline)
        if content is not None:
            stream = stream.filter(content=content)
        yield from stream.to_chunks()


def _identity(file: Path) -> str:
    from rerun.chunk import RrdReader

    try:
        return RrdReader(str(file)).recordings()[0].recording_id
    except (RuntimeError, ValueError, OSError, IndexError):
        return ""
