"""Files that are there whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PART = ".part"  # what is being written ends in it


@contextmanager
def replacing(file: Path) -> Iterator[Path]:
    """Give a name to write to; once the block ends well it takes the place of `file`, otherwise nothing changes."""
    file.parent.mkdir(parents=True, exist_ok=True)
    part = file.with_name(file.name + PART)
    try:
        yield part
        os.replace(part, file)
    finally:
        part.unlink(missing_ok=True)


def write_atomically(file: Path, content: bytes) -> None:
    with replacing(file) as part:
        try:
            part.write_bytes(content)
        except OSError as error:
            if error.filename is None:  # what refuses a write does not say where
                error.filename = str(part)
            raise
