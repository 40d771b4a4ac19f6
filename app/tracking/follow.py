"""From photographs to tracks in the world: detection on the first one, then one photograph after the other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from app.checkpoint import Checkpoint
from app.frames import Photographs
from app.progress import Progress, silent
from app.tracking.detection import Detection, DetectionSettings, detect_grains, refine_grains
from app.tracking.tracker import FramePoses, Tracker
from app.tracks import Tracks
from app.units import Scale
from solver.grains import Array

HISTORY = 8  # frames that the tracker looks back upon


def detect(first: NDArray[np.float32], radii: Array, guess: tuple[Array, Array, Array] | None) -> Detection:
    """Find the grains on the first photograph, or refine those that were given (x, y, radius (n,) [px]).

    radii: known radius classes [px], may be empty.
    """
    if guess is not None:
        return refine_grains(first, *guess)
    return detect_grains(first, DetectionSettings(radii=tuple(float(r) for r in radii)))


def follow_photographs(
    photographs: Photographs,
    detection: Detection,
    ids: NDArray[np.int64],
    time: Array,
    scale: Scale,
    *,
    workers: int,
    checkpoint: Checkpoint,
    progress: Progress = silent,
) -> Tracks:
    """Follow the detected grains through all photographs; finished ones are taken from the checkpoint."""
    tracker = Tracker(photographs[0], detection, workers=workers)
    frame_count = len(time)
    poses: list[FramePoses] = [
        checkpoint.load(k, FramePoses)[0] for k in range(min(checkpoint.finished(), frame_count))
    ]
    for k in range(len(poses), frame_count):
        progress("tracking", k, frame_count)
        pose = tracker.first() if k == 0 else tracker.follow(photographs[k], poses[-HISTORY:])
        checkpoint.save(k, pose)
        poses.append(pose)
    progress("tracking", frame_count, frame_count)
    return Tracks(
        id=ids,
        radius=detection.radius * scale.pixel_size,
        time=time,
        position=scale.to_world(np.stack([np.stack([p.x, p.y], axis=1) for p in poses])),
        rotation=scale.angle_to_world(np.stack([p.rotation for p in poses])),
        sigma=np.stack([p.sigma for p in poses]) * scale.pixel_size,
        zncc=np.stack([p.zncc for p in poses]),
        status=np.stack([p.status for p in poses]),
        centre_sigma=detection.sigma * scale.pixel_size,
    )
