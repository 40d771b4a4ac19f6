"""Import and export verdicts as a table frame,i,j,verdict,reviewer,time,seconds."""

from __future__ import annotations

import csv
from collections.abc import Callable, Collection, Mapping
from pathlib import Path

from ..experiment.reading.input_files import regular
from ..experiment.reading.tables import Table, read_table, write_table
from .decisions import BodyNames
from .log import Entry, Origin, Pair, Verdict, VerdictLog, canonical

MAX_GAP = 0.5  # radii between the surfaces of a contact, at most: more is a wrong id, and no error of tracking
_OPTIONAL = ("verdict", "reviewer", "time", "seconds")


def export_verdicts(log: VerdictLog, file: Path) -> int:
    """Write the latest verdict of every reviewer on every pair; return their number."""
    entries = sorted((e for _, e in log.verdicts()), key=lambda e: (e.frame, e.a, str(e.b), e.reviewer))
    write_table(
        file,
        {
            "frame": [e.frame for e in entries], "i": [e.a for e in entries], "j": [e.b for e in entries],
            "verdict": [str(e.verdict) for e in entries], "reviewer": [e.reviewer for e in entries],
            "time": [e.time for e in entries], "seconds": [e.seconds for e in entries],
        },
    )  # fmt: skip
    return len(entries)


def import_verdicts(
    log: VerdictLog,
    file: Path | Table,
    bodies: BodyNames,
    reviewer: str,
    *,
    frames: range,
    candidates: Mapping[int, Collection[tuple[int, int]]] | None = None,
    gap: Callable[[int, int, int], float] | None = None,
) -> list[Entry]:
    """Append the verdicts of a table to the log; return the written entries.

    Parameters
    ----------
    log
        The log.
    file
        Table, or its file, with the columns frame, i, j, and perhaps verdict (absent: every row is a contact),
        reviewer, time and seconds. Its frames are those of the experiment.
    bodies
        Names and rows of the run's bodies.
    reviewer
        Name of the reviewer for rows without one.
    frames
        Frames of the experiment that the run covers.
    candidates
        Pairs of rows by frame of the run. If given, the table lists all contacts of its frames, so that every candidate
        without a row is no contact.
    gap
        Returns the gap between two rows of bodies in a frame of the run over the mean radius of both, NaN where a
        body is not seen. If given, a contact between bodies that are far apart is refused.

    Raises
    ------
    InputError
        A frame, grain, wall or verdict is unknown, or a contact cannot be one; nothing is written.
    """
    present = [name for name in _OPTIONAL if name in (file.names if isinstance(file, Table) else _header(file))]
    table = file if isinstance(file, Table) else read_table(file, ("frame", "i", "j", *present))
    rows = bodies.rows()
    frame, i = table.integers("frame"), table.integers("i")
    seconds = table.numbers("seconds") if "seconds" in present else None
    entries: list[Entry] = []
    listed: set[Pair] = set()
    for row, text in enumerate(table.text("j")):
        number, a = int(frame[row]), int(i[row])
        b = text if text in bodies.walls else _grain(table, row, text)
        for column, body in (("i", a), ("j", b)):
            if body not in rows:
                raise table.error(row, column, "is not the id of a grain")
        if a == b:
            raise table.error(row, "j", "is the grain itself")
        if number not in frames:
            raise table.error(row, "frame", f"is not a frame of the results ({frames[0]} to {frames[-1]})")
        given = table.text("verdict")[row] if "verdict" in present else Verdict.CONTACT.value
        verdict = given.strip().lower().replace("_", " ")
        if verdict not in {each.value for each in Verdict}:
            raise table.error(row, "verdict", "is none of contact, no contact, unsure")
        apart = gap(number - frames[0], rows[a], rows[b]) if gap is not None and verdict == Verdict.CONTACT else 0.0
        if apart > MAX_GAP:
            raise table.error(row, "j", f"is no contact of {a}: their surfaces are {apart:.2g} radii apart")
        pair = canonical((number, a, b))
        listed.add(pair)
        name = table.text("reviewer")[row] if "reviewer" in present else ""
        entries.append(
            Entry(
                number, name or reviewer, pair[1], pair[2], Verdict(verdict),
                seconds=float(seconds[row]) if seconds is not None else 0.0, origin=Origin.IMPORT,
                time=table.text("time")[row] if "time" in present else "",
            )
        )  # fmt: skip
    for number in sorted(set(frame.tolist())) if candidates is not None else ():
        assert candidates is not None
        for low, high in candidates.get(number - frames[0], ()):
            a = bodies.name(low)
            assert isinstance(a, int)
            if canonical((number, a, bodies.name(high))) not in listed:
                entries.append(Entry(number, reviewer, a, bodies.name(high), Verdict.NO_CONTACT, origin=Origin.IMPORT))
    return log.append_all(entries)


def _header(file: Path) -> list[str]:
    try:
        with regular(file).open(newline="", encoding="utf-8-sig") as stream:
            return [name.strip() for name in next(csv.reader(stream), [])]
    except (OSError, UnicodeDecodeError, csv.Error):
        return []  # read_table reports the error


def _grain(table: Table, row: int, text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise table.error(row, "j", "is neither a grain's id nor the name of a wall") from None
