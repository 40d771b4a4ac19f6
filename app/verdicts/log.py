"""The log of reviewers' verdicts: one JSON object per line, appended and never rewritten.

Four kinds of line. A verdict has `frame`, `a`, `b` (a grain's id each, or a wall's name for `b`) and `verdict`. A
flag has `frame`, `flag` and `on`. An undo has `undo`, the `line` it takes back. A new order has `photographs`, their
names `before` and `after`: lines above it stay with their photographs, whatever number these have then. All have
`reviewer`, `time` (ISO 8601, UTC), `seconds` spent, the program's `version` and a random name `line`; a verdict also
has `origin` (why the pair was judged) and `blind`. A reviewer's latest verdict on a pair counts.

A line is written by one call under a lock and flushed to the disk, so that two tabs, or two programs, cannot mix
their lines. A line cut by a crash is ignored and counted; the next entry begins on a new line.
"""

from __future__ import annotations

import hashlib
import json
import os
import secrets
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import Any

from .. import __version__
from ..process.errors import InputError

try:
    import fcntl
except ImportError:  # pragma: no cover - Windows: one program at a time
    fcntl = None

VERDICTS = "verdicts.jsonl"
Body = int | str  # a grain's id, or a wall's name
Pair = tuple[int, int, Body]  # frame, a grain, a grain or a wall


class Verdict(StrEnum):
    CONTACT = "contact"
    NO_CONTACT = "no contact"
    UNSURE = "unsure"


class Flag(StrEnum):
    REARRANGEMENT = "rearrangement"
    RESET = "reset"
    IGNORE = "ignore"


class Origin(StrEnum):
    """Why a reviewer judged a pair. Only pairs chosen by the queue are a random sample of similar pairs."""

    QUEUE = "queue"
    CLICK = "click"
    ADDED = "added"
    IMPORT = "import"


@dataclass(frozen=True, slots=True)
class Entry:
    """One line of the log, a verdict or a flag."""

    frame: int  # of the experiment's photographs
    reviewer: str
    a: int | None = None  # grain's id; None: a flag
    b: Body | None = None
    verdict: Verdict | None = None
    flag: Flag | None = None
    on: bool = True
    seconds: float = 0.0
    origin: Origin = Origin.QUEUE
    blind: bool = False
    time: str = ""
    line: str = ""

    @property
    def pair(self) -> Pair | None:
        return None if self.a is None or self.b is None else (self.frame, self.a, self.b)

    @property
    def subject(self) -> tuple[object, ...]:
        """The pair or flag of the line: a later line of the same reviewer on it replaces an earlier one."""
        return (self.frame, self.flag) if self.pair is None else canonical(self.pair)


@dataclass(slots=True)
class _Lines:
    """All lines of one file so far."""

    entries: dict[str, Entry] = field(default_factory=dict)  # by line, in the order of the file
    undone: set[str] = field(default_factory=set)
    photograph: dict[str, str] = field(default_factory=dict)  # by line, where the order has changed since
    set_aside: set[str] = field(default_factory=set)  # lines of photographs that are left out
    damaged: int = 0

    def reorder(self, before: list[str], after: list[str]) -> None:
        """Number all lines anew: each stays with its photograph."""
        number = {name: k for k, name in enumerate(after)}
        for line, entry in self.entries.items():
            if line not in self.photograph and 0 <= entry.frame < len(before):
                self.photograph[line] = before[entry.frame]
            name = self.photograph.get(line)
            if name in number:
                self.entries[line] = replace(entry, frame=number[name])
                self.set_aside.discard(line)
            elif name is not None:
                self.set_aside.add(line)


