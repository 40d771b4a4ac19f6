"""Two ids on one rod: centres that coincide are refused, since two rods cannot be at one place."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ..process.errors import InputError
from ..solver.bodies.cell import Cell
from ..solver.bodies.grains import Array

NEAR = 0.1  # of the smaller radius: nearer centres are those of one rod; rods that touch are 2 of it apart
SAME = 1e-9  # of the smaller radius: the same centre, but for the rounding of shifts across a cell
# In fewer consecutive frames a rod jumped into another one, which is corrected as an outlier.
CONSECUTIVE = 3


def refuse_coincident_rods(
    file: Path | str, ids: NDArray[np.int64], radius: Array, position: Array, cell: Array | None = None
) -> None:
    """Raise InputError where two ids have the same centre in a frame, or follow one rod.

    Two ids follow one rod where their centres are nearer than a tenth of the smaller radius in three consecutive frames
    or in most of the frames that have both.

    Parameters
    ----------
    file
        Named by the error.
    ids
        Names of the rods (n,).
    radius
        Radii (n,), in the unit of the positions.
    position
        Centres (f, n, 2), NaN where a rod is lost.
    cell
        Vectors of the periodic cell (f, 2, 2), None without one.
    """
    near: dict[tuple[int, int], list[int]] = {}  # frames by pair
    apart: dict[tuple[int, int], float] = {}
    for k, place in enumerate(position):
        pairs, distance = _nearest_pairs(place, None if cell is None else Cell.at_rest(cell[k]))
        least = radius[pairs].min(axis=1)
        for a, b in pairs[distance <= SAME * least][:1].tolist():
            raise InputError(
                file, f"frame {k}", f"grains {ids[a]} and {ids[b]} have the same centre, ({place[a, 0]:.6g}, "
                f"{place[a, 1]:.6g}): two ids are on one rod there; leave one of them out",
            )  # fmt: skip
        close = distance < NEAR * least
        if close.sum() > 0.5 * len(close):  # radii in another unit than the positions, which is named elsewhere
            continue
        for (a, b), far in zip(pairs[close].tolist(), distance[close].tolist(), strict=True):
            near.setdefault((a, b), []).append(k)
            apart.setdefault((a, b), far / min(radius[a], radius[b]))
    for (a, b), frames in near.items():
        both = int(np.isfinite(position[:, [a, b], 0]).all(axis=1).sum())
        if len(frames) > 0.5 * both or _longest_run(frames) >= CONSECUTIVE:
            raise InputError(
                file, f"frame {frames[0]}", f"the centres of grains {ids[a]} and {ids[b]} are {apart[a, b]:.2g} of a "
                f"radius apart, and so in {len(frames)} of the {both} frames that have both: one rod has two ids; "
                "leave one of them out",
            )  # fmt: skip


def _nearest_pairs(place: Array, cell: Cell | None) -> tuple[NDArray[np.int64], Array]:
    """Return every rod of a frame with the one nearest to it (p, 2), each pair once, and their distances (p,)."""
    rows = np.flatnonzero(np.isfinite(place).all(axis=1))
    if len(rows) < 2:
        return np.empty((0, 2), np.int64), np.empty(0)
    point, owner = place[rows], np.arange(len(rows))
    if cell is not None:
        point, owner = cell.with_images(point, float(np.sqrt(cell.area / len(rows))))
    found = KDTree(point).query(point[: len(rows)], 2)
    distance, other = np.asarray(found[0], np.float64)[:, 1], np.asarray(found[1], np.int64)[:, 1]
    pairs = np.sort(np.column_stack([rows, rows[owner[np.minimum(other, len(owner) - 1)]]]), axis=1)
    # Of equal centres a query may give a point itself as the second: then another point has it as its nearest.
    known = np.isfinite(distance) & (pairs[:, 0] != pairs[:, 1])
    pairs, first = np.unique(pairs[known], axis=0, return_index=True)
    return pairs, distance[known][first]


def _longest_run(frames: list[int]) -> int:
    """Return the largest number of consecutive frames among ascending ones."""
    return max(Counter(k - at for at, k in enumerate(frames)).values())
