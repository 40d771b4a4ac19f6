"""What ends a command, said in one line: bad input, or what the input cannot help."""

from __future__ import annotations

from pathlib import Path


class InputError(Exception):
    """The input is wrong in a way that its author can mend.

    The message is one line: the file, the row or key, the value, what was expected.
    """

    def __init__(self, file: Path | str, where: str, problem: str) -> None:
        text = ": ".join(part for part in (str(file), where, problem) if part)
        super().__init__(" ".join(text.split()))


class RunError(Exception):
    """Work cannot go on, and the input is not to blame: a full disk, another run in the folder, nothing to solve.

    The message is one line: what happened, and the way out.
    """

    def __init__(self, text: str) -> None:
        super().__init__(" ".join(text.split()))


class UndeterminedError(ValueError):
    """What a key of the settings asks for cannot be found from these data; `key` names it, the message says why."""

    key = ""
