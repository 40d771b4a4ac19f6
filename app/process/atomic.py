"""Atomic writes: a file appears whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PART = ".part"  # suffix of a file that is being written


@contextmanager
def replacing(file: Path) -> Iterator[Path]:
    """Give a temporary path to write to, which replaces `file` once the block ends without an error."""
    file.parent.mkdir(parents=True, exist_ok=True)
    part = file.with_name(file.name + PART)
    try:
        yield part
        os.replace(part, file)
    finally:
        part.unlink(missing_ok=True)


def write_atomically(file: Path, content: bytes) -> None:
    """Replace a file by these bytes. Raises OSError with the name of the file that could not be written."""
    with replacing(file) as part:
        try:
            part.write_bytes(content)
        except OSError as error:
            if error.filename is None:  # an error of write() carries no name
                error.filename = str(part)
            raise
