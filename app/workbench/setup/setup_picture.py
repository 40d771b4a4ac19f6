"""A picture of the set-up: the first photograph with rods, walls, loads and scale drawn over it."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ...drawing.wall_marks import wall_mark
from ...experiment.pictures.image import Image
from ...solver.bodies.grains import Array
from ...solver.bodies.wall_shapes import STRAIGHT
from .validation import ValidationResult
from .walls.circles import circles_of

# Of classes of radii, distinct for the colour-blind (Okabe and Ito); blue, green, red.
COLOURS = ((233, 180, 86), (0, 159, 230), (115, 158, 0), (167, 121, 204), (66, 228, 240), (0, 94, 213))
WHITE, BLACK = (255, 255, 255), (0, 0, 0)
LEAST = 900  # [px] of the longer side of the picture


def draw_setup(photograph: Image, found: ValidationResult) -> bytes:
    """Draw the picture as PNG."""
    zoom = max(1.0, LEAST / max(photograph.shape))
    grey = np.clip(np.rint(0.7 * photograph), 0, 255).astype(np.uint8)
    picture = cv2.resize(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), None, fx=zoom, fy=zoom).astype(np.uint8)
    wide = max(1, round(max(picture.shape) / 700))
    _draw_rods(picture, found, zoom, wide)
    if found.walls is not None and found.scale is not None:
        ends = zoom * (found.scale.to_pixels(found.walls.endpoints[0]) + 0.5)
        for each in circles_of(found):
            centre = _at(zoom * (np.array([each.x, each.y]) + 0.5))
            cv2.circle(picture, centre, round(zoom * each.radius), COLOURS[1], 2 * wide, cv2.LINE_AA)
        for k, (name, pressure) in enumerate(zip(found.walls.name, found.walls.pressure, strict=True)):
            if found.walls.sides[k] != STRAIGHT:
                continue
            words = name if np.isnan(pressure) else f"{name}: {pressure / 1e3:g} kPa"
            red, green, blue = wall_mark(k).colour
            _draw_wall(picture, ends[k], words, (blue, green, red), wide, loaded=bool(pressure == pressure))
    if found.scale is not None:
        _draw_scale(picture, found.scale.mean_size / zoom, wide)
    return cv2.imencode(".png", picture)[1].tobytes()


def _draw_rods(picture: NDArray[np.uint8], found: ValidationResult, zoom: float, wide: int) -> None:
    """Circles, a colour for every class of radii."""
    if found.rods is None:
        return
    radii = sorted(found.data.get("photographs", {}).get("radii") or [])
    for x, y, r in zip(found.rods.x, found.rods.y, found.rods.radius, strict=True):
        kind = 0
        if radii and found.scale is not None:
            kind = int(np.abs(np.array(radii) - r * found.scale.mean_size).argmin())
        centre = (round(float(zoom * (x + 0.5)) * 16), round(float(zoom * (y + 0.5)) * 16))
        cv2.circle(picture, centre, round(float(zoom * r) * 16), COLOURS[kind % len(COLOURS)], wide, cv2.LINE_AA, 4)


def _draw_wall(
    picture: NDArray[np.uint8], line: Array, words: str, colour: tuple[int, int, int], wide: int, *, loaded: bool
) -> None:
    """A wall with arrows: towards the packing where it is loaded, else small ones that point to the inside."""
    start, end = line
    along = (end - start) / max(float(np.linalg.norm(end - start)), 1e-9)
    inward = np.array([along[1], -along[0]])
    cv2.line(picture, _at(start), _at(end), colour, 2 * wide, cv2.LINE_AA)
    size, count = (28.0 * wide, 7) if loaded else (12.0 * wide, 3)
    for k in range(count):
        foot = start + (k + 0.5) / count * (end - start)
        tail, tip = (foot - size * inward, foot) if loaded else (foot, foot + size * inward)
        cv2.arrowedLine(picture, _at(tail), _at(tip), colour, wide, cv2.LINE_AA, tipLength=0.35)
    (width, height), _ = cv2.getTextSize(words, cv2.FONT_HERSHEY_SIMPLEX, 0.55 * wide, wide)
    middle = 0.5 * (start + end) - 40.0 * wide * inward
    corner = (int(middle[0] - 0.5 * width), int(middle[1] + 0.5 * height))
    corner = (
        min(max(corner[0], 4), picture.shape[1] - width - 4), min(max(corner[1], height + 4), picture.shape[0] - 6),
    )  # fmt: skip
    _write(picture, words, corner, colour, wide)


def _draw_scale(picture: NDArray[np.uint8], pixel: float, wide: int) -> None:
    """A bar of a round length; pixel [m] of this picture."""
    most = 0.25 * picture.shape[1] * pixel
    power = 10.0 ** np.floor(np.log10(most))
    length = float(max(m * power for m in (1, 2, 5) if m * power <= most))
    right, bottom = picture.shape[1] - 20 * wide, picture.shape[0] - 16 * wide
    left = right - round(length / pixel)
    cv2.rectangle(picture, (left, bottom), (right, bottom + 4 * wide), WHITE, -1)
    _write(picture, f"{1e3 * length:g} mm", (left, bottom - 7 * wide), WHITE, wide)


def _write(
    picture: NDArray[np.uint8], text: str, corner: tuple[int, int], colour: tuple[int, int, int], wide: int
) -> None:
    for shade, thick in ((BLACK, 4 * wide), (colour, wide)):
        cv2.putText(picture, text, corner, cv2.FONT_HERSHEY_SIMPLEX, 0.55 * wide, shade, thick, cv2.LINE_AA)


def _at(point: Array) -> tuple[int, int]:
    return round(float(point[0])), round(float(point[1]))
