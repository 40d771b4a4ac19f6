"""Bad input, said in one line."""

from __future__ import annotations

from pathlib import Path


class InputError(Exception):
    """The input is wrong in a way that its author can mend.

    The message is one line: the file, the row or key, the value, what was expected.
    """

    def __init__(self, file: Path | str, where: str, problem: str) -> None:
        text = ": ".join(part for part in (str(file), where, problem) if part)
        super().__init__(" ".join(text.split()))
