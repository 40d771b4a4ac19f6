"""From photographs to tracks in the world: one photograph after the other, grains and walls."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array

from ..errors import InputError
from ..experiment.photographs import Photographs
from ..experiment.units import Scale
from ..progress import Progress, silent
from ..results.checkpoint import Checkpoint
from ..tracks import Tracks, WallTracks
from .correlation.correlator import Rows
from .detection.detect import Detection
from .registration.manual_poses import ManualPoses
from .registration.poses import FramePoses
from .settings import TrackingSettings
from .tracker import Tracker
from .walls.wall_tracker import WallPoses, WallTracker

HISTORY = 8  # frames that the tracker looks back upon

# What is assumed of the centre of a grain whose outline could not be seen [px].
UNSEEN_SIGMA = 1.0


@dataclass(frozen=True, slots=True)
class Series:
    """The photographs of one test."""

    photographs: Photographs
    time: Array  # (f,) [s] of those that are followed, the first ones
    scale: Scale


@dataclass(frozen=True, slots=True)
class ReferenceGrains:
    """The grains of the first photograph."""

    id: NDArray[np.int64]  # (n,)
    detection: Detection
    radius: Array  # (n,) [m]


@dataclass(frozen=True, slots=True)
class Execution:
    """How the work is done: by how many threads, where finished frames are kept, who hears of it."""

    workers: int
    checkpoint: Checkpoint
    progress: Progress = silent


@dataclass(frozen=True, slots=True)
class FollowedWalls:
    """The walls of f frames and how well they are known."""

    walls: WallTracks
    sigma: Array  # (f, w, 2) [m] of each endpoint along the normal, against frame 0; NaN where it was measured
    zncc: Array  # (f, w) NaN where it was measured
    patches: NDArray[np.int64]  # (f, w) how many agree


def follow_photographs(
    series: Series,
    grains: ReferenceGrains,
    execution: Execution,
    settings: TrackingSettings | None = None,
    told: Mapping[int, ManualPoses] | None = None,
) -> Tracks:
    """Follow the detected grains through all photographs; finished ones are taken from the checkpoint.

    told: poses given by hand, by frame.
    """
    told = told if told is not None else {}
    photographs, scale, detection = series.photographs, series.scale, grains.detection
    checkpoint, progress = execution.checkpoint, execution.progress
    tracker = Tracker(photographs[0], detection, settings, workers=execution.workers)
    frame_count = len(series.time)
    poses: list[FramePoses] = [
        checkpoint.load(k, FramePoses)[0] for k in range(min(checkpoint.finished(), frame_count))
    ]
    for k in range(1, len(poses)):
        _renew(tracker, photographs, poses[:k], np.flatnonzero(poses[k].reference != poses[k - 1].reference))
    for k in range(len(poses), frame_count):
        progress("tracking", k, frame_count)
        if k == 0:
            pose = tracker.first()
        else:
            recent = poses[-HISTORY:]
            _renew(tracker, photographs, poses, tracker.find_damaged(recent, k - len(recent), photographs.__getitem__))
            pose = tracker.follow(photographs[k], recent, told.get(k))
        checkpoint.save(k, pose)
        poses.append(pose)
    progress("tracking", frame_count, frame_count)
    pixels = np.stack([np.stack([p.x, p.y], axis=1) for p in poses])
    centre = np.stack([detection.x, detection.y], axis=1)
    return Tracks(
        id=grains.id,
        radius=grains.radius,
        time=series.time,
        position=scale.to_world(pixels),
        rotation=scale.angle_to_world(np.stack([p.rotation for p in poses])),
        sigma=np.stack([p.sigma for p in poses]) * scale.size_at(pixels),
        zncc=np.stack([p.zncc for p in poses]),
        status=np.stack([p.status for p in poses]),
        second_zncc=np.stack([p.second_zncc for p in poses]),
        reference_frame=np.stack([p.reference for p in poses]),
        centre_sigma=np.where(np.isfinite(detection.sigma), detection.sigma, UNSEEN_SIGMA) * scale.size_at(centre),
    )


def _renew(tracker: Tracker, photographs: Photographs, poses: list[FramePoses], rows: Rows) -> None:
    """Take the references of `rows` (m,) anew from the last frame of poses."""
    if len(rows):
        tracker.renew(rows, len(poses) - 1, photographs[len(poses) - 1], poses[-1])


def follow_walls(series: Series, walls: WallTracks, depth: Array, execution: Execution, source: Path) -> FollowedWalls:
    """Follow the walls where their endpoints are NaN; depth (w,) [m]: how much of each bar is seen.

    source: the walls' table. Raises InputError for a wall without texture and for one that is not found.
    """
    photographs, checkpoint, progress = series.photographs, execution.checkpoint, execution.progress
    frame_count = len(walls.endpoints)
    tracker = WallTracker(photographs[0], walls.endpoints[0], series.scale, depth, workers=execution.workers)
    asked = np.asarray(np.isnan(walls.endpoints).any(axis=(2, 3)), dtype=np.bool_)
    for w in np.flatnonzero(asked.any(axis=0) & (tracker.patch_count < tracker.settings.least_patches)):
        raise InputError(
            source,
            f"frame 0, wall {walls.name[w]!r}",
            f"shows {tracker.patch_count[w]} patches of texture within {depth[w] * 1e3:.3g} mm on the right of 1 → 2: "
            "too few to be followed; give its position in every frame",
        )
    poses: list[WallPoses] = [checkpoint.load(k, WallPoses)[0] for k in range(min(checkpoint.finished(), frame_count))]
    for k in range(len(poses), frame_count):
        progress("walls", k, frame_count)
        pose = tracker.first() if k == 0 else tracker.follow(photographs[k], poses[-HISTORY:])
        pose = _measured_where_told(pose, walls.endpoints[k], ~asked[k])
        missing = np.asarray(np.isnan(pose.endpoints).any(axis=(1, 2)), dtype=np.bool_)
        for w in np.flatnonzero(missing):
            raise InputError(
                source,
                f"frame {k}, wall {walls.name[w]!r}",
                f"is not found again in {photographs.files[k].name}: give its position in that frame",
            )
        checkpoint.save(k, pose)
        poses.append(pose)
    progress("walls", frame_count, frame_count)
    return FollowedWalls(
        replace(walls, endpoints=np.stack([p.endpoints for p in poses])),
        np.stack([p.sigma for p in poses]),
        np.stack([p.zncc for p in poses]),
        np.stack([p.patches for p in poses]),
    )


def _measured_where_told(pose: WallPoses, endpoints: Array, told: NDArray[np.bool_]) -> WallPoses:
    return WallPoses(
        np.where(told[:, None, None], endpoints, pose.endpoints),
        np.where(told[:, None], np.nan, pose.sigma),
        np.where(told, np.nan, pose.zncc),
        np.where(told, 0, pose.patches),
    )
