"""Corners of a frame: discs fixed to the frame where two bars meet, which rods touch as they touch the bars.

A disc belongs to a bar and turns with it. Under a load on that bar both are one plate, with one motion and one load.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from ...process.errors import InputError
from ...solver.bodies.grains import Array
from ...solver.bodies.wall_shapes import circle_ends
from .tables import Table, check_unique

CORNER_COLUMNS = ("frame", "corner", "x", "y", "radius")
FEWEST = 3  # corners that enclose a packing
SIDES = ("bottom", "right", "top", "left")  # names of the bars between four corners, by their outward normals
AT_CORNER = 1.0  # radii between the centre of a disc and the end of a bar that meets another one there, at most


@dataclass(frozen=True, slots=True)
class FrameCorners:
    """The corner discs of a frame."""

    name: tuple[str, ...]  # (c,)
    centre: Float[Array, "f c 2"]  # [m]
    radius: Float[Array, " c"]  # [m]
    angle: Float[Array, "f c"]  # [rad]; NaN: turns with its bar

    def endpoints(self, bar: NDArray[np.intp], bars: Array) -> Array:
        """Return ends of diameters (f, c, 2, 2) [m] that turn with the discs.

        Parameters
        ----------
        bar : (c,)
            Bar that each disc is fixed to; −1: none, the disc does not turn.
        bars : (f, w, 2, 2)
            Ends of the bars [m].
        """
        along = bars[:, :, 1] - bars[:, :, 0]
        direction = np.unwrap(np.arctan2(along[..., 1], along[..., 0]), axis=0)
        turned = np.column_stack([direction - direction[:1], np.zeros(len(bars))])[:, bar]
        angle = np.where(np.isfinite(self.angle), self.angle, np.nan_to_num(turned))  # NaN: bars that are followed
        return circle_ends(self.centre, np.broadcast_to(self.radius, angle.shape), angle)


def arrange_corners(table: Table, frame_count: int, *, followed: bool = False) -> FrameCorners:
    """Return corner discs from a table frame,corner,x,y,radius and perhaps theta [rad].

    A corner that is given in frame 0 alone does not move, or is NaN in later frames where corners are followed in
    photographs.

    Raises
    ------
    InputError
        Naming row and value.
    """
    frame, text, radius = table.integers("frame"), table.text("corner"), table.numbers("radius")
    names = tuple(dict.fromkeys(text))
    row = np.array([names.index(each) for each in text])
    check_unique(table, "corner", frame, row)
    for at in np.flatnonzero(radius <= 0.0).tolist():
        raise table.error(at, "radius", "is not positive")
    for at in np.flatnonzero((frame < 0) | (frame >= frame_count)).tolist():
        raise table.error(at, "frame", f"is not one of the {frame_count} frames, which count from 0")
    first = np.array([radius[row == corner][0] for corner in range(len(names))])
    for at in np.flatnonzero(radius != first[row]).tolist():
        raise table.error(at, "radius", f"differs from an earlier row: corner {names[row[at]]!r} is a rigid disc")
    given = np.full((frame_count, len(names), 3), np.nan)
    given[frame, row] = np.column_stack([table.numbers("x"), table.numbers("y"), table.optional_numbers("theta")])
    for corner, name in enumerate(names):
        if np.isfinite(given[0, corner, 0]) and np.isnan(given[1:, corner, 0]).all():
            if followed:
                continue
            given[:, corner] = given[0, corner]
        for k in np.flatnonzero(np.isnan(given[:, corner, 0])).tolist():
            raise InputError(
                table.file, f"frame {k}", f"has no row of corner {name!r}: give it in all frames, or in frame 0 alone"
            )
    return FrameCorners(names, given[..., :2], first, given[..., 2])


def bars_of_corners(file: Path, corners: FrameCorners) -> tuple[tuple[str, ...], Array]:
    """Return bars through the centres of neighbouring corners, with the packing to their left.

    Parameters
    ----------
    file
        Named in messages.
    corners
        At least three; they are joined counter-clockwise around their centroid in the first frame.

    Returns
    -------
    names : (w,)
        bottom, right, top and left between four corners, if each is on a side of its own; otherwise A-B between
        corners A and B.
    endpoints : (f, w, 2, 2)
        Centres of the two corners [m].
    """
    if len(corners.name) < FEWEST:
        raise InputError(
            file, "corner", f"has {len(corners.name)} corners: {FEWEST} or more enclose a packing; give the bars "
            "by walls.file"
        )  # fmt: skip
    offset = corners.centre[0] - corners.centre[0].mean(axis=0)
    order = np.argsort(np.arctan2(offset[:, 1], offset[:, 0]))
    following = np.roll(order, -1)
    endpoints = np.stack([corners.centre[:, order], corners.centre[:, following]], axis=2)
    along = endpoints[0, :, 1] - endpoints[0, :, 0]
    side = np.argmax(along @ np.array([[1.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, -1.0]]), axis=1)  # outward: (dy, −dx)
    if len(order) == len(SIDES) and len(set(side.tolist())) == len(SIDES):
        return tuple(SIDES[each] for each in side.tolist()), endpoints
    pairs = zip(order.tolist(), following.tolist(), strict=True)
    return tuple(f"{corners.name[a]}-{corners.name[b]}" for a, b in pairs), endpoints


def bar_of_each_corner(corners: FrameCorners, bars: Array, loaded: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return the bar (c,) that each disc is fixed to; −1: no bar ends there.

    A disc belongs to a bar under load that ends there; else to the first bar that joins it to another disc without a
    bar; else to the first bar that ends there.

    Parameters
    ----------
    bars : (f, w, 2, 2)
        Ends of the bars [m].
    loaded : (w,)
        Which bars are plates under load.
    """
    away = np.linalg.norm(bars[0, :, :, None] - corners.centre[0], axis=-1)  # (w, 2, c)
    meets = (away <= AT_CORNER * corners.radius).any(axis=1)
    found = np.full(len(corners.name), -1, np.intp)
    for bar in np.flatnonzero(loaded).tolist():
        found[meets[bar] & (found < 0)] = bar
    for least in (2, 1):
        for bar in range(len(meets)):
            free = meets[bar] & (found < 0)
            if free.sum() >= least:
                found[free] = bar
    return found
