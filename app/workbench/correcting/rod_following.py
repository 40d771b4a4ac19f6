"""A corrected rod in the photographs that follow, until its track agrees again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...solver.bodies.grains import Array
from .pose_editor import PoseEditor, PoseFit
from .proposals import OVERLAP, TrackedPoses, overlap, predict_pose

AGREE = 0.5  # [px] at the rim, largest difference of a track from the fitted pose with which it agrees


@dataclass(frozen=True, slots=True)
class FollowedRod:
    """The fits of a rod in the photographs after the one in which it was corrected."""

    poses: dict[int, PoseFit]  # by frame, where the tracks differ
    ended: str  # the reason why it ended


def follow_rod(
    editor: PoseEditor, tracked: TrackedPoses, name: int, since: tuple[int, PoseFit], by_hand: Callable[[int], bool],
    first: int = 0,
) -> FollowedRod:  # fmt: skip
    """Correlate a rod in one photograph after the other, each time from the pose that its neighbours' motion predicts.

    It ends where the track agrees with the fitted pose, where the fit fails, and where a correction exists already.

    Parameters
    ----------
    editor : PoseEditor
        Correlates the rod.
    tracked : TrackedPoses
        The poses as they were tracked; changed.
    name : int
        Id of the rod.
    since : tuple of int and PoseFit
        The frame in which the rod was corrected, and the fit there.
    by_hand : callable
        Returns whether a frame has a correction of the rod already.
    first : int
        The photograph of the tracks' frame 0.
    """
    frame, last = since
    row = tracked.row(name)
    tracked.pose[frame, row], tracked.good[frame, row] = (last.x, last.y, last.angle), True
    as_tracked = tracked.pose[:, row].copy()
    poses: dict[int, PoseFit] = {}
    for k in range(frame + 1, len(as_tracked)):
        if by_hand(k):
            return FollowedRod(poses, f"photograph {first + k} has a correction of it already")
        others = tracked.others(k, row)

        def taken(x: float, y: float, radius: float, others: Array = others) -> bool:
            return overlap((x, y, radius), others)[1] > OVERLAP

        tracked.good[k, row] = False  # as tracked it is in question
        predicted = predict_pose(tracked, row, k)
        assert predicted is not None
        found = editor.correlate(k, name, predicted.pose, taken)
        if not found.found:
            return FollowedRod(poses, f"it is not found in photograph {first + k}: drag it there as well")
        if _distance(as_tracked[k], found, editor.circle(name)[2]) < AGREE:
            return FollowedRod(poses, f"from photograph {first + k} on its track agrees")
        poses[k] = found
        tracked.pose[k, row], tracked.good[k, row] = (found.x, found.y, found.angle), True
    return FollowedRod(poses, "to the last photograph")


def _distance(pose: Array, found: PoseFit, radius: float) -> float:
    """Distance [px] of two poses at the rim; infinite where the first is lost."""
    if not np.isfinite(pose[0]):
        return float("inf")
    rotation = (found.angle - pose[2] + np.pi) % (2.0 * np.pi) - np.pi
    return float(np.hypot(pose[0] - found.x, pose[1] - found.y) + radius * abs(np.nan_to_num(rotation)))
