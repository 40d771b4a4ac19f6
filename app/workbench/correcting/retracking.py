"""One photograph tracked again with the corrections, as the next run will do it: nothing is written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...experiment.pictures.image import Image
from ...experiment.units import Scale
from ...solver.bodies.grains import Array
from ...tracking.registration.manual_poses import ManualPoses
from ...tracking.registration.poses import FramePoses
from ...tracking.tracker import Tracker
from ...tracks import Tracks, TrackStatus

HISTORY = 8  # earlier photographs that are handed to the tracker, as in a run
AROUND = 3.0  # [radii] within which rods are neighbours of a corrected one


@dataclass(frozen=True, slots=True)
class Change:
    """One rod before and after a photograph was tracked again."""

    id: int
    status: tuple[TrackStatus, TrackStatus]
    zncc: tuple[float, float]
    moved: float  # [px]; NaN: it has no pose before or after


def track_again(
    circles: Array, tracks: Tracks, places: Array, frame: int, given: ManualPoses, photograph: Callable[[int], Image]
) -> FramePoses:
    """Track one photograph from the stored poses of those before it.

    Parameters
    ----------
    circles : (n, 3) array
        Centre and radius [px] of the rods on photograph 0.
    tracks : Tracks
        The stored tracks.
    places : (f, n, 3) array
        Their poses in pixels, angles [rad] in the picture.
    frame : int
        The photograph, 1 …
    given : ManualPoses
        The corrections of this photograph.
    photograph : callable
        Returns the photograph of a number.
    """
    x, y, radius = circles.T
    tracker = Tracker(photograph(0), (x, y, radius), workers=2)
    history = [_stored(tracks, places, k, tracker.first()) for k in range(max(frame - HISTORY, 0), frame)]
    references = tracks.reference_frame
    if references is not None:  # references that the run has renewed
        for k in np.unique(references[frame - 1][references[frame - 1] > 0]).tolist():
            rows = np.flatnonzero(references[frame - 1] == k)
            tracker.renew(rows, k, photograph(k), _stored(tracks, places, k, tracker.first()))
    return tracker.follow(photograph(frame), history, given)


def changes(tracks: Tracks, places: Array, frame: int, again: FramePoses, circles: Array, around: int) -> list[Change]:
    """List a rod (row `around`) and its neighbours before and after, and every other rod whose status has changed."""
    radius = circles[:, 2]
    here = np.where(again.has_pose[:, None], again.pose, places[frame])[:, :2]
    away = np.linalg.norm(here - here[around], axis=1)
    near = away < radius[around] + radius + (AROUND - 2.0) * radius[around]
    rows = np.flatnonzero(near | (again.status != tracks.status[frame]))
    nearest = rows[np.argsort(np.nan_to_num(away[rows], nan=np.inf))]
    order = [around, *(row for row in nearest.tolist() if row != around)]
    return [
        Change(
            int(tracks.id[row]), (TrackStatus(tracks.status[frame, row]), TrackStatus(again.status[row])),
            (float(tracks.zncc[frame, row]), float(again.zncc[row])),
            float(np.hypot(places[frame, row, 0] - again.x[row], places[frame, row, 1] - again.y[row])),
        )
        for row in order
    ]  # fmt: skip


def _stored(tracks: Tracks, places: Array, k: int, first: FramePoses) -> FramePoses:
    """The poses of a stored photograph, as the tracker returned them."""
    if k == 0:
        return first
    unknown = np.full(len(tracks.id), np.nan)
    reference = np.zeros(len(tracks.id), np.int32) if tracks.reference_frame is None else tracks.reference_frame[k]
    x, y, rotation = places[k].T
    return FramePoses(x, y, rotation, unknown, tracks.zncc[k], unknown, tracks.status[k], reference)


def with_frame(tracks: Tracks, frame: int, again: FramePoses, scale: Scale) -> Tracks:
    """Return the tracks with one frame as it was tracked again."""
    position, rotation, status, zncc = (
        each.copy() for each in (tracks.position, tracks.rotation, tracks.status, tracks.zncc)
    )
    position[frame] = scale.to_world(again.pose[:, :2])
    rotation[frame], status[frame], zncc[frame] = scale.angle_to_world(again.rotation), again.status, again.zncc
    return replace(tracks, position=position, rotation=rotation, status=status, zncc=zncc)