class VerdictLog:
    """The log of one experiment's results. Lines appended by other programs appear at the next access."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self._lines = _Lines()
        self._read_to = 0
        self._line_number = 0
        self._lock = threading.RLock()
        self._closed = False  # to later lines

    def append(self, entry: Entry) -> Entry:
        """Append one verdict or flag; return it with its time and name."""
        return self.append_all([entry])[0]

    def append_all(self, entries: list[Entry]) -> list[Entry]:
        """Append several lines at once; return them with their times and names."""
        stamped = [_stamped(entry) for entry in entries]
        self._write([_as_json(entry) for entry in stamped])
        return stamped

    def snapshot(self) -> VerdictLog:
        """Return the log without lines that are appended later."""
        with self._lock:
            self._read()
            lines = self._lines
            copy = VerdictLog(self.file)
            copy._lines = _Lines(
                dict(lines.entries), set(lines.undone), dict(lines.photograph), set(lines.set_aside), lines.damaged
            )
            copy._closed = True
            return copy

    def undo(self, reviewer: str) -> Entry | None:
        """Undo the reviewer's last line that counts; None where there is none."""
        with self._lock:
            self._read()
            last = self.last_line(reviewer)
            return None if last is None else self.undo_line(last.line)

    def undo_line(self, line: str) -> Entry | None:
        """Undo one line, by its name; None where there is none that counts."""
        with self._lock:
            self._read()
            entry = self._lines.entries.get(line)
            if entry is None or not self._counts(entry):
                return None
            self._write([{"undo": line, **_signature(_stamped(Entry(entry.frame, entry.reviewer)))}])
            return entry

    def repeat(self, line: str) -> Entry | None:
        """Append a line again, by its name; None where there is none."""
        with self._lock:
            self._read()
            entry = self._lines.entries.get(line)
            return None if entry is None else self.append(replace(entry, time=""))

    def reorder(self, before: Sequence[str], after: Sequence[str]) -> None:
        """Note that the photographs have another order: lines stay with theirs; those of absent ones do not count.

        Parameters
        ----------
        before, after
            Names of the photographs in both orders.
        """
        if list(before) != list(after) and self.size:
            self._write(
                [{"photographs": {"before": list(before), "after": list(after)}, **_signature(_stamped(Entry(0, "")))}]
            )

    def last_line(self, reviewer: str) -> Entry | None:
        """Return the reviewer's last line that counts; None where there is none."""
        with self._lock:
            self._read()
            counting = (e for e in reversed(self._lines.entries.values()) if e.reviewer == reviewer and self._counts(e))
            return next(counting, None)

    def entries(self) -> list[Entry]:
        """Return all lines that were not undone, in the order of the file."""
        with self._lock:
            self._read()
            return [e for e in self._lines.entries.values() if self._counts(e)]

    def latest_entries(self, reviewer: str | None = None) -> list[Entry]:
        """Return the latest line of every reviewer, or of the given one, on every pair and flag."""
        last: dict[tuple[object, ...], Entry] = {}
        for entry in self.entries():
            if reviewer is None or entry.reviewer == reviewer:
                last[(entry.reviewer, *entry.subject)] = entry
        return list(last.values())

    def verdicts(self, reviewer: str | None = None) -> Iterator[tuple[Pair, Entry]]:
        """Yield the latest verdicts with their pairs."""
        for entry in self.latest_entries(reviewer):
            if entry.pair is not None and entry.verdict is not None:
                yield entry.pair, entry

    @property
    def damaged_lines(self) -> int:
        """Number of lines that were cut by a crash and are ignored."""
        with self._lock:
            self._read()
            return self._lines.damaged

    @property
    def size(self) -> int:
        """Size of the file [bytes], which changes with every new line."""
        return self.file.stat().st_size if self.file.exists() else 0

    def _counts(self, entry: Entry) -> bool:
        return entry.line not in self._lines.undone and entry.line not in self._lines.set_aside

    def _write(self, lines: list[dict[str, Any]]) -> None:
        content = "".join(json.dumps(line, ensure_ascii=False) + "\n" for line in lines).encode()
        with self._lock:
            self.file.parent.mkdir(parents=True, exist_ok=True)
            handle = os.open(self.file, os.O_RDWR | os.O_APPEND | os.O_CREAT | getattr(os, "O_BINARY", 0), 0o644)
            try:
                if fcntl is not None:
                    fcntl.flock(handle, fcntl.LOCK_EX)
                end = os.lseek(handle, 0, os.SEEK_END)
                if end:
                    os.lseek(handle, end - 1, os.SEEK_SET)  # pread is missing on Windows
                    content = content if os.read(handle, 1) == b"\n" else b"\n" + content
                while content:
                    content = content[os.write(handle, content) :]
                os.fsync(handle)
            finally:
                os.close(handle)  # releases the lock

    def _read(self) -> None:
        """Read the complete lines after those that were read before."""
        if self._closed:
            return
        try:
            with self.file.open("rb") as stream:
                stream.seek(self._read_to)
                content = stream.read()
        except FileNotFoundError:
            return
        except OSError as error:
            raise InputError(self.file, "", f"cannot be read ({error.strerror})") from None
        whole = content.rfind(b"\n") + 1
        self._read_to += whole
        for line in content[:whole].split(b"\n")[:-1]:
            self._line_number += 1
            self._take(line)

    def _take(self, line: bytes) -> None:
        if not line.strip():
            return
        try:
            values = json.loads(line)
        except (ValueError, RecursionError):
            self._lines.damaged += 1
            return
        where = f"line {self._line_number}"
        if not isinstance(values, dict):
            raise InputError(self.file, where, "is not a JSON object")
        if "undo" in values:
            self._lines.undone.add(str(values["undo"]))
            return
        if "photographs" in values:
            self._lines.reorder(*_orders(self.file, where, values["photographs"]))
            return
        entry = _entry(self.file, where, values)
        self._lines.entries[entry.line] = entry


