"""A colour and a kind of line of its own for every wall of a picture."""

from __future__ import annotations

from typing import NamedTuple

# CIELAB differences of at least 23 in usual vision, protanopia, deuteranopia and tritanopia; found by exchanging one
# colour at a time for the one farthest from all others, among those with a lightness above 52 and a chroma above 28.
WALL_COLOURS = (
    (105, 255, 210), (255, 30, 0), (255, 180, 255), (135, 120, 210), (240, 255, 0), (0, 165, 165), (225, 135, 105),
    (180, 60, 255), (180, 255, 120), (255, 15, 135),
)  # fmt: skip
WALL_DASHES: tuple[tuple[float, ...], ...] = ((), (11.0, 6.0), (2.0, 6.0))  # [px] drawn and left out; (): unbroken


class WallMark(NamedTuple):
    """How a wall is drawn."""

    colour: tuple[int, int, int]  # red, green, blue
    dash: tuple[float, ...]  # [px] drawn and left out in turn; empty: an unbroken line


def wall_mark(wall: int) -> WallMark:
    """Return the mark of a wall: thirty walls differ, ten by colour alone, and then by the dashes of the line."""
    dashed, row = divmod(wall, len(WALL_COLOURS))
    return WallMark(WALL_COLOURS[row], WALL_DASHES[dashed % len(WALL_DASHES)])
