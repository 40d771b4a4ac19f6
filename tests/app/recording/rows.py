"""Reads the rows of a recording without trusting the code under test."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any

from rerun.chunk import RrdReader


def components(path: Path) -> dict[str, tuple[set[str], set[str]]]:
    """Entity path → names of its timelines and of its components."""
    found: dict[str, tuple[set[str], set[str]]] = defaultdict(lambda: (set(), set()))
    for chunk in RrdReader(str(path)).store().stream().to_chunks():
        for field in chunk.to_record_batch().schema:
            kind = (field.metadata or {}).get(b"rerun:kind")
            if kind == b"index":
                found[chunk.entity_path][0].add(field.name)
            elif kind == b"data":
                found[chunk.entity_path][1].add(field.name)
    return dict(found)


def rows(path: Path, entity: str) -> list[dict[str, Any]]:
    """All rows of an entity in the order in which they were logged, as name → value (absent: no such key)."""
    found = []
    for chunk in RrdReader(str(path)).store().stream().filter(content=entity).to_chunks():
        for row in chunk.to_record_batch().to_pylist():
            found.append({name: value for name, value in row.items() if value is not None})
    return sorted(found, key=lambda row: row["rerun.controls.RowId"])


def latest(path: Path, entity: str, timeline: str, at: int) -> dict[str, Any]:
    """What the viewer shows of an entity: every component's latest value, the last row winning."""
    shown: dict[str, Any] = {}
    for row in sorted(rows(path, entity), key=lambda row: row.get(timeline, -1)):
        if timeline in row and row[timeline] <= at:
            shown.update(row)
    return shown
