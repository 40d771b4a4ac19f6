"""A mended rod through the photographs that follow, until its track holds by itself again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array

from .mender import Mended, Mender

NEIGHBOURS = 8  # whose motion leads a rod from one photograph to the next
AGREE = 0.5  # [px] of the rim, within which a track has the pose that is found


@dataclass(frozen=True, slots=True)
class Tracked:
    """The poses of n rods in f photographs, as they were tracked."""

    id: NDArray[np.int64]  # (n,)
    pose: Array  # (f, n, 3) x, y [px], angle [rad] of the picture; NaN: lost


@dataclass(frozen=True, slots=True)
class Followed:
    """What became of a rod in the photographs after the one in which it was mended."""

    poses: dict[int, Mended]  # by photograph: those that the tracks do not have
    ended: str  # why it was followed no farther


def follow_on(
    mender: Mender, tracked: Tracked, name: int, since: tuple[int, Mended], by_hand: Callable[[int], bool],
    first: int = 0,
) -> Followed:  # fmt: skip
    """Correlate a rod in photograph after photograph from where its neighbours lead it.

    since: the photograph in which it was mended, and how. by_hand: whether a photograph has a correction of it already.
    first: the photograph of the tracks' frame 0.
    Ends where the track has the pose that is found, where nothing is found, and where a hand has been before.
    """
    frame, last = since
    row = int(np.flatnonzero(tracked.id == name)[0])
    poses: dict[int, Mended] = {}
    for k in range(frame + 1, len(tracked.pose)):
        if by_hand(k):
            return Followed(poses, f"photograph {first + k} has a correction of it already")
        step = _led(tracked, row, k, last)
        found = mender.correlate(k, name, (last.x + step[0], last.y + step[1], last.angle))
        if not found.found:
            return Followed(poses, f"it is not found in photograph {first + k}: drag it there, too")
        if _off(tracked.pose[k, row], found, mender.circle(name)[2]) < AGREE:
            return Followed(poses, f"from photograph {first + k} on its track is right by itself")
        poses[k] = last = found
    return Followed(poses, "to the last photograph")


def _led(tracked: Tracked, row: int, frame: int, last: Mended) -> Array:
    """How far [px] (2,) the nearest rods go from the photograph before to this one; 0 where none are seen."""
    before, here = tracked.pose[frame - 1, :, :2], tracked.pose[frame, :, :2]
    away = np.hypot(before[:, 0] - last.x, before[:, 1] - last.y)
    away[row] = np.nan
    seen = np.flatnonzero(np.isfinite(away + here[:, 0]))
    nearest = seen[np.argsort(away[seen])[:NEIGHBOURS]]
    return np.median(here[nearest] - before[nearest], axis=0) if len(nearest) else np.zeros(2)


def _off(pose: Array, found: Mended, radius: float) -> float:
    """How far [px] a pose and a found one are apart at the rim; infinite where there is none."""
    if not np.isfinite(pose[0]):
        return float("inf")
    turned = (found.angle - pose[2] + np.pi) % (2.0 * np.pi) - np.pi
    return float(np.hypot(pose[0] - found.x, pose[1] - found.y) + radius * abs(np.nan_to_num(turned)))
