"""Tracking of grains and walls through a series of photographs, with results in world coordinates.

A photograph that shows nothing of the packing fails alone: it has no poses, the reason is stored with the tracks, and
the next photograph is compared with the last one that has poses. A grain whose fit has no support is lost alone. An
error of the program is no failure of a photograph: it is raised.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..experiment.photographs import Photographs, PrefetchedPhotographs
from ..experiment.pictures.image import Image
from ..experiment.units import Scale
from ..process.errors import InputError
from ..process.progress import Progress, no_progress
from ..results.checkpoint import Checkpoint
from ..solver.bodies.grains import Array
from ..tracks import Tracks, WallTracks
from .correlation.correlator import Rows
from .detection.detect import Detection
from .outline.outline_tracker import OutlineTracker
from .photograph_cache import CachingPhotographs
from .registration.manual_poses import ManualPoses
from .registration.poses import FramePoses, no_poses
from .settings import TrackingSettings
from .tracker import Tracker
from .walls.edge_tracker import EdgePoses, EdgeTracker
from .walls.texture_or_edge import BarMotion, texture_or_edge
from .walls.wall_tracker import WallPoses, WallTracker

AnyTracker = Tracker | OutlineTracker

HISTORY = 8  # earlier frames that are handed to the tracker

# Fraction of the first photograph's grains below which a photograph fails: the few that are found are accidental.
MIN_FOUND_FRACTION = 0.1
# Fraction of the reliable poses of the photograph before, below which a photograph fails: one that is blurred, dark or
# covered shows less than its neighbours. A lasting change of the light is none after so many photographs.
MIN_RELIABLE_FRACTION, MOST_UNRELIABLE = 0.4, 2

# Least constant error of a centre measured by its rim [px]: rims are not lit evenly.
RIM_SIGMA_MIN = 0.02

# Standard deviation that is assumed for the centre of a grain whose outline was not detected [px].
UNMEASURED_SIGMA = 1.0


@dataclass(frozen=True, slots=True)
class Series:
    """The photographs of one test."""

    photographs: Photographs
    time: Array  # (f,) [s] of those that are tracked, the first ones
    scale: Scale


@dataclass(frozen=True, slots=True)
class ReferenceGrains:
    """The grains of the first photograph."""

    id: NDArray[np.int64]  # (n,)
    detection: Detection
    radius: Array  # (n,) [m]


@dataclass(frozen=True, slots=True)
class Execution:
    """Threads, checkpoints and progress of the work."""

    workers: int
    checkpoint: Checkpoint
    progress: Progress = no_progress
    pictures: Checkpoint | None = None  # for the JPEG copies of photographs


def follow_photographs(
    series: Series,
    grains: ReferenceGrains,
    execution: Execution,
    settings: TrackingSettings | None = None,
    given: Mapping[int, ManualPoses] | None = None,
) -> Tracks:
    """Track the detected grains through all photographs; finished frames are read from the checkpoint.

    Parameters
    ----------
    series : Series
        The photographs.
    grains : ReferenceGrains
        The grains of the first one.
    execution : Execution
        Threads, checkpoints and progress.
    settings : TrackingSettings, optional
    given : mapping, optional
        Poses given by hand, by frame.
    """
    given = given if given is not None else {}
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
    source = photographs if execution.pictures is None else CachingPhotographs(photographs, execution.pictures)
    with PrefetchedPhotographs(source, frame_count) as coming:
        for k in range(len(poses), frame_count):
            progress("tracking", k, frame_count)
            image = coming[k]
            pose = tracker.first() if k == 0 else _follow(tracker, photographs, image, poses, given.get(k))
            checkpoint.save(k, pose)
            poses.append(pose)
    progress("tracking", frame_count, frame_count)
    pixels = np.stack([np.stack([p.x, p.y], axis=1) for p in poses])
    centre = np.stack([detection.x, detection.y], axis=1)
    constant = np.where(np.isfinite(detection.sigma), detection.sigma, UNMEASURED_SIGMA)
    if isinstance(tracker, OutlineTracker):  # every photograph is measured by itself: its noise is no constant error
        noise = np.nan_to_num(poses[0].sigma)
        constant = np.sqrt(np.maximum(constant**2 - noise**2, RIM_SIGMA_MIN**2))
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
    tracker: AnyTracker, photographs: Photographs, image: Image, poses: list[FramePoses], given: ManualPoses | None
) -> FramePoses:
    """The poses in the next photograph; it fails, alone, if it shows too few grains."""
    k = len(poses)
    recent = poses[-HISTORY:]
    # Damage of a reference is judged on consecutive photographs: those since the last failed one.
    since = next((at for at in range(len(recent), 0, -1) if recent[at - 1].failed_reason), 0)
    if recent[since:]:
        damaged = tracker.find_damaged(recent[since:], k - len(recent[since:]), photographs.__getitem__)
        _renew(tracker, photographs, poses, damaged)
    pose = tracker.follow(image, recent, given)
    failure = describe_failure(pose, poses, photographs.files[k].name)
    return no_poses(tracker.reference, failure) if failure else pose


def describe_failure(pose: FramePoses, poses: list[FramePoses], name: str) -> str:
    """State why a photograph with some poses fails, after those before it; empty: it does not.

    Parameters
    ----------
    pose : FramePoses
        Of the photograph.
    poses : list of FramePoses
        Of all photographs before, the first one included.
    name : str
        Of the photograph's file.
    """
    found, expected = int(pose.has_pose.sum()), int(poses[0].has_pose.sum())
    if found < MIN_FOUND_FRACTION * expected:
        return f"{found} of {expected} grains are found in {name}"
    last = max(k for k, each in enumerate(poses) if not each.failed_reason)
    reliable, usual = int(pose.is_reliable.sum()), int(poses[last].is_reliable.sum())
    if len(poses) - 1 - last < MOST_UNRELIABLE and reliable < MIN_RELIABLE_FRACTION * usual:
        return (
            f"{reliable} of {expected} grains are found reliably in {name}, {usual} in the photograph before: is it "
            "blurred, dark or covered?"
        )
    return ""


def _renew(tracker: AnyTracker, photographs: Photographs, poses: list[FramePoses], rows: Rows) -> None:
    """Renew the references of `rows` (m,) from the last frame of poses."""
    if len(rows):
        tracker.renew(rows, len(poses) - 1, photographs[len(poses) - 1], poses[-1])


def follow_walls(series: Series, walls: WallTracks, depth: Array, execution: Execution, source: Path) -> BarMotion:
    """Track the walls where their endpoints are NaN.

    Parameters
    ----------
    series : Series
        The photographs.
    walls : WallTracks
        The walls of f frames, complete in frame 0.
    depth : (w,) array
        Visible depth of each bar [m].
    execution : Execution
        Threads, checkpoints and progress.
    source : Path
        The walls' table, for messages.

    Returns
    -------
    BarMotion
        Endpoints are NaN where a wall is not found; standard deviations where a table gives it.

    Raises
    ------
    InputError
        If a wall shows neither a texture nor an edge.
    """
    photographs, checkpoint, progress = series.photographs, execution.checkpoint, execution.progress
    frame_count = len(walls.endpoints)
    tracker = WallTracker(photographs[0], walls.endpoints[0], series.scale, depth, workers=execution.workers)
    edge_tracker = EdgeTracker(photographs[0], walls.endpoints[0], series.scale)
    followed = np.asarray(np.isnan(walls.endpoints).any(axis=(2, 3)), dtype=np.bool_)
    blank = (tracker.patch_count < tracker.settings.min_patches) & ~edge_tracker.seen
    for w in np.flatnonzero(followed.any(axis=0) & blank):
        raise InputError(
            source,
            f"frame 0, wall {walls.name[w]!r}",
            f"shows {tracker.patch_count[w]} patches of texture within {depth[w] * 1e3:.3g} mm on the right of 1 → 2, "
            "and no edge: too little to be followed; give its position in every frame",
        )
    finished = [checkpoint.load(k, WallPoses, EdgePoses) for k in range(min(checkpoint.finished(), frame_count))]
    poses: list[WallPoses] = [texture for texture, _ in finished]
    edges: list[EdgePoses] = [edge for _, edge in finished]
    with PrefetchedPhotographs(photographs, frame_count) as coming:
        for k in range(len(poses), frame_count):
            progress("walls", k, frame_count)
            image = coming[k]
            pose = tracker.first() if k == 0 else tracker.follow(image, poses[-HISTORY:])
            edge = edge_tracker.first() if k == 0 else edge_tracker.follow(image, edges[-HISTORY:])
            pose, edge = _replace_given(pose, edge, walls.endpoints[k], ~followed[k])
            checkpoint.save(k, pose, edge)
            poses.append(pose)
            edges.append(edge)
    progress("walls", frame_count, frame_count)
    return texture_or_edge(poses, edges, ~followed, tracker.lined, series.scale.mean_size)


def _replace_given(
    pose: WallPoses, edge: EdgePoses, endpoints: Array, given: NDArray[np.bool_]
) -> tuple[WallPoses, EdgePoses]:
    here, end = given[:, None, None], given[:, None]
    return (
        WallPoses(
            np.where(here, endpoints, pose.endpoints), np.where(end, np.nan, pose.sigma),
            np.where(given, np.nan, pose.zncc), np.where(given, 0, pose.patches),
        ),
        EdgePoses(np.where(here, endpoints, edge.endpoints), np.where(end, np.nan, edge.sigma), edge.fraction),
    )  # fmt: skip
