"""The order of photographs: natural by their names, or given by a table; numbers that are missing between them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .tables import Table, check_unique

WRAPPED = 4  # numbers of a camera's counter, at most, that may be missing where it wraps
ORDER_COLUMNS = ("file",)
NUMBER = "number"  # optional column of the table: the photograph's place in time, in intervals


@dataclass(frozen=True, slots=True)
class GivenOrder:
    """The photographs that a table lists, and their places in time."""

    files: tuple[Path, ...]
    number: NDArray[np.int64]  # (f,) ascending, in intervals


@dataclass(frozen=True, slots=True)
class MissingNumbers:
    """Numbers that no photograph has, between two that follow one another."""

    after: Path
    before: Path
    count: int


def arrange_order(table: Table, files: Sequence[Path], folder: Path) -> GivenOrder:
    """Return the photographs that a table file[,number] lists, in its order.

    Parameters
    ----------
    table : Table
        Its files are named relative to the folder; absent numbers are 0, 1, 2 …
    files : sequence of Path
        The photographs that are there; those that the table does not list are left out.
    folder : Path
        The experiment's folder.

    Raises
    ------
    InputError
        A file is not one of the photographs or is listed twice, or numbers do not ascend.
    """
    named = {relative_name(file, folder): file for file in files}
    names = table.text("file")
    for row, name in enumerate(names):
        if name not in named:
            raise table.error(row, "file", "is not one of the photographs that photographs.files matches")
    check_unique(table, "file", np.unique(names, return_inverse=True)[1])
    number = table.integers(NUMBER) if NUMBER in table.names else np.arange(len(names))
    late = np.flatnonzero(np.diff(number) <= 0)
    if len(late):
        raise table.error(int(late[0]) + 1, NUMBER, "is not greater than that of the photograph before it")
    return GivenOrder(tuple(named[name] for name in names), number)


def relative_name(file: Path, folder: Path) -> str:
    """Return a photograph's name in a table of the order: relative to the experiment's folder where it is below it."""
    return file.relative_to(folder).as_posix() if file.is_relative_to(folder) else file.as_posix()


def missing_numbers(files: Sequence[Path]) -> list[MissingNumbers]:
    """List the places where names skip numbers that the others do not skip: P3, P6, P12 lack P9.

    The last number of a name counts; nothing is reported where the numbers of most photographs differ otherwise, or
    where a counter begins again.
    """
    numbers = [last_number(file) for file in files]
    steps = [b - a if a is not None and b is not None else 0 for a, b in pairwise(numbers)]
    if len(steps) < 3:
        return []
    usual = sorted(steps)[(len(steps) - 1) // 2]
    if usual <= 0 or sum(step == usual for step in steps) < 0.5 * len(steps):
        return []
    return [
        MissingNumbers(files[k], files[k + 1], step // usual - 1)
        for k, step in enumerate(steps)
        if step >= 2 * usual and step % usual == 0
    ]


def last_number(file: Path) -> int | None:
    """Return the last number in a file's name, None where it has none."""
    found = re.findall(r"\d+", file.stem)
    return int(found[-1]) if found else None


def natural_key(file: Path) -> tuple[tuple[tuple[int, int | str], ...], str]:
    """Return a sort key that compares numbers in names by value: img2 before img10."""
    parts = re.split(r"(\d+)", file.as_posix())
    return tuple((0, int(part)) if part.isdecimal() else (1, part.lower()) for part in parts), file.as_posix()


def in_order(files: Iterable[Path]) -> tuple[Path, ...]:
    """Return photographs in the natural order of their names; a camera's counter that wraps goes on.

    A counter of so many digits wraps where photographs with its last and its first numbers are there, and none with
    numbers between: DSC_9998, DSC_9999, DSC_0001.
    """
    ordered = sorted(files, key=natural_key)
    names = [re.fullmatch(r"(.*?)(\d{4,})", file.stem) for file in ordered]
    if len(ordered) < 2 or len({(name[1], len(name[2])) if name else None for name in names}) != 1 or names[0] is None:
        return tuple(ordered)
    counts, period = [int(name[2]) for name in names if name], 10 ** len(names[0][2])
    steps = [after - before for before, after in pairwise(counts)]
    widest = max(range(len(steps)), key=steps.__getitem__)
    usual = sorted(steps)[(len(steps) - 1) // 2] if len(steps) > 1 else WRAPPED
    wraps = counts[0] + period - counts[-1] <= max(2 * usual, WRAPPED) and steps[widest] > period // 2
    return tuple(ordered[widest + 1 :] + ordered[: widest + 1] if wraps else ordered)
