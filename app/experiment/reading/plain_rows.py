"""Fast parser of tables without quotes: a sequence has hundreds of thousands of cells."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import overload

import numpy as np
from numpy.typing import NDArray

MAX_LINE = 1 << 17  # bytes: the csv module refuses longer cells
COMMA, NEWLINE = b",\n"
BLANK = 0x20  # bytes up to this are blanks, or are removed as such
BLOCK = 1 << 20  # bytes that are looked through at once: what is found takes several times their memory
CELLS = 1 << 13  # that are converted at once


class Cells(Sequence[str]):
    """One column of a table's bytes, decoded on access: as texts, the cells of a sequence take ten times the memory."""

    def __init__(self, content: bytes, start: NDArray[np.integer], end: NDArray[np.integer]) -> None:
        """Make a column of the cells from start (m,) to end (m,) [bytes]."""
        self._content, self._start, self._end = content, start, end

    def __len__(self) -> int:
        return len(self._end)

    @overload
    def __getitem__(self, row: int) -> str: ...
    @overload
    def __getitem__(self, row: slice) -> list[str]: ...
    def __getitem__(self, row: int | slice) -> str | list[str]:
        if isinstance(row, slice):
            return [self[each] for each in range(*row.indices(len(self)))]
        return self._content[self._start[row] : self._end[row]].decode().strip()

    def __iter__(self) -> Iterator[str]:
        return (cell.decode().strip() for cell in self.coded())

    def has_blank(self, *, plain: bool) -> bool:
        """Whether a cell is empty; plain: there are no blanks in any."""
        return bool(np.any(self._start == self._end)) if plain else "" in self

    def coded(self) -> Iterator[bytes]:
        """Return the bytes of the cells one by one; numbers are read from them."""
        return chain.from_iterable(map(self._coded_from, range(0, len(self), CELLS)))

    def _coded_from(self, row: int) -> list[bytes]:
        content, part = self._content, slice(row, row + CELLS)
        ends = zip(self._start[part].tolist(), self._end[part].tolist(), strict=True)
        return [content[first:end] for first, end in ends]


@dataclass(frozen=True, slots=True)
class PlainRows:
    """Columns of a table, equal to those that the csv module reads."""

    values: dict[str, Cells]  # by name of the column, without blanks around
    line: Sequence[int]  # of each row, from 1


def split_plain(content: bytes, columns: Sequence[str], optional: Sequence[str]) -> PlainRows | None:
    """Return the named columns of a table in UTF-8; None where the table is not plain, or is wrong in any way.

    A plain table has no quotes, no blank rows, and as many cells in every row.
    """
    content = content.replace(b"\r\n", b"\n")
    if not columns or b'"' in content or b"\r" in content or b"\0" in content or len(content) >= 1 << 31:
        return None
    raw = np.frombuffer(content, np.uint8)
    raw = raw[: len(raw) - content.endswith(b"\n")]
    place = _ends_of_cells(raw)
    ends_row = np.append(raw[place[:-1]] == NEWLINE, True)
    last = np.flatnonzero(ends_row)  # the last cell of each row
    width = int(last[0]) + 1
    if len(last) < 2 or np.any(np.diff(last) != width):
        return None
    if np.diff(place[last], prepend=0).max() > MAX_LINE or not _is_text(content):
        return None
    header = [name.strip() for name in content[: place[width - 1]].decode("utf-8-sig").split(",")]
    columns = [*columns, *(name for name in optional if name in header)]
    if any(header.count(name) != 1 for name in columns):
        return None
    cells = {name: _column(content, place, width, header.index(name)) for name in columns}
    if cells[columns[0]].has_blank(plain=content.isascii() and not _has_blanks(raw)):
        return None  # the row may be blank
    return PlainRows(cells, range(2, len(last) + 1))


def _ends_of_cells(raw: NDArray[np.uint8]) -> NDArray[np.int32]:
    """Return the places of commas and line ends, and the length."""
    found = [
        (first + np.flatnonzero((block == COMMA) | (block == NEWLINE))).astype(np.int32)
        for first, block in _blocks(raw)
    ]
    return np.concatenate([*found, np.array([len(raw)], np.int32)])


def _has_blanks(raw: NDArray[np.uint8]) -> bool:
    return any(bool(np.any((block <= BLANK) & (block != NEWLINE))) for _, block in _blocks(raw))


def _blocks(raw: NDArray[np.uint8]) -> Iterator[tuple[int, NDArray[np.uint8]]]:
    """Yield blocks of bytes with the places of their first ones."""
    for first in range(0, len(raw), BLOCK):
        yield first, raw[first : first + BLOCK]


def _column(content: bytes, place: NDArray[np.int32], width: int, number: int) -> Cells:
    return Cells(content, place[width + number - 1 : -1 : width] + 1, place[width + number :: width])


def _is_text(content: bytes) -> bool:
    if content.isascii():
        return True
    try:
        content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return False
    return True
