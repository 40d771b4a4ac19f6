"""Removal of stored frames that depend on pose corrections that have changed since."""

from __future__ import annotations

import json

import numpy as np

from ..experiment.corrections import PoseCorrections
from ..process.atomic import write_atomically
from ..results.checkpoint import Checkpoint

APPLIED = "obeyed.json"  # beside a checkpoint's frames: the corrections applied in them, by frame


def drop_outdated_frames(checkpoint: Checkpoint, corrections: PoseCorrections | None) -> None:
    """Drop the frames of a checkpoint from the first one whose corrections have changed."""
    file, current = checkpoint.folder / APPLIED, _lines_by_frame(corrections)
    applied = json.loads(file.read_bytes()) if file.exists() else {}
    if current == applied:
        return
    changed = [int(frame) for frame in {*current, *applied} if current.get(frame) != applied.get(frame)]
    checkpoint.drop(min(changed))  # first: corrections may only be stored beside frames that contain them
    write_atomically(file, json.dumps(current).encode())


def _lines_by_frame(corrections: PoseCorrections | None) -> dict[str, list[str]]:
    """The corrections of each frame, one sorted line each."""
    found: dict[str, list[str]] = {}
    if corrections is not None:
        poses = np.stack([corrections.x, corrections.y, corrections.theta], axis=1)
        for frame, name, pose in zip(corrections.frame.tolist(), corrections.id.tolist(), poses, strict=True):
            found.setdefault(str(frame), []).append(f"{name} {pose.tolist()}")
    return {frame: sorted(lines) for frame, lines in found.items()}
