"""Reader of tables of other programs: cells separated by commas, semicolons, tabs or blanks, or Parquet."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from ...experiment.reading.input_files import regular
from ...experiment.reading.tables import Table
from ...process.counts import state_count
from ...process.errors import InputError, MissingFileError

PARQUET, ZIP = b"PAR1", b"PK\x03\x04"  # first bytes of files
COMMA_DECIMAL = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
THOUSANDS = re.compile(r"[+-]?\d{1,3}(,\d{3})+")
SEPARATOR = re.compile(r"sep=(.)", re.IGNORECASE)  # the first line of tables that Excel writes
NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?|[+-]?(nan|inf)", re.IGNORECASE)
MISSING = frozenset({"", "nan", "NaN", "NA", "null", "None", "-"})  # cells without a value
MAX_LISTED = 12  # column names in a message


def read_foreign(file: Path, columns: Sequence[str], optional: Sequence[str] = ()) -> Table:
    """Read the named columns of a table; a number that is no name denotes the column at this place, from 1.

    Parameters
    ----------
    file : Path
    columns : sequence of str
        Required columns.
    optional : sequence of str
        Columns that are read if they exist.

    Returns
    -------
    Table
        Missing values are empty text; decimal commas are converted to points.

    Raises
    ------
    InputError
        Naming file, row and value.
    """
    header, rows = _open(file)
    place = {name: _place(header, name) for name in (*columns, *optional)}
    wanted = [*columns, *(name for name in optional if place[name] is not None)]
    for name in wanted:
        if place[name] is None or header.count(name) > 1:
            listed = ", ".join(header[:MAX_LISTED]) + (" …" if len(header) > MAX_LISTED else "")
            problem = "there is no such column" if place[name] is None else "is twice in the header"
            raise InputError(file, f"column {name}", f"{problem} (columns: {listed})")
    position = [at for name in wanted if (at := place[name]) is not None]
    values: dict[str, list[str]] = {name: [] for name in wanted}
    line = []
    for number, cells in rows:
        if len(cells) != len(header):
            raise InputError(file, f"row {number}", f"has {len(cells)} cells, the header has {len(header)}")
        line.append(number)
        for name, at in zip(wanted, position, strict=True):
            cell = cells[at].strip()
            values[name].append("" if cell in MISSING else cell)
    if not line:
        raise InputError(file, "", "has no rows")
    table = Table(file, values, line)
    for name in wanted:
        _convert_decimal_commas(table, name, values)
    return table


def _place(header: Sequence[str], name: str) -> int | None:
    """Return the index of a column that is given by its name, or by its number from 1 where no column has that name."""
    if name in header:
        return header.index(name)
    return int(name) - 1 if name.isdecimal() and 1 <= int(name) <= len(header) else None


def column_names(file: Path) -> list[str]:
    """Return the names in a table's header. Raises InputError."""
    return _open(file)[0]


def read_text(file: Path) -> str:
    """Read a text file in UTF-8, UTF-16 with byte order mark, or Latin-1. Raises InputError."""
    try:
        content = regular(file).read_bytes()
    except FileNotFoundError:
        raise MissingFileError(file, "", "there is no such file") from None
    except OSError as error:
        raise InputError(file, "", f"cannot be read ({error.strerror})") from None
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        encodings = ("utf-16",)
    else:
        encodings = ("utf-8-sig", "latin-1")
    if content[:4] == ZIP:
        raise InputError(file, "", "is a workbook or an archive, and no text: save the table as CSV")
    if encodings[0] != "utf-16" and b"\0" in content:
        raise InputError(file, f"row {content[: content.index(0)].count(10) + 1}", "contains a NUL: it is not text")
    for encoding in encodings:
        try:
            return content.decode(encoding)
        except UnicodeDecodeError:
            continue
    raise InputError(file, "", f"is not valid {encodings[0]} text")


def _open(file: Path) -> tuple[list[str], Iterator[tuple[int, list[str]]]]:
    """Return the header, and the rows with their line numbers."""
    try:
        with regular(file).open("rb") as stream:
            start = stream.read(4)
    except FileNotFoundError:
        raise MissingFileError(file, "", "there is no such file") from None
    except OSError as error:
        raise InputError(file, "", f"cannot be read ({error.strerror})") from None
    return _open_parquet(file) if start == PARQUET else _open_text(file)


