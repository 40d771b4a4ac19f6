"""manifest.json of a run's folder: the provenance and the checksum of each stored file.

A file that is not listed, has another provenance or another checksum is ignored. The manifest stays in the folder and
is not shared, so that it may hold the path of the experiment.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from ..process.atomic import write_atomically

MANIFEST = "manifest.json"
NAMES = "surrogateescape"  # error handler: names of files that are not valid UTF-8 are kept byte for byte


class Manifest:
    """The manifest of one folder, read again for every call, so that it is never older than the folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @property
    def file(self) -> Path:
        return self.folder / MANIFEST

    def store(self, facts: dict[str, Any]) -> None:
        """Add or replace facts: the experiment, its inputs, settings and verdicts."""
        self._write({**self._read(), **facts})

    def fact(self, name: str) -> Any:
        """Return one of the facts, None if it is not stored."""
        return self._read().get(name)

    def add(self, name: str, fingerprint: str, program: dict[str, Any] | None = None) -> None:
        """List a file as it is now; fingerprint: hash of its provenance; program: what made it."""
        entry = {"made_from": fingerprint, "sha256": _digest(self.folder / name), **(program or {})}
        self.store({"pieces": self._pieces() | {name: entry}})

    def note(self, name: str, facts: dict[str, Any]) -> None:
        """List a file with facts about it, without its checksum."""
        self.store({"pieces": self._pieces() | {name: facts}})

    def piece(self, name: str) -> dict[str, Any]:
        """Return the entry of a file; empty where it is not listed."""
        return self._pieces().get(name, {})

    def lists(self, name: str, fingerprint: str) -> bool:
        """Whether a file is listed with this fingerprint."""
        return self._pieces().get(name, {}).get("made_from") == fingerprint

    def is_whole(self, name: str) -> bool:
        """Whether a file is unchanged since it was listed; true for a file that is not listed."""
        expected = self._pieces().get(name, {}).get("sha256")
        file = self.folder / name
        return expected is None or (file.is_file() and _digest(file) == expected)

    def _pieces(self) -> dict[str, dict[str, Any]]:
        pieces = self._read().get("pieces")
        listed = pieces.items() if isinstance(pieces, dict) else ()
        return {name: each for name, each in listed if isinstance(each, dict)}

    def _read(self) -> dict[str, Any]:
        try:
            found = json.loads(self.file.read_bytes().decode("utf-8", NAMES))
        except (FileNotFoundError, ValueError, RecursionError):  # a damaged manifest lists no file
            return {}
        return found if isinstance(found, dict) else {}

    def _write(self, content: dict[str, Any]) -> None:
        text = json.dumps(content, indent=1, ensure_ascii=False) + "\n"
        write_atomically(self.file, text.encode("utf-8", NAMES))


def _digest(file: Path) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
