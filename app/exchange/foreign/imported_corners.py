"""Corners of the frame that other programs track, as discs of the experiment's [walls] corners."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ...process.errors import InputError
from ...solver.bodies.grains import Array
from ...tracks import Tracks
from .observations import Convention, ImportedTracks

FEWEST = 3  # corners that enclose a packing
NAMES = ("bottom_left", "bottom_right", "top_right", "top_left")  # of four corners, counter-clockwise


@dataclass(frozen=True, slots=True)
class ImportedCorners:
    """Corners in the unit and axes of the other program."""

    x: Float[Array, "f c"]
    y: Float[Array, "f c"]
    angle: Float[Array, "f c"]  # [rad] in its axes; NaN: unknown


@dataclass(frozen=True, slots=True)
class CornerDiscs:
    """Corner discs of an experiment."""

    name: tuple[str, ...]  # (c,)
    centre: Float[Array, "f c 2"]  # [m]
    angle: Float[Array, "f c"]  # [rad]; NaN: turns with its bar
    radius: float  # [m]
    remark: str


def make_corners(
    corners: ImportedCorners, imported: ImportedTracks, convention: Convention, radius: float | None
) -> CornerDiscs:
    """Convert corners to discs in metres, y up.

    Parameters
    ----------
    corners
        At least three.
    imported
        Tracks of the same photographs.
    convention
        Units and axes of the other program.
    radius
        Of the discs, in its unit; None: the largest that overlaps no rod in any photograph.

    Raises
    ------
    InputError
        There are fewer than three corners, or no disc fits between the rods.
    """
    count = corners.x.shape[1]
    if count < FEWEST:
        raise InputError("corners", str(count), f"are too few: {FEWEST} or more corners of radius 1 enclose a packing")
    y, angle = corners.y, corners.angle
    if convention.y_down:
        y, angle = imported.floor - y, -angle
    centre = convention.unit * np.stack([corners.x, y], axis=-1)
    if not np.any(np.abs(angle) > 0.0):  # this program does not measure rotations
        angle = np.full_like(angle, np.nan)
    names = _names(centre[0])
    if radius is not None:
        return CornerDiscs(names, centre, angle, convention.unit * radius, "Their radius is given by --corner-radius.")
    found = _free_radius(centre, imported.tracks)
    if not found > 0.0:
        raise InputError("corners", "", "lie within rods: their rows of radius 1 are no corners of the frame")
    remark = (
        f"THEIR RADIUS IS PROPOSED, NOT MEASURED: {found / convention.unit:.4g} in the files' unit is the largest that "
        "overlaps no rod; give --corner-radius if it is known."
    )
    return CornerDiscs(names, centre, angle, found, remark)


def _names(centre: Array) -> tuple[str, ...]:
    """Name corners (c, 2) by their place around the centroid, if there are four, one in each quarter."""
    right, top = (centre > centre.mean(axis=0)).T
    quarter = np.where(top, np.where(right, 2, 3), np.where(right, 1, 0))
    if len(centre) == len(NAMES) and len(set(quarter.tolist())) == len(NAMES):
        return tuple(NAMES[each] for each in quarter.tolist())
    return tuple(f"corner_{k + 1}" for k in range(len(centre)))


def _free_radius(centre: Array, tracks: Tracks) -> float:
    """Return the largest radius [m] of discs at centres (f, c, 2) [m] that overlap no rod.

    Notes
    -----
    min over photographs, corners and rods of |x_rod − x_corner| − R_rod.
    """
    apart = np.linalg.norm(tracks.position[:, None] - centre[:, :, None], axis=-1) - tracks.radius
    return float(np.nanmin(apart))
