"""Errors that end a command with one line: wrong input, or a failure that the input did not cause."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

ROW = re.compile(r"\brow (\d+)\b")  # of a table, in a message


class InputError(Exception):
    """The input is wrong and its author can correct it.

    The message is one line: the file, the row or key, the value, what was expected.
    """

    def __init__(self, file: Path | str, where: str, problem: str) -> None:
        text = ": ".join(part for part in (str(file), where, problem) if part)
        super().__init__(" ".join(text.split()))
        self.problem = problem  # without the file and the place in it


class MissingFileError(InputError, FileNotFoundError):
    """A file or folder that the input names does not exist."""


class MissingFrameError(InputError, IndexError):
    """The input names a frame that does not exist."""


class FigureError(InputError, ValueError):
    """The input requests a figure that does not exist, or for which there are no data."""


@contextmanager
def naming(file: Path, name: str, *, first_row: int = 0) -> Iterator[None]:
    """Name a temporary file in bad input of the block as what the user gave: a data frame, a folder to be made.

    first_row: line of the file that holds row 0 of a data frame, whose rows are counted from 0.
    """
    try:
        yield
    except InputError as error:
        text, here = str(error), str(file)
        if first_row and text.startswith(here):
            text = ROW.sub(lambda found: f"row {int(found[1]) - first_row}", text)
        error.args = (text.replace(here, name),)
        error.problem = error.problem.replace(here, name)
        raise


class RunError(Exception):
    """Work cannot continue although the input is valid: a full disk, another run in the folder, nothing to solve.

    The message is one line: the cause and the cure.
    """

    def __init__(self, text: str) -> None:
        super().__init__(" ".join(text.split()))


class UndeterminedError(ValueError):
    """These data do not determine a quantity that a key of the settings requests; `key` is the name of that key."""

    key = ""
