"""From photographs to tracks in the world: one photograph after the other, grains and walls.

A photograph that shows nothing of the packing, or that a tracker cannot get through, fails alone: nothing is tracked in
it, why is kept with the tracks, and the next one is compared with the last that showed something.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.sequence.failure import describe_error

from ..errors import InputError
from ..experiment.photographs import Image, Photographs, ReadAhead
from ..experiment.units import Scale
from ..progress import Observer, Progress, silent, unheard
from ..results.checkpoint import Checkpoint
from ..tracks import Tracks, WallTracks
from .correlation.correlator import Rows
from .detection.detect import Detection
from .kept_pictures import KeepingPictures
from .outline.outline_tracker import OutlineTracker
from .registration.manual_poses import ManualPoses
from .registration.poses import FramePoses, no_poses
from .settings import TrackingSettings
from .tracker import Tracker
from .walls.wall_tracker import WallPoses, WallTracker

AnyTracker = Tracker | OutlineTracker

HISTORY = 8  # frames that the tracker looks back upon

# Share of the grains of the first photograph: one that shows fewer shows none, and those by accident.
FEWEST_FOUND = 0.1

# The least that a centre by its rim is off for good [px]: rims are not lit alike all around.
RIM_ERROR = 0.02

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
    observer: Observer = unheard  # hears what failed a photograph
    pictures: Checkpoint | None = None  # where photographs are kept as recordings show them


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
    kind = OutlineTracker if settings is not None and settings.follow == "outline" else Tracker
    tracker = kind(photographs[0], detection, settings, workers=execution.workers)
    frame_count = len(series.time)
    poses: list[FramePoses] = [
        checkpoint.load(k, FramePoses)[0] for k in range(min(checkpoint.finished(), frame_count))
    ]
    for k in range(1, len(poses)):
        _renew(tracker, photographs, poses[:k], np.flatnonzero(poses[k].reference != poses[k - 1].reference))
    seen = photographs if execution.pictures is None else KeepingPictures(photographs, execution.pictures)
    with ReadAhead(seen, frame_count) as coming:
        for k in range(len(poses), frame_count):
            progress("tracking", k, frame_count)
            image = coming[k]
            pose = tracker.first() if k == 0 else _follow(tracker, photographs, image, poses, told.get(k), execution)
            checkpoint.save(k, pose)
            poses.append(pose)
    progress("tracking", frame_count, frame_count)
    pixels = np.stack([np.stack([p.x, p.y], axis=1) for p in poses])
    centre = np.stack([detection.x, detection.y], axis=1)
    constant = np.where(np.isfinite(detection.sigma), detection.sigma, UNSEEN_SIGMA)
    if isinstance(tracker, OutlineTracker):  # every photograph is measured by itself: noise does not last
        noise = np.nan_to_num(poses[0].sigma)
        constant = np.sqrt(np.maximum(constant**2 - noise**2, RIM_ERROR**2))
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
        centre_sigma=constant * scale.size_at(centre),
        failed_reason=tuple(p.failed_reason for p in poses),
    )


def _follow(
    tracker: AnyTracker, photographs: Photographs, image: Image, poses: list[FramePoses], told: ManualPoses | None,
    execution: Execution,
) -> FramePoses:  # fmt: skip
    """The poses in the photograph after those that are given; what it cannot be followed for fails it alone."""
    k = len(poses)
    recent = poses[-HISTORY:]
    # Whether a reference is damaged is judged on photographs in a row.
    row = next((at for at in range(len(recent), 0, -1) if recent[at - 1].failed_reason), 0)
    try:
        if recent[row:]:
            damaged = tracker.find_damaged(recent[row:], k - len(recent[row:]), photographs.__getitem__)
            _renew(tracker, photographs, poses, damaged)
        pose = tracker.follow(image, recent, told)
    except (MemoryError, InputError, OSError):  # not the picture's fault
        raise
    except Exception as error:
        execution.observer("tracking", k, error)
        return no_poses(tracker.reference, f"{photographs.files[k].name} cannot be followed: {describe_error(error)}")
    found, expected = int(pose.has_pose.sum()), int(poses[0].has_pose.sum())
    if found < FEWEST_FOUND * expected:
        return no_poses(tracker.reference, f"{found} of {expected} grains are found in {photographs.files[k].name}")
    return pose


def _renew(tracker: AnyTracker, photographs: Photographs, poses: list[FramePoses], rows: Rows) -> None:
    """Take the references of `rows` (m,) anew from the last frame of poses."""
    if len(rows):
        tracker.renew(rows, len(poses) - 1, photographs[len(poses) - 1], poses[-1])


def follow_walls(series: Series, walls: WallTracks, depth: Array, execution: Execution, source: Path) -> FollowedWalls:
    """Follow the walls where their endpoints are NaN; depth (w,) [m]: how much of each bar is seen.

    source: the walls' table. A wall that is not found in a photograph has no ends there. Raises InputError for a wall
    without texture.
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
    with ReadAhead(photographs, frame_count) as coming:
        for k in range(len(poses), frame_count):
            progress("walls", k, frame_count)
            image = coming[k]
            pose = tracker.first() if k == 0 else _follow_bars(tracker, image, poses, execution)
            pose = _measured_where_told(pose, walls.endpoints[k], ~asked[k])
            checkpoint.save(k, pose)
            poses.append(pose)
    progress("walls", frame_count, frame_count)
    return FollowedWalls(
        replace(walls, endpoints=np.stack([p.endpoints for p in poses])),
        np.stack([p.sigma for p in poses]),
        np.stack([p.zncc for p in poses]),
        np.stack([p.patches for p in poses]),
    )


def _follow_bars(tracker: WallTracker, image: Image, poses: list[WallPoses], execution: Execution) -> WallPoses:
    """The walls in the photograph after those that are given; NaN where they are not found in it."""
    try:
        return tracker.follow(image, poses[-HISTORY:])
    except (MemoryError, InputError, OSError):  # not the picture's fault
        raise
    except Exception as error:
        execution.observer("walls", len(poses), error)
        w = tracker.wall_count
        return WallPoses(np.full((w, 2, 2), np.nan), np.full((w, 2), np.nan), np.full(w, np.nan), np.zeros(w, np.int64))


def _measured_where_told(pose: WallPoses, endpoints: Array, told: NDArray[np.bool_]) -> WallPoses:
    return WallPoses(
        np.where(told[:, None, None], endpoints, pose.endpoints),
        np.where(told[:, None], np.nan, pose.sigma),
        np.where(told, np.nan, pose.zncc),
        np.where(told, 0, pose.patches),
    )
