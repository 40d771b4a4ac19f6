"""The journal of an experiment: every action of every step and every verdict, kept on disk, undone in reverse order.

One JSON object per line of journal.jsonl, appended: {"do": action}, {"undo": its name}, {"redo": its name}. Contents of
files, before and after, are stored once each, compressed, under their checksums.
"""

from __future__ import annotations

import hashlib
import json
import secrets
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from ...process.atomic import write_atomically

PLACE = ".rodsight"  # folder of the journal in that of the experiment
JOURNAL, CONTENTS = "journal.jsonl", "contents"
MOST, KEPT = 600, 300  # actions: above MOST the journal is shortened to KEPT

TABLE = "table"  # value of a request that is a whole table: the folder holds it
_REQUEST: ContextVar[dict[str, Any] | None] = ContextVar("request", default=None)
Contents = dict[str, bytes | None]  # of files by name; None: no such file


@dataclass(frozen=True, slots=True)
class Action:
    """One action: a change of files, or a verdict."""

    name: str  # as the user reads it
    before: dict[str, str | None] = field(default_factory=dict)  # checksums of contents by file; None: no such file
    after: dict[str, str | None] = field(default_factory=dict)
    verdict: dict[str, Any] | None = None  # the line of the verdict log
    request: dict[str, Any] | None = None  # of the page: its id, endpoint and values
    id: str = ""
    time: str = ""


class Journal:
    """The actions of one experiment; without a place they are kept in memory only."""

    def __init__(self, place: Path | None = None) -> None:
        self._place = place
        self._memory: dict[str, bytes] = {}
        self._read_to: tuple[int, int] | None = None
        self._done: list[Action] = []
        self._undone: list[Action] = []

    def record(self, name: str, before: Mapping[str, bytes | None], after: Mapping[str, bytes | None]) -> None:
        """Record a change of files."""
        self._add(Action(name, self._store(before), self._store(after)))

    def record_verdict(self, name: str, line: dict[str, Any]) -> None:
        """Record a line of the verdict log; where the folder cannot be written to, in memory only."""
        try:
            self._add(Action(name, verdict=line))
        except OSError:
            self._take({"do": asdict(_stamped(Action(name, verdict=line, request=_REQUEST.get())))})

    def done(self) -> list[Action]:
        """Return the actions that are not undone, in their order."""
        self._read()
        return list(self._done)

    def last_done(self) -> Action | None:
        """Return the action that would be undone; None: there is none."""
        self._read()
        return self._done[-1] if self._done else None

    def last_undone(self) -> Action | None:
        """Return the action that would be repeated; None: there is none."""
        self._read()
        return self._undone[-1] if self._undone else None

    def undo(self, action: Action) -> None:
        """Note that the last action is undone."""
        self._append({"undo": action.id})

    def redo(self, action: Action, verdict: dict[str, Any] | None = None) -> None:
        """Note that the action undone last is repeated; verdict: its new line."""
        self._append({"redo": action.id, **({} if verdict is None else {"verdict": verdict})})

    def contents(self, checksums: Mapping[str, str | None]) -> Contents:
        """Return stored contents by file; raise OSError where one is gone."""
        return {name: None if checksum is None else self._load(checksum) for name, checksum in checksums.items()}

    def _add(self, action: Action) -> None:
        self._read()
        self._append({"do": asdict(_stamped(replace(action, request=_REQUEST.get())))})
        if len(self._done) > MOST:
            self._shorten()

    def _append(self, line: dict[str, Any]) -> None:
        self._read()
        if self._place is not None:
            self._place.mkdir(exist_ok=True)
            with (self._place / JOURNAL).open("a", encoding="utf-8") as stream:
                stream.write(json.dumps(line) + "\n")
            self._read_to = self._size()
        self._take(line)

    def _read(self) -> None:
        """Read the file again where another program has changed it; a line that a crash cut off is skipped."""
        if self._place is None or self._read_to == (size := self._size()):
            return
        try:
            lines = (self._place / JOURNAL).read_text(encoding="utf-8").splitlines()
        except FileNotFoundError:
            lines = []
        self._done, self._undone, self._read_to = [], [], size
        for line in lines:
            try:
                values = json.loads(line)
            except ValueError:
                continue
            if isinstance(values, dict):
                self._take(values)

    def _take(self, line: dict[str, Any]) -> None:
        if "do" in line:
            self._done.append(Action(**line["do"]))
            self._undone = []
        elif "undo" in line and self._done and self._done[-1].id == line["undo"]:
            self._undone.append(self._done.pop())
        elif "redo" in line and self._undone and self._undone[-1].id == line["redo"]:
            action = self._undone.pop()
            self._done.append(replace(action, verdict=line.get("verdict", action.verdict)))

    def _size(self) -> tuple[int, int] | None:
        assert self._place is not None
        try:
            stat = (self._place / JOURNAL).stat()
        except OSError:
            return None
        return stat.st_size, stat.st_mtime_ns

    def _store(self, contents: Mapping[str, bytes | None]) -> dict[str, str | None]:
        return {name: None if content is None else self._store_one(content) for name, content in contents.items()}

    def _store_one(self, content: bytes) -> str:
        checksum = checksum_of(content)
        if self._place is None:
            self._memory[checksum] = content
        elif not (file := self._file(checksum)).exists():
            file.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(file, zlib.compress(content, 1))
        return checksum

    def _load(self, checksum: str) -> bytes:
        return self._memory[checksum] if self._place is None else zlib.decompress(self._file(checksum).read_bytes())

    def _file(self, checksum: str) -> Path:
        assert self._place is not None
        return self._place / CONTENTS / checksum

    def _shorten(self) -> None:
        """Forget the oldest actions, and contents that no other needs."""
        self._done = self._done[-KEPT:]
        if self._place is None:
            return
        lines = [json.dumps({"do": asdict(each)}) for each in self._done]
        write_atomically(self._place / JOURNAL, ("\n".join(lines) + "\n").encode())
        self._read_to = self._size()
        needed = {checksum for each in self._done for part in (each.before, each.after) for checksum in part.values()}
        for file in (self._place / CONTENTS).iterdir():
            if file.name not in needed:
                file.unlink(missing_ok=True)


@contextmanager
def requested(endpoint: str, values: Mapping[str, Any]) -> Iterator[None]:
    """Record that actions inside the block were requested by the page: so, a script can repeat them."""
    kept = {key: value for key, value in values.items() if key not in ("at", TABLE)}
    if values.get(TABLE) is not None:
        kept["given"] = True
    token = _REQUEST.set({"id": secrets.token_hex(4), "endpoint": endpoint, "values": kept})
    try:
        yield
    finally:
        _REQUEST.reset(token)


def checksum_of(content: bytes) -> str:
    """Return the name under which a content is stored."""
    return hashlib.sha256(content).hexdigest()[:40]


def _stamped(action: Action) -> Action:
    return replace(action, id=secrets.token_hex(8), time=datetime.now(UTC).isoformat(timespec="milliseconds"))
