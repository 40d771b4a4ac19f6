"""Reader of a campaign's table: one run for every row, or for every folder that matches a row."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..experiment.config.unused_keys import refuse_unused_keys
from ..experiment.experiment import CONFIG_NAME, load_experiment
from ..process.errors import InputError, MissingFileError
from ..process.frame_range import ALL_FRAMES, FrameRange

EXPERIMENT, NAME, FRAMES = "experiment", "name", "frames"  # columns; all others are keys of experiment.toml


@dataclass(frozen=True, slots=True)
class Case:
    """One run of a campaign."""

    name: str  # of its folder, unique
    experiment: str  # path of the experiment
    settings: tuple[str, ...] = ()  # KEY=VALUE
    frames: FrameRange = ALL_FRAMES
    record: bool = True  # also write the recording

    def as_plain(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return asdict(self)

    @classmethod
    def of_plain(cls, values: dict[str, Any]) -> Case:
        frames = FrameRange(*values["frames"])
        return cls(values["name"], values["experiment"], tuple(values["settings"]), frames, values["record"])


def read_plan(table: Path, *, record: bool = True) -> list[Case]:
    """Read the runs of a table.

    Parameters
    ----------
    table : Path
        CSV with the columns experiment (a folder relative to the table, or a pattern of folders), optionally name and
        frames (A:B), and keys of experiment.toml; an empty cell keeps the experiment's setting.
    record : bool
        Also write recordings.

    Raises
    ------
    InputError
        Naming the row.
    """
    found: list[Case] = []
    for number, row in _rows(table):
        where = f"row {number}"
        for file in _experiments(table, where, row[EXPERIMENT]):
            settings = tuple(f"{key}={value}" for key, value in row.items()
                             if value and key not in (EXPERIMENT, NAME, FRAMES))  # fmt: skip
            try:
                experiment = load_experiment(file, settings)
                refuse_unused_keys(experiment.config, experiment.file)
            except InputError as error:
                raise InputError(table, where, str(error)) from None
            name = _unique(_name(row.get(NAME, ""), experiment.name, settings), [each.name for each in found])
            found.append(Case(name, str(file.resolve()), settings, _frames(table, where, row.get(FRAMES, "")), record))
    return found


def _rows(table: Path) -> Iterator[tuple[int, dict[str, str]]]:
    """Yield the rows with their line numbers."""
    try:
        text = table.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise MissingFileError(table, "", "there is no such file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(table, "", f"cannot be read ({getattr(error, 'strerror', None) or 'not UTF-8'})") from None
    lines = csv.reader(io.StringIO(text))
    header = [name.strip() for name in next(lines, [])]
    if EXPERIMENT not in header or len(set(header)) != len(header):
        raise InputError(table, "row 1", f"must name columns, each once, one of them {EXPERIMENT}")
    count = 0
    for row in lines:
        if not any(cell.strip() for cell in row):
            continue
        if len(row) != len(header):
            raise InputError(table, f"row {lines.line_num}", f"has {len(row)} cells, not {len(header)}")
        count += 1
        yield lines.line_num, dict(zip(header, (cell.strip() for cell in row), strict=True))
    if not count:
        raise InputError(table, "", "has no rows")


def _experiments(table: Path, where: str, cell: str) -> list[Path]:
    """Return the experiment that a cell names, or all folders with an experiment that match it."""
    if not any(sign in cell for sign in "*?["):
        return [table.parent / cell]
    matching = sorted(table.parent.glob(cell)) if not Path(cell).is_absolute() else []
    found = [each for each in matching if (each / CONFIG_NAME).is_file()]
    if not found:
        raise InputError(table, f"{where}, {EXPERIMENT} = {cell!r}", "matches no folder with an experiment.toml")
    return found


def _frames(table: Path, where: str, cell: str) -> FrameRange:
    if not cell:
        return ALL_FRAMES
    match = re.fullmatch(r"(\d*):(\d*)", cell)
    if match is None:
        raise InputError(table, f"{where}, {FRAMES} = {cell!r}", "is not A:B, such as 0:12")
    first, end = match.groups()
    return FrameRange(int(first or 0), int(end) if end else None)


def _name(given: str, experiment: str, settings: tuple[str, ...]) -> str:
    """Return a name for a folder: the given one, or the experiment's with its settings."""
    short = [f"{key.rpartition('.')[2]}={value}" for key, _, value in (each.partition("=") for each in settings)]
    name = given or "-".join([experiment, *short])
    return re.sub(r"[^\w.=+-]+", "_", name).strip("._") or "run"


def _unique(name: str, others: list[str]) -> str:
    number, candidate = 1, name
    while candidate in others:
        number += 1
        candidate = f"{name}-{number}"
    return candidate
