"""The log of what people said: one JSON object per line, appended and never rewritten.

Three kinds of line. A verdict has `frame`, `a`, `b` (a grain's id each, or a wall's name for `b`) and `verdict`. A
flag has `frame`, `flag` and `on`. An undo has `undo`, the `line` it takes back. All have `reviewer`, `time` (ISO 8601,
UTC), `seconds` spent, the program's `version` and a random name `line`; a verdict also tells `origin` (how the pair
came up) and `blind`. A reviewer's last word on a pair counts.

A line is written by one call under a lock and flushed to the disk, so that two tabs, or two programs, cannot mix
their lines. A line torn by a crash is passed over and counted; the next line begins on a line of its own.
"""

from __future__ import annotations

import json
import os
import secrets
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import Any

from .. import __version__
from ..errors import InputError

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
    """How a pair came before the reviewer. Only a pair that the queue chose says something about its like."""

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
        """What the line is about: a later line of the same reviewer on it replaces an earlier one."""
        return (self.frame, self.flag) if self.pair is None else canonical(self.pair)


@dataclass(slots=True)
class _Words:
    """All lines of one file so far."""

    entries: dict[str, Entry] = field(default_factory=dict)  # by line, in the order of the file
    undone: set[str] = field(default_factory=set)
    torn: int = 0


class VerdictLog:
    """The log of one experiment's results. Lines that others append are seen at the next reading."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self._words = _Words()
        self._read_to = 0
        self._line_number = 0
        self._lock = threading.RLock()
        self._closed = False  # to lines that are not read yet

    def append(self, entry: Entry) -> Entry:
        """Write one verdict or flag; returns it with its time and name."""
        return self.append_all([entry])[0]

    def append_all(self, entries: list[Entry]) -> list[Entry]:
        """Write several lines at once; returns them with their times and names."""
        stamped = [_stamped(entry) for entry in entries]
        self._write([_as_json(entry) for entry in stamped])
        return stamped

    def as_of_now(self) -> VerdictLog:
        """The same without what will be said from now on."""
        with self._lock:
            self._read()
            words = self._words
            now = VerdictLog(self.file)
            now._words = _Words(dict(words.entries), set(words.undone), words.torn)
            now._closed = True
            return now

    def undo(self, reviewer: str) -> Entry | None:
        """Take back the reviewer's last line that still counts; None where there is none."""
        with self._lock:
            self._read()
            last = next(
                (e for e in reversed(self._words.entries.values()) if e.reviewer == reviewer and self._counts(e)), None
            )
            if last is None:
                return None
            self._write([{"undo": last.line, **_signature(_stamped(Entry(last.frame, reviewer)))}])
            return last

    def entries(self) -> list[Entry]:
        """Every line that was not taken back, in the order of the file."""
        with self._lock:
            self._read()
            return [e for e in self._words.entries.values() if self._counts(e)]

    def last_words(self, reviewer: str | None = None) -> list[Entry]:
        """Every reviewer's last line on every pair and flag; of one reviewer alone where named."""
        last: dict[tuple[object, ...], Entry] = {}
        for entry in self.entries():
            if reviewer is None or entry.reviewer == reviewer:
                last[(entry.reviewer, *entry.subject)] = entry
        return list(last.values())

    def verdicts(self, reviewer: str | None = None) -> Iterator[tuple[Pair, Entry]]:
        """The last words that are verdicts, with their pair."""
        for entry in self.last_words(reviewer):
            if entry.pair is not None and entry.verdict is not None:
                yield entry.pair, entry

    @property
    def torn(self) -> int:
        """Lines that were cut by a crash and are passed over."""
        with self._lock:
            self._read()
            return self._words.torn

    @property
    def size(self) -> int:
        """Bytes of the file: another number where anything was said since."""
        return self.file.stat().st_size if self.file.exists() else 0

    def _counts(self, entry: Entry) -> bool:
        return entry.line not in self._words.undone

    def _write(self, lines: list[dict[str, Any]]) -> None:
        content = "".join(json.dumps(line, ensure_ascii=False) + "\n" for line in lines).encode()
        with self._lock:
            self.file.parent.mkdir(parents=True, exist_ok=True)
            handle = os.open(self.file, os.O_RDWR | os.O_APPEND | os.O_CREAT, 0o644)
            try:
                if fcntl is not None:
                    fcntl.flock(handle, fcntl.LOCK_EX)
                end = os.lseek(handle, 0, os.SEEK_END)
                if end and os.pread(handle, 1, end - 1) != b"\n":
                    content = b"\n" + content
                while content:
                    content = content[os.write(handle, content) :]
                os.fsync(handle)
            finally:
                os.close(handle)  # which also unlocks

    def _read(self) -> None:
        """Read on from where the last reading ended, whole lines only."""
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
            self._words.torn += 1
            return
        where = f"line {self._line_number}"
        if not isinstance(values, dict):
            raise InputError(self.file, where, "is not a JSON object")
        if "undo" in values:
            self._words.undone.add(str(values["undo"]))
            return
        entry = _entry(self.file, where, values)
        self._words.entries[entry.line] = entry


def canonical(pair: Pair) -> Pair:
    """The same name for a pair from either side: the lower id first, a wall last."""
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
