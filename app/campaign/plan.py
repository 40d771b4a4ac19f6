"""The table of a campaign, read and checked: a run for every row, or for every folder that a row names."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..experiment.config.unused_keys import refuse_unused_keys
from ..experiment.experiment import CONFIG_NAME, load_experiment

EXPERIMENT, NAME, FRAMES = "experiment", "name", "frames"  # columns; all others are keys of experiment.toml


@dataclass(frozen=True, slots=True)
class Case:
    """One run of a campaign."""

    name: str  # of its folder; no two are alike
    experiment: str  # path of the experiment
    settings: tuple[str, ...] = ()  # KEY=VALUE
    frames: tuple[int, int | None] = (0, None)
    record: bool = True  # write the recording, too

    def as_plain(self) -> dict[str, Any]:
        """Values that JSON holds."""
        return asdict(self)

    @classmethod
    def of_plain(cls, told: dict[str, Any]) -> Case:
        first, end = told["frames"]
        return cls(told["name"], told["experiment"], tuple(told["settings"]), (first, end), told["record"])


def read_plan(table: Path, *, record: bool = True) -> list[Case]:
    """The runs that a table asks for.

    Columns: experiment (a folder, relative to the table, or a pattern of folders), name and frames (A:B) where wanted,
    and keys of experiment.toml; an empty cell leaves the experiment's own setting. Raises InputError naming the row.
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
    """The rows with their numbers in the file."""
    try:
        text = table.read_text(encoding="utf-8-sig")
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


def _experiments(table: Path, where: str, told: str) -> list[Path]:
    """Experiments that a cell names: one, or every folder that matches and holds an experiment."""
    if not any(sign in told for sign in "*?["):
        return [table.parent / told]
    matching = sorted(table.parent.glob(told)) if not Path(told).is_absolute() else []
    found = [each for each in matching if (each / CONFIG_NAME).is_file()]
    if not found:
        raise InputError(table, f"{where}, {EXPERIMENT} = {told!r}", "matches no folder with an experiment.toml")
    return found


def _frames(table: Path, where: str, told: str) -> tuple[int, int | None]:
    if not told:
        return 0, None
    match = re.fullmatch(r"(\d*):(\d*)", told)
    if match is None:
        raise InputError(table, f"{where}, {FRAMES} = {told!r}", "is not A:B, such as 0:12")
    first, end = match.groups()
    return int(first or 0), int(end) if end else None


def _name(told: str, experiment: str, settings: tuple[str, ...]) -> str:
    """A name for a folder: the one that was told, or the experiment's with what was set."""
    short = [f"{key.rpartition('.')[2]}={value}" for key, _, value in (each.partition("=") for each in settings)]
    whole = told or "-".join([experiment, *short])
    return re.sub(r"[^\w.=+-]+", "_", whole).strip("._") or "run"


def _unique(name: str, others: list[str]) -> str:
    number, candidate = 1, name
    while candidate in others:
        number += 1
        candidate = f"{name}-{number}"
    return candidate
