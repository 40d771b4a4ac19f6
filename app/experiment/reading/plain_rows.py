"""Fast parser of tables without quotes: a sequence has hundreds of thousands of cells."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

MAX_LINE = 1 << 17  # bytes: the csv module refuses longer cells
COMMA, NEWLINE = b",\n"


@dataclass(frozen=True, slots=True)
class PlainRows:
    """Columns of a table, equal to those that the csv module reads."""

    values: dict[str, list[str]]  # by name of the column, without blanks around
    line: Sequence[int]  # of each row, from 1


def split_plain(content: bytes, columns: Sequence[str], optional: Sequence[str]) -> PlainRows | None:
    """Return the named columns of a table in UTF-8; None where the table is not plain, or is wrong in any way.

    A plain table has no quotes, no blank rows, and as many cells in every row.
    """
    content = content.replace(b"\r\n", b"\n").removesuffix(b"\n")
    if not columns or b'"' in content or b"\r" in content or b"\0" in content:
        return None
    raw = np.frombuffer(content, np.uint8)
    end = np.append(np.flatnonzero(raw == NEWLINE), len(raw))
    commas = np.diff(np.searchsorted(np.flatnonzero(raw == COMMA), end), prepend=0)
    if len(end) < 2 or np.any(commas != commas[0]) or np.diff(end, prepend=0).max() > MAX_LINE:
        return None
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return None
    cells = text.replace("\n", ",").split(",")
    width = int(commas[0]) + 1
    header = [name.strip() for name in cells[:width]]
    columns = [*columns, *(name for name in optional if name in header)]
    if any(header.count(name) != 1 for name in columns):
        return None
    values = {name: list(map(str.strip, cells[width + header.index(name) :: width])) for name in columns}
    if "" in values[columns[0]]:  # the row may be blank
        return None
    return PlainRows(values, range(2, len(end) + 1))
