"""The log beside corrections.csv: what was changed in it, when, before and after; one JSON object per line, appended.

Undo and redo change the table, too, and are lines like any other: the log tells the table's whole past.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from .corrections import Correction, Difference

LOG = "corrections_log.jsonl"
MOST = 500  # lines that are told


def append_changes(folder: Path, changes: Sequence[Difference], how: str) -> None:
    """Write down what has changed; how: in a word, what did it."""
    if not changes:
        return
    time = datetime.now(UTC).isoformat(timespec="seconds")
    lines = [
        {"time": time, "how": how, "frame": each.frame, "id": each.id,
         "before": _told(each.before), "after": _told(each.after)}
        for each in changes
    ]  # fmt: skip
    with (folder / LOG).open("a", encoding="utf-8") as stream:
        stream.write("".join(json.dumps(line) + "\n" for line in lines))


def read_changes(folder: Path) -> list[dict[str, Any]]:
    """The changes, the latest first; a line that was torn by a crash is passed over."""
    try:
        lines = (folder / LOG).read_text(encoding="utf-8").splitlines()
    except FileNotFoundError:
        return []
    told = []
    for line in reversed(lines[-MOST:]):
        try:
            told.append(json.loads(line))
        except ValueError:
            continue
    return told


def _told(correction: Correction | None) -> list[float | None] | str | None:
    """x, y [px] and theta [rad] as in the table, the word lost, or nothing."""
    if correction is None:
        return None
    if correction.pose is None:
        return "lost"
    x, y, theta = correction.pose
    return [round(x, 3), round(y, 3), None if theta is None else round(theta, 6)]
