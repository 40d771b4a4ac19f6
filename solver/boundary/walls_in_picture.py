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
    apart, seen = (
        usual_wall_gaps(position, ends[:, ~circular], radius) for ends in (endpoints, moved)
    )  # fmt: skip
    both = np.isfinite(apart) & np.isfinite(seen)
    given_fits = np.linalg.norm(apart[both]) < np.linalg.norm(seen[both])
    return endpoints if given_fits else moved


def usual_wall_gaps(position: Array, endpoints: Array, radius: Array) -> Array:
    """Find the gap of the grains that touch every straight wall.

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
        (w,) [m]; NaN where too few grains are near.
    """
    diameter = 2.0 * float(radius.mean())
    normal = outward_normals(endpoints)
    usual = np.full(endpoints.shape[1], np.nan)
    for w in range(len(usual)):
        first, along = endpoints[:, w, 0], endpoints[:, w, 1] - endpoints[:, w, 0]
        arm = position - first[:, None]
        gap = -np.einsum("fnk,fk->fn", arm, normal[:, w]) - radius
        place = np.einsum("fnk,fk->fn", arm, along) / np.sum(along**2, axis=-1)[:, None]
        near = gap[(np.abs(gap) < NEAR * diameter) & (place > 0.0) & (place < 1.0)]
        if len(near) >= FEWEST_GAPS:
            column = np.full((len(near), 1), -1.0)
            usual[w] = fit_touching_pairs(near, column, np.array([True]), diameter, len(position)).value[0]
    return usual
