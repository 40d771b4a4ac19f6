"""The log beside corrections.csv: every change with its time, before and after; one JSON object per line, appended.

Undo and redo change the table, too, and are logged as well.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from .corrections import Correction, Difference

LOG = "corrections_log.jsonl"
MOST_LISTED = 500  # lines


def append_changes(folder: Path, changes: Sequence[Difference], how: str) -> None:
    """Append changes to the log; how: the action, in a word."""
    if not changes:
        return
    time = datetime.now(UTC).isoformat(timespec="seconds")
    lines = [
        {"time": time, "how": how, "frame": each.frame, "id": each.id,
         "before": _as_values(each.before), "after": _as_values(each.after)}
        for each in changes
    ]  # fmt: skip
    with (folder / LOG).open("a", encoding="utf-8") as stream:
        stream.write("".join(json.dumps(line) + "\n" for line in lines))


def read_changes(folder: Path) -> list[dict[str, Any]]:
    """Read the changes, the latest first; a line that a crash cut off is skipped."""
    try:
        lines = (folder / LOG).read_text(encoding="utf-8").splitlines()
    except FileNotFoundError:
        return []
    changes = []
    for line in reversed(lines[-MOST_LISTED:]):
        try:
            changes.append(json.loads(line))
        except ValueError:
            continue
    return changes


def _as_values(correction: Correction | None) -> list[float | None] | str | None:
    """x, y [px] and theta [rad] as in the table, the word lost, or None."""
    if correction is None:
        return None
    if correction.pose is None:
        return "lost"
    x, y, theta = correction.pose
    return [round(x, 3), round(y, 3), None if theta is None else round(theta, 6)]
