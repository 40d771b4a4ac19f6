"""Tables as comma-separated text with a header; every error names its row."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...process.atomic import replacing
from ...process.counts import state_count
from ...process.errors import InputError, MissingFileError
from .column_names import refuse_likely_names
from .input_files import InputFiles
from .plain_rows import Cells, split_plain

LARGEST = 1e50  # in SI units no length, time or force is larger; its square and its cube are still numbers
# Columns that the program itself adds to tables, for people or for other commands: they are not reported as unused.
OWN_COLUMNS = frozenset({"number", "fn_i", "fn_j", "quality", "sigma1", "sigma2", "zncc", "patches"})
GREATEST = 2**53  # float64 represents all whole numbers up to it


class Table:
    """Columns of one file, with the line of each row."""

    def __init__(
        self, file: Path, columns: Mapping[str, Sequence[str]], line: Sequence[int], *, of: str = "row"
    ) -> None:
        self.file = file
        self._columns = columns
        self._line = line
        self._of = of  # the unit of `line`

    def __len__(self) -> int:
        return len(self._line)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self._columns)

    def select(self, kept: Sequence[bool] | NDArray[np.bool_]) -> Table:
        """Return a table of the rows marked in `kept` (m,)."""
        columns = {name: [v for v, k in zip(values, kept, strict=True) if k] for name, values in self._columns.items()}
        line = [number for number, k in zip(self._line, kept, strict=True) if k]
        return Table(self.file, columns, line, of=self._of)

    def where(self, row: int) -> str:
        """Return the line of a row in the file, in words."""
        return f"{self._of} {self._line[row]}"

    def text(self, column: str) -> list[str]:
        """Return a column as texts."""
        return list(self._columns[column])

    def integers(self, column: str) -> NDArray[np.int64]:
        """Return a column of whole numbers (m,). Raises InputError with row and value."""
        try:
            values = np.fromiter(map(int, self._coded(column)), np.int64, len(self))
        except (ValueError, OverflowError):
            values = np.empty(0, np.int64)
        if (
            not len(values) or values.min() < -GREATEST or values.max() > GREATEST
        ):  # one by one, to name the wrong value
            return np.array([self._number(int, column, row) for row in range(len(self))], np.int64)
        return values

    def numbers(self, column: str) -> NDArray[np.float64]:
        """Return a column of finite numbers (m,). Raises InputError with row and value."""
        try:
            values = np.fromiter(map(float, self._coded(column)), np.float64, len(self))
        except ValueError:  # one by one, to name the wrong value
            values = np.array([self._number(float, column, row) for row in range(len(self))], np.float64)
        self._refuse_large(values, np.arange(len(self)), column)
        return values

    def optional_numbers(self, column: str) -> NDArray[np.float64]:
        """Return the numbers of a column that may be absent or have empty cells (m,), NaN there."""
        if column not in self._columns:
            return np.full(len(self), np.nan)
        try:
            values = np.fromiter(map(float, self._coded(column)), np.float64, len(self))
        except ValueError:  # of an empty cell, or of a wrong one, which is named below
            pass
        else:
            self._refuse_large(values, np.arange(len(self)), column)
            return values
        filled = np.flatnonzero(np.fromiter((text != "" for text in self._columns[column]), np.bool_, len(self)))
        values = np.full(len(self), np.nan)
        values[filled] = [self._number(float, column, int(row)) for row in filled]
        self._refuse_large(values[filled], filled, column)
        return values

    def _coded(self, column: str) -> Iterable[str | bytes]:
        cells = self._columns[column]
        return cells.coded() if isinstance(cells, Cells) else cells

    def error(self, row: int, column: str, problem: str) -> InputError:
        """Return the error of a value, with file, row, column and value."""
        return InputError(self.file, f"{self.where(row)}, {column} = {self._columns[column][row]!r}", problem)

    def _refuse_large(self, values: NDArray[np.float64], row: NDArray[np.integer], column: str) -> None:
        """Raise InputError where a value is not finite or larger than any physical quantity."""
        bad = np.flatnonzero(~(np.abs(values) <= LARGEST))
        if len(bad):
            finite = np.isfinite(values[bad[0]])
            problem = "is larger than any length, time or force" if finite else "is not a finite number"
            raise self.error(int(row[bad[0]]), column, problem)

    def _number(self, kind: type[int] | type[float], column: str, row: int) -> int | float:
        text = self._columns[column][row]
        try:
            value = kind(text)
        except ValueError:
            name = "a whole number" if kind is int else "a number"
            raise self.error(row, column, f"is not {name}") from None
        if kind is int and abs(value) > GREATEST:
            raise self.error(row, column, f"is beyond the range of exact whole numbers, ± {GREATEST}")
        return value


def read_table(
    file: Path, columns: Sequence[str], inputs: InputFiles | None = None, optional: Sequence[str] = ()
) -> Table:
    """Read the named columns of a table; other columns are ignored.

    Parameters
    ----------
    file
        The table.
    columns
        Names of the columns to read.
    inputs
        Reads the file and refuses it if it has changed since it was first read.
    optional
        Names of columns that may be absent.

    Raises
    ------
    InputError
        The table is wrong; the message names file, row and value.
    """
    inputs = InputFiles() if inputs is None else inputs
    try:
        content = inputs.read(file, text=True)
        if b"\0" in content:
            raise InputError(file, f"row {content[: content.index(0)].count(10) + 1}", "holds a NUL character")
        header = _header(content)
        refuse_likely_names(file, header, columns, optional)
        inputs.note_columns(file, [name for name in header if name not in (*columns, *optional, *OWN_COLUMNS)])
        plain = split_plain(content, columns, optional)
        if plain is not None:
            return Table(file, plain.values, plain.line)
        with io.StringIO(content.decode("utf-8-sig"), newline="") as stream:
            reader = csv.reader(stream)
            next(reader, [])
            columns = [*columns, *(name for name in optional if name in header)]
            for name in columns:
                if header.count(name) != 1:
                    problem = "there is no such column" if name not in header else "stands twice in the header"
                    raise InputError(file, f"column {name}", f"{problem} (header: {','.join(header)!r})")
            place = [header.index(name) for name in columns]
            values: dict[str, list[str]] = {name: [] for name in columns}
            line: list[int] = []
            for row in reader:
                if not any(cell.strip() for cell in row):
                    continue
                if len(row) != len(header):
                    raise InputError(file, f"row {reader.line_num}", f"has {len(row)} cells, not {len(header)}")
                line.append(reader.line_num)
                for name, at in zip(columns, place, strict=True):
                    values[name].append(row[at].strip())
    except FileNotFoundError:
        raise MissingFileError(file, "", "there is no such file") from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(file, "", f"cannot be read ({error})") from None
    if not line:
        raise InputError(file, "", "has no rows")
    return Table(file, values, line)


def _header(content: bytes) -> list[str]:
    """Return the names in the first line of a table, of which no more is decoded."""
    with io.TextIOWrapper(io.BytesIO(content), "utf-8-sig", newline="") as stream:
        return [name.strip() for name in next(csv.reader(stream), [])]


def write_table(file: Path, columns: Mapping[str, Iterable[object]]) -> None:
    """Write columns of equal length, floats with all their digits."""
    with replacing(file) as part, part.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))


def check_frames(table: Table, frame: NDArray[np.int64]) -> int:
    """Return the number of frames, which must start at 0 and have no gaps. Raises InputError otherwise."""
    if frame.min() < 0:
        raise table.error(int(frame.argmin()), "frame", "is negative: frames count from 0")
    present = np.unique(frame)
    missing = np.flatnonzero(present != np.arange(len(present)))
    if len(missing):
        row = int(np.flatnonzero(frame == present[missing[0]])[0])
        raise table.error(row, "frame", f"comes without frame {int(missing[0])}: frames count from 0 without gaps")
    return len(present)


def check_frame_count(table: Table, content: str, found: int, expected: int) -> None:
    """Raise InputError where a table does not have as many frames as the experiment; content: its rows in a word."""
    if found != expected:
        given, there = (state_count(count, "frame") for count in (found, expected))
        verb = "is" if expected == 1 else "are"
        raise InputError(table.file, "frame", f"has {content} of {given}, but there {verb} {there}")


def check_unique(table: Table, column: str, *keys: NDArray[np.int64]) -> None:
    """Raise InputError with the later row where two rows have the same keys."""
    number = np.zeros(len(table), np.int64)
    for key in keys:  # rows with the same keys get the same number, below their count
        _, own = np.unique(key, return_inverse=True)
        _, number = np.unique(number * (own.max(initial=0) + 1) + own, return_inverse=True)
    _, first = np.unique(number, return_index=True)
    if len(first) < len(number):
        again = int(np.setdiff1d(np.arange(len(number)), first)[0])
        raise table.error(again, column, "stands twice" + (" in its frame" if len(keys) > 1 else ""))
