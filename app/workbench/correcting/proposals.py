"""A rod's pose proposed from its last good photograph, and warnings about a pose before it is kept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...experiment.units import Scale
from ...solver.bodies.grains import Array
from ...tracking.registration.neighbours import local_motion
from ...tracks import Tracks, TrackStatus
from .pose_editor import PoseFit

Pose = tuple[float, float, float]
OVERLAP = 0.2  # [smaller radii] of two rods that tilt and errors of the radii can explain
JUMP = 0.5  # [radii] by which a rod moves against its neighbours between two photographs at most, as a rule
FAR_BELOW = 0.15  # by which a correlation is far below the median of the others, and at least
SPREADS = 5.0  # of their median deviations
WEAK = 0.75  # correlation below which a rod is listed as uncertain
UNCERTAIN = (TrackStatus.SUSPECT, TrackStatus.ROBUST)
GOOD = (TrackStatus.OK, TrackStatus.RESCUED, TrackStatus.ROBUST)


@dataclass(frozen=True, slots=True)
class TrackedPoses:
    """The poses of n rods in f photographs, with all corrections."""

    id: NDArray[np.int64]  # (n,)
    pose: Array  # (f, n, 3) x, y [px], angle [rad] in the picture; NaN: lost
    radius: Array  # (n,) [px]
    zncc: Array  # (f, n) correlation with the first photograph; NaN: none
    good: NDArray[np.bool_]  # (f, n) the pose needs no check by a person

    @classmethod
    def of(cls, tracks: Tracks, scale: Scale) -> TrackedPoses:
        """Return the poses of tracks without corrections."""
        pose = np.dstack([scale.to_pixels(tracks.position), -tracks.rotation])
        good = np.isin(tracks.status, GOOD) & ~(tracks.zncc < WEAK) & tracks.present
        return cls(tracks.id, pose, tracks.radius / scale.mean_size, tracks.zncc, good)

    def row(self, name: int) -> int:
        """Return the row of a rod; raise KeyError for no such rod."""
        rows = np.flatnonzero(self.id == name)
        if len(rows) != 1:
            raise KeyError(name)
        return int(rows[0])

    def others(self, frame: int, row: int) -> Array:
        """Return the circles (m, 3) x, y, radius [px] of the other rods whose place in a photograph is known."""
        known = self.good[frame].copy()
        known[row] = False
        return np.column_stack([self.pose[frame, known, :2], self.radius[known]])


def uncertain_poses(tracks: Tracks) -> NDArray[np.bool_]:
    """Return which poses (f, n) a person should check."""
    return np.isin(tracks.status, UNCERTAIN) | (tracks.zncc < WEAK)


@dataclass(frozen=True, slots=True)
class Prediction:
    """The pose of a rod by the motion of its neighbours since its last good photograph."""

    pose: Pose
    since: int  # that photograph


def predict_pose(tracked: TrackedPoses, row: int, frame: int) -> Prediction | None:
    """Predict a rod's pose from its last good photograph and the motion of its neighbours since; None: it has none."""
    before = np.flatnonzero(tracked.good[:frame, row])
    if not len(before):
        return None
    since = int(before[-1])
    known = tracked.good[since] & tracked.good[frame]
    known[row] = False
    start, moved = tracked.pose[since, known, :2], tracked.pose[frame, known, :2] - tracked.pose[since, known, :2]
    last = tracked.pose[since, row]
    step, _ = local_motion(start, moved, last[None, :2], exclude_self=False)
    x, y = last[:2] + np.nan_to_num(step[0])
    return Prediction((float(x), float(y), float(np.nan_to_num(last[2]))), since)


def overlap(circle: tuple[float, float, float], others: Array) -> tuple[int, float]:
    """Return the other circle (m, 3) that a circle overlaps most, and by how much [smaller radii]; −1: there is none.

    Notes
    -----
    (r + r' − d) / min(r, r'), d: the distance of the centres.
    """
    if not len(others):
        return -1, 0.0
    x, y, radius = circle
    depth = radius + others[:, 2] - np.hypot(others[:, 0] - x, others[:, 1] - y)
    fraction = depth / np.minimum(radius, others[:, 2])
    most = int(fraction.argmax())
    return most, float(fraction[most])


def warnings_of(tracked: TrackedPoses, row: int, frame: int, found: PoseFit, first: int = 0) -> list[str]:
    """State what makes a pose improbable: an overlap, a low correlation, a jump against the neighbours.

    Parameters
    ----------
    tracked : TrackedPoses
        All rods, with the corrections.
    row, frame : int
        The rod and the photograph.
    found : PoseFit
        The pose.
    first : int
        The photograph of the tracks' frame 0, for the sentences.
    """
    stated: list[str] = []
    if not found.found:
        stated.append("Nothing correlates there: the pose is kept as it is, ± 1 px, and costs this rod here at most.")
    known = tracked.good[frame].copy()
    known[row] = False
    names = tracked.id[known]
    other, fraction = overlap((found.x, found.y, float(tracked.radius[row])), tracked.others(frame, row))
    if fraction > OVERLAP:
        percent = min(round(50.0 * fraction), 100)
        stated.append(f"It lies on rod {names[other]}: they overlap by {percent} % of the smaller one's diameter.")
    values = tracked.zncc[frame, known]
    values = values[np.isfinite(values)]
    if found.found and len(values):
        middle = float(np.median(values))
        least = middle - max(FAR_BELOW, SPREADS * float(np.median(np.abs(values - middle))))
        if found.zncc < least:
            stated.append(f"It correlates by {found.zncc:.2f}, the other rods here by {middle:.2f}.")
    predicted = predict_pose(tracked, row, frame)
    if predicted is not None:
        jump = float(np.hypot(found.x - predicted.pose[0], found.y - predicted.pose[1]))
        if jump > JUMP * tracked.radius[row]:
            stated.append(
                f"Against its neighbours it has moved by {jump:.0f} px since photograph {first + predicted.since}, "
                "where it was seen last."
            )
    return stated


def with_corrections(
    tracked: TrackedPoses, corrections: Sequence[tuple[int, int, tuple[float, float, float | None] | None]]
) -> TrackedPoses:
    """Return the poses with those given by hand: (frame, id, pose in the picture or None: not visible)."""
    pose, good = tracked.pose.copy(), tracked.good.copy()
    row_of = {int(name): k for k, name in enumerate(tracked.id)}
    for frame, name, given in corrections:
        row = row_of.get(name)
        if row is None or not 0 <= frame < len(pose):
            continue
        if given is None:
            pose[frame, row], good[frame, row] = np.nan, False
            continue
        x, y, angle = given
        pose[frame, row] = x, y, pose[frame, row, 2] if angle is None else angle
        good[frame, row] = True
    return TrackedPoses(tracked.id, pose, tracked.radius, tracked.zncc, good)