def _open_parquet(file: Path) -> tuple[list[str], Iterator[tuple[int, list[str]]]]:
    import pyarrow
    import pyarrow.parquet

    try:
        table = pyarrow.parquet.read_table(file)
    except (pyarrow.ArrowException, OSError) as error:
        raise InputError(file, "", f"cannot be read ({error})") from None
    columns = [["" if value is None else str(value) for value in column.to_pylist()] for column in table.columns]
    rows = ((number, list(cells)) for number, cells in enumerate(zip(*columns, strict=True), start=1))
    return list(table.column_names), rows


def _open_text(file: Path) -> tuple[list[str], Iterator[tuple[int, list[str]]]]:
    lines = read_text(file).splitlines()
    kept = [(number, text) for number, text in enumerate(lines, start=1) if text.strip()]
    remarks = [text.lstrip("#% \t") for _, text in kept if text.lstrip().startswith(("#", "%"))]
    kept = [(number, text) for number, text in kept if not text.lstrip().startswith(("#", "%"))]
    stated = SEPARATOR.fullmatch(kept[0][1].strip()) if kept else None
    kept = kept[1:] if stated else kept
    if not kept:
        raise InputError(file, "", "is empty")
    delimiter = stated[1] if stated else _delimiter(kept[0][1])
    if not stated:
        _refuse_title(file, kept, delimiter)
    cells = [(number, _split(text, delimiter)) for number, text in kept]
    first = [cell.strip() for cell in cells[0][1]]
    if not all(NUMBER.fullmatch(cell) or cell in MISSING for cell in first):
        return first, iter(cells[1:])
    named = [cell.strip() for cell in _split(remarks[-1], delimiter)] if remarks else []
    if len(named) == len(first):
        return named, iter(cells)
    return [str(k) for k in range(1, len(first) + 1)], iter(cells)


def _refuse_title(file: Path, lines: list[tuple[int, str]], delimiter: str | None) -> None:
    """Raise InputError where the first line is shorter than a header of the rows below. R leaves out one name."""
    if len(lines) < 3:
        return
    names = len(_split(lines[0][1], delimiter))
    below = {len(_split(text, _delimiter(text))) for _, text in lines[1:3]}
    if len(below) == 1 and names + 1 < (columns := below.pop()):
        raise InputError(
            file, f"row {lines[0][0]}",
            f"is no header: it names {state_count(names, 'column')}, and the rows below have {columns}. Delete it, or "
            "begin it with #",
        )  # fmt: skip


def _delimiter(line: str) -> str | None:
    """Return the delimiter of a line; None: blanks."""
    for mark in ("\t", ";"):
        if mark in line:
            return mark
    return "," if "," in line and not _blanks_between_decimals(line) else None


def _blanks_between_decimals(line: str) -> bool:
    """Whether a line is of numbers with decimal commas and blanks between."""
    cells = line.split()
    return len(cells) > 1 and all(NUMBER.fullmatch(cell) for cell in cells) and not line.rstrip().endswith(",")


def _split(line: str, delimiter: str | None) -> list[str]:
    if delimiter is None:
        return line.split()
    return next(csv.reader(io.StringIO(line), delimiter=delimiter, skipinitialspace=True), [])


def _convert_decimal_commas(table: Table, name: str, values: dict[str, list[str]]) -> None:
    """Decimal commas become points; a column that may have points, or separators of thousands, is not guessed at."""
    commas = [row for row, cell in enumerate(values[name]) if COMMA_DECIMAL.fullmatch(cell)]
    if not commas:
        return
    if any("." in cell for cell in values[name]):
        raise table.error(
            commas[0], name, "has a comma where other rows have a point: the decimal separator is ambiguous"
        )
    if len(commas) < sum(map(bool, values[name])) and all(THOUSANDS.fullmatch(values[name][row]) for row in commas):
        raise table.error(
            commas[0], name, "has a comma before three digits, and other rows have none: decimals, or thousands? Write "
            "numbers without separators of thousands",
        )  # fmt: skip
    values[name][:] = [cell.replace(",", ".") if COMMA_DECIMAL.fullmatch(cell) else cell for cell in values[name]]
