"""Tables as comma-separated text with a header, read so that every complaint names its row."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from .input_files import InputFiles
from .plain_rows import split_plain

LARGEST = 1e50  # in SI units no length, time or force is larger; its square and its cube are still numbers
GREATEST = 2**53  # beyond it a number with a point no longer tells two whole ones apart


class Table:
    """Columns of one file, with the line of each row."""

    def __init__(self, file: Path, columns: Mapping[str, list[str]], line: Sequence[int], *, of: str = "row") -> None:
        self.file = file
        self._columns = columns
        self._line = line
        self._of = of  # what `line` counts

    def __len__(self) -> int:
        return len(self._line)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self._columns)

    def select(self, kept: Sequence[bool] | NDArray[np.bool_]) -> Table:
        """The rows that are marked (m,)."""
        columns = {name: [v for v, k in zip(values, kept, strict=True) if k] for name, values in self._columns.items()}
        line = [number for number, k in zip(self._line, kept, strict=True) if k]
        return Table(self.file, columns, line, of=self._of)

    def where(self, row: int) -> str:
        return f"{self._of} {self._line[row]}"

    def text(self, column: str) -> list[str]:
        return self._columns[column]

    def integers(self, column: str) -> NDArray[np.int64]:
        try:
            values = list(map(int, self._columns[column]))
        except ValueError:
            values = []
        if not values or min(values) < -GREATEST or max(values) > GREATEST:  # one by one, to name what is wrong
            values = [self._number(int, column, row) for row in range(len(self))]
        return np.array(values, np.int64)

    def numbers(self, column: str) -> NDArray[np.float64]:
        try:
            values = np.array(list(map(float, self._columns[column])), np.float64)
        except ValueError:  # one by one, to name it
            values = np.array([self._number(float, column, row) for row in range(len(self))], np.float64)
        self._refuse_large(values, np.arange(len(self)), column)
        return values

    def numbers_if_told(self, column: str) -> NDArray[np.float64]:
        """Numbers of a column that may be absent, or empty in any row: NaN there."""
        if column not in self._columns:
            return np.full(len(self), np.nan)
        told = np.flatnonzero([text != "" for text in self._columns[column]])
        values = np.full(len(self), np.nan)
        values[told] = [self._number(float, column, int(row)) for row in told]
        self._refuse_large(values[told], told, column)
        return values

    def error(self, row: int, column: str, problem: str) -> InputError:
        return InputError(self.file, f"{self.where(row)}, {column} = {self._columns[column][row]!r}", problem)

    def _refuse_large(self, values: NDArray[np.float64], row: NDArray[np.integer], column: str) -> None:
        """Raise where one of the values, of these rows, is not a number that anything here can have."""
        bad = np.flatnonzero(~(np.abs(values) <= LARGEST))
        if len(bad):
            finite = np.isfinite(values[bad[0]])
            what = "is larger than any length, time or force" if finite else "is not a finite number"
            raise self.error(int(row[bad[0]]), column, what)

    def _number(self, kind: type[int] | type[float], column: str, row: int) -> int | float:
        text = self._columns[column][row]
        try:
            value = kind(text)
        except ValueError:
            name = "a whole number" if kind is int else "a number"
            raise self.error(row, column, f"is not {name}") from None
        if kind is int and abs(value) > GREATEST:
            raise self.error(row, column, f"is beyond the whole numbers that are exact, ± {GREATEST}")
        return value


def read_table(
    file: Path, columns: Sequence[str], inputs: InputFiles | None = None, optional: Sequence[str] = ()
) -> Table:
    """Read the named columns of a table; others are passed over. Raises InputError naming file, row and value.

    inputs: what the file is read by, where it has to stay what it is; optional: columns that may be absent.
    """
    try:
        content = (InputFiles() if inputs is None else inputs).read(file)
        if b"\0" in content:
            raise InputError(file, f"row {content[: content.index(0)].count(10) + 1}", "holds a NUL character")
        plain = split_plain(content, columns, optional)
        if plain is not None:
            return Table(file, plain.values, plain.line)
        with io.StringIO(content.decode("utf-8-sig"), newline="") as stream:
            reader = csv.reader(stream)
            header = [name.strip() for name in next(reader, [])]
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
        raise InputError(file, "", "there is no such file") from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(file, "", f"cannot be read ({error})") from None
    if not line:
        raise InputError(file, "", "has no rows")
    return Table(file, values, line)


def write_table(file: Path, columns: Mapping[str, Iterable[object]]) -> None:
    """Write columns of equal length; floats with all their digits."""
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))


def check_frames(table: Table, frame: NDArray[np.int64]) -> int:
    """The number of frames; they must start at 0 and have no gaps."""
    if frame.min() < 0:
        raise table.error(int(frame.argmin()), "frame", "is negative: frames count from 0")
    present = np.unique(frame)
    missing = np.flatnonzero(present != np.arange(len(present)))
    if len(missing):
        row = int(np.flatnonzero(frame == present[missing[0]])[0])
        raise table.error(row, "frame", f"comes without frame {int(missing[0])}: frames count from 0 without gaps")
    return len(present)


def check_unique(table: Table, column: str, *keys: NDArray[np.int64]) -> None:
    """No two rows may share all keys; the complaint names the later row."""
    stacked = np.stack(keys, axis=1)
    _, first = np.unique(stacked, axis=0, return_index=True)
    if len(first) < len(stacked):
        again = int(np.setdiff1d(np.arange(len(stacked)), first)[0])
        raise table.error(again, column, "stands twice" + (" in its frame" if len(keys) > 1 else ""))
