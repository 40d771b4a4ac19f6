"""Whether walls were measured in the distorted picture, or apart from it, by the gaps of the grains that touch them."""

from __future__ import annotations

import numpy as np

from ..bodies.grains import Array
from ..bodies.wall_shapes import STRAIGHT, Sides, all_sides, circle_ends, circle_parameters, outward_normals
from .camera_distortion import CameraDistortion
from .touching_pairs import fit_touching_pairs

NEAR = 0.15  # mean diameters from a wall within which a grain may touch it
FEWEST_GAPS = 20  # of a wall, in all frames


def correct_walls_in_picture(
    found: CameraDistortion, endpoints: Array, side: Sides, position: Array, radius: Array, *, scale: float
) -> Array:
    """Correct walls as the grains are, unless grains then touch them less well than the given ones.

    Parameters
    ----------
    found : CameraDistortion
    endpoints : (f, w, 2, 2)
        Given ends of the walls [m].
    side : int8 array (w,) or None
        Shapes of the walls.
    position : (f, n, 2)
        Corrected positions [m], NaN where a grain is missing.
    radius : (n,)
        Radii [m].
    scale : float
        Factor of all distances after the correction.

    Returns
    -------
    Array
        (f, w, 2, 2) corrected, or the given, ends [m].
    """
    moved = found.correct_scaled(endpoints, scale)
    circular = all_sides(side, endpoints.shape[1]) != STRAIGHT
    if circular.any():  # a circle keeps its shape
        centre, rim, angle = circle_parameters(endpoints[:, circular])
        moved[:, circular] = circle_ends(found.correct_scaled(centre, scale), scale * rim, angle)
    straight = ~circular
    apart, seen = (_wall_gaps(position, ends[:, straight], radius) for ends in (endpoints, moved))
    both = np.isfinite(apart[:, 0]) & np.isfinite(seen[:, 0])
    if np.linalg.norm(apart[both, 0]) < np.linalg.norm(seen[both, 0]):
        return endpoints
    moved[:, straight] = _touched(moved[:, straight], seen)
    return moved


def _touched(endpoints: Array, gap: Array) -> Array:
    """Move straight walls to the grains that touch them.

    A bar that is seen through a lens is no straight line: its ends, or a line through its middle, are off by the
    curvature, the same in all photographs.
    """
    shift = np.nan_to_num(np.stack([gap[:, 0] - 0.5 * gap[:, 1], gap[:, 0] + 0.5 * gap[:, 1]], axis=1))
    return endpoints - shift[None, :, :, None] * outward_normals(endpoints)[:, :, None]


def _wall_gaps(position: Array, endpoints: Array, radius: Array) -> Array:
    """Find the gap of the grains that touch every straight wall, and how it grows along the wall.

    Parameters
    ----------
    position : (f, n, 2)
        Positions [m], NaN where a grain is missing.
    endpoints : (f, w, 2, 2)
        Ends of straight walls [m].
    radius : (n,)
        Radii [m].

    Returns
    -------
    Array
        (w, 2) [m] in the middle, and its change from end 0 to end 1; NaN where too few grains are near.
    """
    diameter = 2.0 * float(radius.mean())
    normal = outward_normals(endpoints)
    usual = np.full((endpoints.shape[1], 2), np.nan)
    for w in range(len(usual)):
        first, along = endpoints[:, w, 0], endpoints[:, w, 1] - endpoints[:, w, 0]
        arm = position - first[:, None]
        gap = -np.einsum("fnk,fk->fn", arm, normal[:, w]) - radius
        place = np.einsum("fnk,fk->fn", arm, along) / np.sum(along**2, axis=-1)[:, None]
        near = (np.abs(gap) < NEAR * diameter) & (place > 0.0) & (place < 1.0)
        if near.sum() >= FEWEST_GAPS:
            design = np.column_stack([np.full(near.sum(), -1.0), 0.5 - place[near]])
            fit = fit_touching_pairs(gap[near], design, np.array([True, False]), diameter, len(position))
            usual[w] = fit.value
    return usual
