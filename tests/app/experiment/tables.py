"""Edits of an experiment's files that make typical mistakes."""

from __future__ import annotations

from pathlib import Path


def edit(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert old in text, f"{old!r} is not in {file.name}"
    file.write_text(text.replace(old, new, 1))


def swap_row(file: Path, row: int, cells: dict[int, str]) -> None:
    """Replace cells of a line (1 is the header)."""
    lines = file.read_text().splitlines()
    parts = lines[row - 1].split(",")
    for at, text in cells.items():
        parts[at] = text
    lines[row - 1] = ",".join(parts)
    file.write_text("\n".join(lines) + "\n")


def scale_radii(file: Path, factor: float) -> None:
    """Multiply every radius, the last column."""
    head, *rows = file.read_text().splitlines()
    cells = [row.rsplit(",", 1) for row in rows]
    file.write_text("\n".join([head, *(f"{first},{float(last) * factor}" for first, last in cells)]) + "\n")
