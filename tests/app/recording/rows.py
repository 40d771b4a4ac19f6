"""Reads the rows of a recording independently of the code under test."""

from __future__ import annotations

import os
from collections import defaultdict
from functools import lru_cache
from pathlib import Path
from typing import Any

from rerun.chunk import RrdReader


def store(path: Path) -> Any:
    """Return the content of a recording, which is read again only where the file has changed."""
    state = os.stat(path)
    return _store(str(path), state.st_ino, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=2)
def _store(path: str, *_: int) -> Any:
    return RrdReader(path).store()


def components(path: Path) -> dict[str, tuple[set[str], set[str]]]:
    """Return the names of timelines and of components of every entity path."""
    found: dict[str, tuple[set[str], set[str]]] = defaultdict(lambda: (set(), set()))
    for chunk in store(path).stream().to_chunks():
        for field in chunk.to_record_batch().schema:
            kind = (field.metadata or {}).get(b"rerun:kind")
            if kind == b"index":
                found[chunk.entity_path][0].add(field.name)
            elif kind == b"data":
                found[chunk.entity_path][1].add(field.name)
    return dict(found)


def rows(path: Path, entity: str) -> list[dict[str, Any]]:
    """Return all rows of an entity in the order of logging, as name → value (absent: no such key)."""
    found = []
    for chunk in store(path).stream().filter(content=entity).to_chunks():
        for row in chunk.to_record_batch().to_pylist():
            found.append({name: value for name, value in row.items() if value is not None})
    return sorted(found, key=lambda row: row["rerun.controls.RowId"])


def latest(path: Path, entity: str, timeline: str, at: int) -> dict[str, Any]:
    """Return the state of an entity in the viewer: the latest value of every component."""
    shown: dict[str, Any] = {}
    for row in sorted(rows(path, entity), key=lambda row: row.get(timeline, -1)):
        if timeline in row and row[timeline] <= at:
            shown.update(row)
    return shown