def canonical(pair: Pair) -> Pair:
    """Return a pair in canonical order: the lower id first, a wall last."""
    frame, a, b = pair
    return (frame, b, a) if isinstance(b, int) and b < a else pair


def _stamped(entry: Entry) -> Entry:
    time = entry.time or datetime.now(UTC).isoformat(timespec="milliseconds")
    return Entry(
        entry.frame, entry.reviewer, entry.a, entry.b, entry.verdict, entry.flag, entry.on, entry.seconds,
        entry.origin, entry.blind, time, secrets.token_hex(8),
    )  # fmt: skip


def _signature(entry: Entry) -> dict[str, Any]:
    return {
        "reviewer": entry.reviewer, "time": entry.time, "seconds": round(entry.seconds, 3), "version": __version__,
        "line": entry.line,
    }  # fmt: skip


def _as_json(entry: Entry) -> dict[str, Any]:
    if entry.flag is not None:
        return {"frame": entry.frame, "flag": entry.flag.value, "on": entry.on, **_signature(entry)}
    assert entry.verdict is not None
    return {
        "frame": entry.frame, "a": entry.a, "b": entry.b, "verdict": entry.verdict.value, **_signature(entry),
        "origin": entry.origin.value, "blind": entry.blind,
    }  # fmt: skip


def _orders(file: Path, where: str, orders: object) -> tuple[list[str], list[str]]:
    """The names of the photographs before and after a change of their order."""
    found = [orders.get(key) if isinstance(orders, dict) else None for key in ("before", "after")]
    before, after = found
    if not isinstance(before, list) or not isinstance(after, list):
        raise InputError(file, f"{where}, photographs", "has no lists before and after")
    return [str(each) for each in before], [str(each) for each in after]


def _entry(file: Path, where: str, values: dict[str, Any]) -> Entry:
    def value(key: str, kinds: type | tuple[type, ...]) -> Any:
        found = values.get(key)
        if not isinstance(found, kinds) or (isinstance(found, bool) and kinds is not bool):
            raise InputError(file, f"{where}, {key} = {found!r}", "is missing or of the wrong kind")
        return found

    def member(key: str, kind: type[StrEnum], default: str | None = None) -> Any:
        found = values.get(key, default)
        if not isinstance(found, str) or found not in {each.value for each in kind}:
            allowed = ", ".join(each.value for each in kind)
            raise InputError(file, f"{where}, {key} = {found!r}", f"is none of {allowed}")
        return kind(found)

    def seconds() -> float:
        found = values.get("seconds", 0.0)
        if isinstance(found, bool) or not isinstance(found, int | float) or not 0.0 <= found < 1e12:
            raise InputError(file, f"{where}, seconds = {str(found)[:50]}", "is no number of seconds")
        return float(found)

    frame, reviewer = value("frame", int), value("reviewer", str)
    if "flag" in values:
        return Entry(
            frame, reviewer, flag=member("flag", Flag), on=bool(values.get("on", True)),
            time=str(values.get("time", "")), line=str(values.get("line", where)),
        )  # fmt: skip
    return Entry(
        frame, reviewer, value("a", int), value("b", (int, str)), member("verdict", Verdict),
        seconds=seconds(), origin=member("origin", Origin, Origin.QUEUE),
        blind=bool(values.get("blind", False)), time=str(values.get("time", "")), line=str(values.get("line", where)),
    )  # fmt: skip


def fingerprint(log: VerdictLog) -> str:
    """Return a hash of all latest verdicts and flags that affect the solver; empty without any."""
    facts = [
        [entry.reviewer, *(str(each) for each in entry.subject), str(entry.verdict), entry.on]
        for entry in log.latest_entries()
        if entry.verdict is not Verdict.UNSURE and (entry.flag is None or entry.on)
    ]
    return hashlib.sha256(json.dumps(sorted(facts)).encode()).hexdigest() if facts else ""
