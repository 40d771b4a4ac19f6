"""manifest.json of a run's folder: what each stored piece was made from, and the checksum that it must have.

A piece that is not listed, was made from something else or has another checksum is not there. The manifest stays in
the folder and is not shared, so that it may say where the experiment lies.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from ..atomic import write_atomically

MANIFEST = "manifest.json"
NAMES = "surrogateescape"  # a name of a file may be no text in any language; it is kept byte for byte


class Manifest:
    """What is written of one folder; read anew for every question, so that it is never older than the folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @property
    def file(self) -> Path:
        return self.folder / MANIFEST

    def tell(self, facts: dict[str, Any]) -> None:
        """Lay facts over those that are there: the experiment, its inputs, settings and verdicts."""
        self._write({**self._read(), **facts})

    def fact(self, name: str) -> Any:
        """One of the facts, None if it is not told."""
        return self._read().get(name)

    def add(self, name: str, fingerprint: str) -> None:
        """List a piece as it is now; fingerprint: of what it was made from."""
        pieces = self._pieces() | {name: {"made_from": fingerprint, "sha256": _digest(self.folder / name)}}
        self.tell({"pieces": pieces})

    def lists(self, name: str, fingerprint: str) -> bool:
        """Whether a piece was made from this."""
        return self._pieces().get(name, {}).get("made_from") == fingerprint

    def is_whole(self, name: str) -> bool:
        """Whether a piece is what it was when it was listed; one that is not listed is taken as it is."""
        expected = self._pieces().get(name, {}).get("sha256")
        file = self.folder / name
        return expected is None or (file.is_file() and _digest(file) == expected)

    def _pieces(self) -> dict[str, dict[str, str]]:
        pieces = self._read().get("pieces")
        listed = pieces.items() if isinstance(pieces, dict) else ()
        return {name: each for name, each in listed if isinstance(each, dict)}

    def _read(self) -> dict[str, Any]:
        try:
            found = json.loads(self.file.read_bytes().decode("utf-8", NAMES))
        except (FileNotFoundError, ValueError, RecursionError):  # a damaged manifest vouches for nothing
            return {}
        return found if isinstance(found, dict) else {}

    def _write(self, content: dict[str, Any]) -> None:
        text = json.dumps(content, indent=1, ensure_ascii=False) + "\n"
        write_atomically(self.file, text.encode("utf-8", NAMES))


def _digest(file: Path) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
