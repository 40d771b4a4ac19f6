"""The files of an experiment that is being set up: read as they are, written whole, every change with undo."""

from __future__ import annotations

import csv
import io
import threading
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...experiment.config.dotted_keys import leaves, with_values
from ...experiment.config.experiment_file import find_wrong_values
from ...experiment.experiment import CONFIG_NAME
from ...experiment.reading.input_files import read_text_file
from ...process.atomic import write_atomically
from ...process.errors import InputError
from .journal import Action, Contents, Journal, checksum_of
from .toml_edit import MISSING, set_values

Stamp = tuple[str, int, int, int, int]


@dataclass(slots=True)
class Draft:
    """The folder of one experiment, with the journal of its actions."""

    folder: Path
    journal: Journal = field(default_factory=Journal)  # default: in memory
    lock: threading.RLock = field(default_factory=threading.RLock)
    root: Path | None = None  # nothing outside of it is read or written; None: read anywhere, written in the folder
    _shown: dict[str, Any] | None = None  # the experiment file as the user saw it last
    _step: Contents | None = None  # files before the first change of a step that is not finished

    @property
    def file(self) -> Path:
        return self.folder / CONFIG_NAME

    def data(self) -> dict[str, Any]:
        """Read the experiment file, valid or not; empty where there is none. Raises InputError if it is no TOML."""
        content = self._read(CONFIG_NAME)
        try:
            return {} if content is None else tomllib.loads(content.decode("utf-8"))
        except ValueError as error:
            raise InputError(self.file, "", f"is not TOML: {error}") from None
        except RecursionError:
            raise InputError(self.file, "", "is nested too deeply") from None

    def content(self, name: str) -> bytes | None:
        """Read a file of the experiment; None where there is none. Raises InputError outside of the root."""
        return self._read(name)

    def write(self, name: str, files: Mapping[str, bytes | None]) -> None:
        """Write whole files, None: remove; one step of undo with a name."""
        with self.lock:
            before = {file: self._read(file) for file in files}
            if before == dict(files):
                return
            if self._step is None:
                self.journal.record(name, before, files)
            else:
                self._step = {**before, **self._step}
            self._put(files)

    def with_keys(self, keys: Mapping[str, Any]) -> bytes:
        """Return the experiment file with dotted keys set, None: removed; comments and order are kept."""
        self.data()  # raises where it is no TOML
        return set_values((self._read(CONFIG_NAME) or b"").decode("utf-8"), keys).encode()

    def note_shown(self) -> None:
        """Note that the user sees the experiment file as it is now: what others change later, an edit must not undo."""
        self._shown = self.data()

    def set_keys(self, name: str, keys: Mapping[str, Any], tables: Mapping[str, bytes | None] | None = None) -> None:
        """Set dotted keys of the experiment file, and write tables with it, as one step of undo.

        Raises
        ------
        InputError
            A value is wrong, or another program has changed it since the user saw it: nothing is written.
        """
        self._refuse_overwriting(keys)
        content = self.with_keys(keys)
        wrong = find_wrong_values(
            self.file, tomllib.loads(content.decode()), [key for key in keys if keys[key] is not None]
        )
        if wrong:
            raise InputError(wrong[0], "", "")
        self.write(name, {**(tables or {}), CONFIG_NAME: content})

    @contextmanager
    def one_step(self, name: str) -> Iterator[None]:
        """Join all changes inside the block to one step of undo; an exception reverts them."""
        with self.lock:
            if self._step is not None:  # part of a larger step
                yield
                return
            self._step = {}
            try:
                yield
            except BaseException:
                self._put(self._step)
                raise
            else:
                if self._step:
                    self.journal.record(name, self._step, {file: self._read(file) for file in self._step})
            finally:
                self._step = None

    def undo(self) -> str | None:
        """Undo the last change of files; return its name, None where there is none."""
        return self.revert(self.journal.last_done(), back=True)

    def redo(self) -> str | None:
        """Repeat the change that was undone last; return its name, None where there is none."""
        return self.revert(self.journal.last_undone(), back=False)

    def revert(self, action: Action | None, *, back: bool) -> str | None:
        """Undo a change of files, or (back false) repeat it; raise InputError where another program changed them."""
        if action is None:
            return None
        with self.lock:
            expected, wanted = (action.after, action.before) if back else (action.before, action.after)
            for name, checksum in expected.items():
                content = self._read(name)
                if (None if content is None else checksum_of(content)) != checksum:
                    raise InputError(
                        self.folder / name, "", f"was changed by another program after “{action.name}”: "
                        f"{'undoing' if back else 'repeating'} it here would overwrite that change",
                    )  # fmt: skip
            self._put(self.journal.contents(wanted))
            (self.journal.undo if back else self.journal.redo)(action)
            return action.name

    def stamps(self, names: Iterable[str]) -> tuple[Stamp, ...]:
        """Return values that change with the files, whoever changed them."""
        return tuple(stamp_of(self.folder / name) for name in (CONFIG_NAME, *names))

    def _refuse_overwriting(self, keys: Mapping[str, Any]) -> None:
        """Raise InputError where an edit replaces what another program has written since the user saw the file."""
        if self._shown is None:
            return
        now, seen = leaves(self.data()), leaves(self._shown)
        edited = leaves(with_values(self.data(), keys))
        for key in now.keys() | seen.keys() | edited.keys():
            former, present, new = (values.get(key, MISSING) for values in (seen, now, edited))
            if former != present and present != new and former != new:
                self.note_shown()
                raise InputError(
                    self.file, f"key {key}", f"was changed by another program, from {_word(former)} to "
                    f"{_word(present)}, since the page showed it; nothing was written. Repeat the edit to replace it",
                )  # fmt: skip

    def _put(self, files: Mapping[str, bytes | None]) -> None:
        for name, content in files.items():
            place = self._inside(name, follow=False)
            if content is None:
                place.unlink(missing_ok=True)
            else:
                write_atomically(place, content)
        if self._shown is not None and CONFIG_NAME in files:
            self.note_shown()

    def _read(self, name: str) -> bytes | None:
        try:
            return read_text_file(self._inside(name))
        except FileNotFoundError:
            return None
        except OSError as error:
            raise InputError(self.folder / name, "", f"cannot be read ({error.strerror or error})") from None

    def _inside(self, name: str, *, follow: bool = True) -> Path:
        """Return the path of a file; raise InputError where it lies outside of the root.

        follow: a link counts as the file that it leads to; a file that is replaced counts where it is.
        """
        file, root = self.folder / name, (self.root or self.folder).resolve()
        try:
            place = file.resolve() if follow else file.parent.resolve() / file.name
        except (OSError, ValueError):  # links in a circle, or a name that no file can have
            raise InputError(self.file, f"file {name!r}", "is no name of a file") from None
        if not place.is_relative_to(root) or file.name in ("", ".", ".."):
            raise InputError(self.file, f"file {name!r}", f"lies outside of {root}: the workbench does not touch it")
        return file


def _word(value: Any) -> str:
    return "nothing" if value is MISSING else str(value)


def as_table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> bytes:
    """Write a table as comma-separated text."""
    stream = io.StringIO(newline="")
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    return stream.getvalue().encode()


def stamp_of(file: Path) -> Stamp:
    """Return name, size, number and times of a file, −1 where there is none.

    An exchange with a file of the same size and time gives another number or another time of its entry.
    """
    try:
        stat = file.stat()
    except (OSError, ValueError):  # ValueError: a name that no file can have
        return file.name, -1, -1, -1, -1
    return file.name, stat.st_mtime_ns, stat.st_size, stat.st_ino, stat.st_ctime_ns
