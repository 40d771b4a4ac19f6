"""The table of corrections of an experiment: rows added, replaced and removed, every change with undo."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ...experiment.corrections import LOST, read_corrections
from ..setup.draft import Draft, as_table
from ..setup.validation import ValidationResult

CORRECTIONS = "corrections.csv"
COLUMNS = ("frame", "id", "x", "y", "theta")


@dataclass(frozen=True, slots=True)
class Correction:
    """A pose given by hand; None: the rod is not visible in that photograph."""

    frame: int
    id: int
    pose: tuple[float, float, float | None] | None  # x, y [px]; theta [rad] counter-clockwise, None: to be found


@dataclass(frozen=True, slots=True)
class Difference:
    """One row of the table, before and after; None: it was not there."""

    frame: int
    id: int
    before: Correction | None
    after: Correction | None


def corrections_of(found: ValidationResult) -> list[Correction]:
    """Read the table of the experiment, in its order; raise InputError if it is malformed."""
    if found.experiment is None or not found.files:
        return []
    table = read_corrections(found.experiment, None, len(found.files))
    if table is None:
        return []
    rows = zip(table.frame.tolist(), table.id.tolist(), table.x, table.y, table.theta, strict=True)
    return [Correction(frame, name, _pose(x, y, theta)) for frame, name, x, y, theta in rows]


def add_corrections(draft: Draft, found: ValidationResult, added: Sequence[Correction]) -> None:
    """Write corrections as one step of undo; they replace those of the same rods and photographs."""
    replaced = {(each.frame, each.id) for each in added}
    others = [each for each in corrections_of(found) if (each.frame, each.id) not in replaced]
    name = f"rod {added[0].id} in photograph {added[0].frame}"
    _write(draft, found, [*others, *added], name + (f" and {len(added) - 1} that follow" if len(added) > 1 else ""))


def remove_correction(draft: Draft, found: ValidationResult, frame: int, name: int) -> None:
    """Remove a correction."""
    kept = [each for each in corrections_of(found) if (each.frame, each.id) != (frame, name)]
    _write(draft, found, kept, f"correction of rod {name} in photograph {frame} removed")


def differences(before: Iterable[Correction], after: Iterable[Correction]) -> list[Difference]:
    """List the changes from one table to another, by photograph and rod."""
    old = {(each.frame, each.id): each for each in before}
    new = {(each.frame, each.id): each for each in after}
    names = sorted(old.keys() | new.keys())
    return [Difference(*name, old.get(name), new.get(name)) for name in names if old.get(name) != new.get(name)]


def _write(draft: Draft, found: ValidationResult, corrections: list[Correction], name: str) -> None:
    file = found.data.get("photographs", {}).get("corrections", CORRECTIONS)
    rows = [
        (each.frame, each.id, *_cells(each)) for each in sorted(corrections, key=lambda each: (each.frame, each.id))
    ]
    key = {"photographs.corrections": file if rows else None}
    draft.set_keys(name, key, {file: as_table(COLUMNS, rows) if rows else None})


def _cells(correction: Correction) -> tuple[object, object, object]:
    if correction.pose is None:
        return LOST, LOST, LOST
    x, y, theta = correction.pose
    return round(x, 3), round(y, 3), "" if theta is None else round(theta, 6)


def _pose(x: float, y: float, theta: float) -> tuple[float, float, float | None] | None:
    return None if np.isnan(x) else (float(x), float(y), None if np.isnan(theta) else float(theta))
