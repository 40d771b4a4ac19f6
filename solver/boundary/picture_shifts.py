"""Coarse shifts of whole pictures against the walls, photograph by photograph, from the outermost rods.

A camera that is displaced for many photographs, or drifts, leaves no photograph to compare the others with. But the
rods next to two walls that are not parallel bear on them in every photograph, and their gaps give the shift of each
alone, roughly: errors of radii and of walls enter.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from ..bodies.grains import Array
from ..calibration.gaps import GapGeometry, GapRows

OUTERMOST = 5  # rods, whose median gap is that of a wall
FEWEST = 3  # of them
LEAST = 0.05  # of a mean radius: smaller shifts are left to the comparison of photographs
MOST = 1.0  # … and larger ones are no shifts: rods that are farther from a wall are not next to it
CONSISTENT = 0.25  # of a shift: walls that disagree by more are misplaced, or bear no rod
KNOWN = 0.9  # of the photographs whose shift must be known
STABLE = 1e-3  # least singular value of the walls' normals: parallel walls show one direction only


def find_picture_shifts(rows: GapRows, geometry: GapGeometry, seen: NDArray[np.bool_], radius: float) -> Array:
    """Find the shift of every picture against the walls.

    Parameters
    ----------
    rows : GapRows
        Gaps (m) to walls.
    geometry : GapGeometry
        Of these rows.
    seen : array (f,)
        Photographs that show rods.
    radius : float
        Mean radius [m].

    Returns
    -------
    array (f, 2)
        Shifts [m]; all zero where the walls do not agree on them, or where none is larger than LEAST radii.

    Notes
    -----
    The least squares of n_w·t = −g_w over the walls w of a photograph, n_w their mean outward normal and g_w the median
    of the OUTERMOST smallest gaps. It counts up to MOST R where no wall is off by more than CONSISTENT |t| + LEAST R.
    Photographs without one have that of the nearest photograph.
    """
    shifts = np.full((len(seen), 2), np.nan)
    normal, gap, frame = _gaps_of_walls(rows, geometry)
    for k in np.flatnonzero(seen).tolist():
        here = frame == k
        shift = _shift_of(normal[here], gap[here], radius)
        if shift is not None:
            shifts[k] = shift
    known = np.isfinite(shifts[:, 0])
    if not known.any() or known[seen].mean() < KNOWN:
        return np.zeros_like(shifts)
    at = np.flatnonzero(known)
    shifts = shifts[at[np.argmin(np.abs(np.arange(len(seen))[:, None] - at), axis=1)]]
    return shifts if np.linalg.norm(shifts, axis=1).max() > LEAST * radius else np.zeros_like(shifts)


def _gaps_of_walls(rows: GapRows, geometry: GapGeometry) -> tuple[Float[Array, "q 2"], Array, NDArray[np.intp]]:
    """Mean normal, gap [m] and frame of every wall in every frame with FEWEST rods or more (q)."""
    order = np.lexsort((geometry.gap, rows.j, rows.frame))
    starts = np.flatnonzero(np.diff(rows.frame[order], prepend=-1) | np.diff(rows.j[order], prepend=-1))
    ends = np.append(starts[1:], len(order))[: len(starts)]  # none where no rod is beside a wall
    outermost = [order[a : min(b, a + OUTERMOST)] for a, b in zip(starts, ends, strict=True) if b - a >= FEWEST]
    normal = np.array([geometry.normal[each].mean(axis=0) for each in outermost]).reshape(-1, 2)
    gap = np.array([np.median(geometry.gap[each]) for each in outermost])
    return normal, gap, np.array([rows.frame[each[0]] for each in outermost], np.intp)


def _shift_of(normal: Array, gap: Array, radius: float) -> Array | None:
    """Shift (2,) [m] that moves the rods against walls of these normals (w, 2) and gaps (w,); None: not known."""
    if len(gap) < 2 or np.linalg.svd(normal, compute_uv=False)[-1] < STABLE:
        return None
    shift: Array = np.linalg.lstsq(normal, -gap, rcond=None)[0].astype(np.float64)
    size, left = float(np.linalg.norm(shift)), float(np.abs(normal @ shift + gap).max())
    return shift if size <= MOST * radius and left <= CONSISTENT * size + LEAST * radius else None
