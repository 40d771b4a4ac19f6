"""Bars around the rods of a photograph."""

from __future__ import annotations

import numpy as np

from ....experiment.experiment import GrainGuess
from ....experiment.pictures.image import Image
from ....process.counts import state_count
from ....process.errors import InputError
from ....solver.bodies.grains import Array
from ....tracking.detection.detect import Detection
from ....tracking.walls.inner_edge import find_edge
from ....tracking.walls.surrounding_bars import depth_in_circles, find_bars, lines_to_corners
from ..validation import ValidationResult

TOUCHES = 0.08  # radii between the edge of a bar and the rod next to it; else it is another edge
SNAP = 0.6  # radii from the line that bounds the rods to the edge of a bar, at most
NARROWEST = 0.25  # radii: width of a bar that is seen
FEWEST_INSIDE = 8  # rods around which bars are found
NAMES = ("bottom", "right", "top", "left")
ALONG = np.linspace(0.0, 1.0, 21)[:, None]  # places on a line that are in the picture or not


def snap_wall(image: Image, line: Array, found: ValidationResult) -> tuple[Array, float]:
    """Move a drawn line (2, 2) [px] onto the edge beside it, if enough is visible.

    Returns
    -------
    tuple
        The line, with the packing on its left, and the visible fraction of the edge.
    """
    line = towards_packing(line, found)
    length = float(np.linalg.norm(line[1] - line[0]))
    edge = find_edge(image, line, min(max(0.03 * length, 8.0), 40.0))
    return edge.line if edge.is_seen else line, edge.fraction


def towards_packing(line: Array, found: ValidationResult) -> Array:
    """Return the line in the direction that has the packing to its left in the world."""
    assert found.shape is not None
    if found.rods is not None:
        middle = np.array([found.rods.x.mean(), found.rods.y.mean()])
    else:
        middle = 0.5 * np.array([found.shape[1], found.shape[0]], dtype=np.float64)
    along, to = line[1] - line[0], middle - line[0]
    return line if along[0] * to[1] - along[1] * to[0] < 0.0 else line[::-1].copy()  # y down


def find_walls(image: Image, found: ValidationResult) -> Array:
    """Find the bars (w, 2, 2) [px] around the rods; raise InputError if the rods are too few."""
    rods = found.rods
    for wrong in found.steps["rods"].errors:  # of a given table
        raise InputError("grains.csv", "", wrong)
    if rods is None or len(rods.id) < FEWEST_INSIDE:
        count = 0 if rods is None else len(rods.id)
        raise InputError(
            "bars", "", f"cannot be found around {state_count(count, 'rod')}: at least {FEWEST_INSIDE} are needed"
        )
    lines = find_bars(rods.x, rods.y, rods.radius)
    edges = [find_edge(image, line, SNAP * float(np.median(rods.radius))) for line in lines]
    chosen = [
        edge.line if edge.is_seen and abs(depth_in_circles(edge.line, rods.x, rods.y, rods.radius)) < TOUCHES else line
        for line, edge in zip(lines, edges, strict=True)
    ]
    return lines_to_corners(np.array(chosen))


def find_named(
    image: Image, found: ValidationResult, rods: Detection | None = None
) -> tuple[list[tuple[str, Array]], list[str]]:
    """Find the bars around the rods by name, and the names of the sides where the picture ends within the packing.

    rods: with circles whose centres lie outside of the picture; None: those of the table.
    """
    lines = find_walls(image, found)
    shown = found.rods if rods is None else rods
    assert shown is not None
    named = list(zip(names_of(lines), lines, strict=True))
    beyond = [name for name, line in named if bounds_picture(image, line, shown)]
    return [(name, line) for name, line in named if name not in beyond], beyond


def bounds_picture(image: Image, line: Array, rods: Detection | GrainGuess) -> bool:
    """Whether the picture ends within the packing at a line, where no bar is seen.

    Parameters
    ----------
    image : (H, W)
    line : array (2, 2)
        Ends [px] of a line that has the packing on its left.
    rods : Detection or GrainGuess
        With circles whose centres lie outside of the picture, if they were kept.

    Returns
    -------
    bool
        Less than half of a narrow bar there would lie in the picture, or a circle outside of it lies beyond the line.
    """
    along = line[1] - line[0]
    size = np.array(image.shape[::-1])
    outward = np.array([-along[1], along[0]]) / np.hypot(*along)
    places = line[0] + ALONG * along + NARROWEST * float(np.median(rods.radius)) * outward
    if np.mean(((places >= 0.0) & (places < size)).all(axis=1)) < 0.5:
        return True
    centre = np.column_stack([rods.x, rods.y])
    outside = ((centre < -0.5) | (centre > size - 0.5)).any(axis=1)
    place = centre[outside] - line[0]
    beyond = place @ outward
    return bool(np.any((beyond > 0.0) & (beyond < 2.0 * rods.radius[outside])))


def shows_edge(image: Image, line: Array, rods: GrainGuess) -> bool:
    """Whether the edge of a bar is seen along a line (2, 2) [px]."""
    return find_edge(image, line, SNAP * float(np.median(rods.radius))).is_seen


def names_of(lines: Array) -> tuple[str, ...]:
    """Return the names of the bars of a frame, in the order of find_walls."""
    return NAMES if len(lines) == len(NAMES) else tuple(f"wall{k + 1}" for k in range(len(lines)))
