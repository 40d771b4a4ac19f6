"""The files of an experiment that is being set up: read as they are, written whole, every change undone by one step."""

from __future__ import annotations

import csv
import io
import threading
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import tomli_w

from ...atomic import write_atomically
from ...errors import InputError
from ...experiment.experiment import CONFIG_NAME

Contents = dict[str, bytes | None]  # of files by name; None: there is none


@dataclass(frozen=True, slots=True)
class Change:
    """What was done, and what the files were before it."""

    what: str
    before: Contents


@dataclass(slots=True)
class Draft:
    """The folder of one experiment. Nothing is kept but what can be undone."""

    folder: Path
    lock: threading.RLock = field(default_factory=threading.RLock)
    done: list[Change] = field(default_factory=list)
    undone: list[Change] = field(default_factory=list)

    @property
    def file(self) -> Path:
        return self.folder / CONFIG_NAME

    def data(self) -> dict[str, Any]:
        """The experiment file as it stands, valid or not; empty where there is none. Raises InputError if no TOML."""
        content = self._read(CONFIG_NAME)
        try:
            return {} if content is None else tomllib.loads(content.decode("utf-8"))
        except ValueError as error:
            raise InputError(self.file, "", f"is not TOML: {error}") from None

    def write(self, what: str, files: Mapping[str, bytes | None]) -> None:
        """Write files whole, None: remove; one step of undo, called `what`."""
        with self.lock:
            before = {name: self._read(name) for name in files}
            if before == dict(files):
                return
            self.done.append(Change(what, before))
            self.undone = []
            self._put(files)

    def with_keys(self, keys: Mapping[str, Any]) -> bytes:
        """The experiment file with dotted keys set, None: removed; its first comment stays."""
        data = deepcopy(self.data())
        for name, value in keys.items():
            *path, last = name.split(".")
            place = data
            for part in path:
                place = place.setdefault(part, {})
            if value is None:
                place.pop(last, None)
            else:
                place[last] = value
        return (self._first_comment() + tomli_w.dumps(data)).encode()

    def set_keys(self, what: str, keys: Mapping[str, Any], tables: Mapping[str, bytes | None] | None = None) -> None:
        """Set dotted keys of the experiment file, and write tables with it."""
        self.write(what, {**(tables or {}), CONFIG_NAME: self.with_keys(keys)})

    @contextmanager
    def one_step(self, what: str) -> Iterator[None]:
        """Make one step of undo of all that is written meanwhile; where it fails, nothing was."""
        with self.lock:
            since = len(self.done)
            try:
                yield
            except BaseException:
                while len(self.done) > since:
                    self.undo()
                raise
            changes, self.done = self.done[since:], self.done[:since]
            if changes:
                before = {name: content for each in reversed(changes) for name, content in each.before.items()}
                self.done.append(Change(what, before))

    def undo(self) -> str | None:
        """Take the last change back; gives what it was, None where there is none."""
        return self._swap(self.done, self.undone)

    def redo(self) -> str | None:
        """Do again what was undone last."""
        return self._swap(self.undone, self.done)

    def stamps(self, names: Iterable[str]) -> tuple[tuple[str, int, int], ...]:
        """By which it is seen whether files have changed, whoever changed them."""
        return tuple(stamp_of(self.folder / name) for name in (CONFIG_NAME, *names))

    def _swap(self, source: list[Change], target: list[Change]) -> str | None:
        with self.lock:
            if not source:
                return None
            change = source.pop()
            target.append(Change(change.what, {name: self._read(name) for name in change.before}))
            self._put(change.before)
            return change.what

    def _put(self, files: Mapping[str, bytes | None]) -> None:
        for name, content in files.items():
            if content is None:
                (self.folder / name).unlink(missing_ok=True)
            else:
                write_atomically(self.folder / name, content)

    def _read(self, name: str) -> bytes | None:
        try:
            return (self.folder / name).read_bytes()
        except FileNotFoundError:
            return None

    def _first_comment(self) -> str:
        lines = (self._read(CONFIG_NAME) or b"").decode("utf-8").splitlines(keepends=True)
        count = next((k for k, line in enumerate(lines) if not line.startswith("#")), len(lines))
        return "".join(lines[:count])


def as_table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> bytes:
    """A table as comma-separated text."""
    stream = io.StringIO(newline="")
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    return stream.getvalue().encode()


def stamp_of(file: Path) -> tuple[str, int, int]:
    """Name, time of the last change and size of a file; −1 where there is none."""
    try:
        told = file.stat()
    except OSError:
        return file.name, -1, -1
    return file.name, told.st_mtime_ns, told.st_size
