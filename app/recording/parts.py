"""A long recording is several files: each opens alone, together they are one.

Parts carry the recording's identity, which is how viewers know that they belong together.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rerun.chunk import Chunk

MARK = "-part-"


def part_of(recording: Path, number: int) -> Path:
    """The file of part 1, 2, …; the first has the recording's own name."""
    return recording if number == 1 else recording.with_name(f"{recording.stem}{MARK}{number}{recording.suffix}")


def is_later_part(file: Path) -> bool:
    """Whether a file is called as the second part of a recording or a later one."""
    stem, mark, number = file.stem.rpartition(MARK)
    return bool(stem and mark) and number.isdecimal()


def parts_of(recording: Path) -> list[Path]:
    """The files of a recording, the first of which is given, in order; left-overs of another one are none of it."""
    found, number = [recording], 2
    while (file := part_of(recording, number)).is_file():
        found.append(file)
        number += 1
    if len(found) == 1:
        return found
    name = _identity(recording)
    return [recording, *(file for file in found[1:] if _identity(file) == name)]


def forget_parts(recording: Path, first: int) -> None:
    """Remove the parts from number `first` on."""
    while (file := part_of(recording, first)).is_file():
        file.unlink()
        first += 1


def chunks_of(recording: Path, *, timeline: str | None = None, content: str | None = None) -> Iterator[Chunk]:
    """What is in a recording, all of its parts; timeline, content: only what is on it, of this entity."""
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
