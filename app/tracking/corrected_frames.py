"""What tracking keeps of an earlier one when somebody tells other poses: the frames before the first of them."""

from __future__ import annotations

import json

import numpy as np

from ..atomic import write_atomically
from ..experiment.corrections import PoseCorrections
from ..results.checkpoint import Checkpoint

OBEYED = "obeyed.json"  # beside a checkpoint's frames: what they obey, by frame


def keep_frames_before(checkpoint: Checkpoint, told: PoseCorrections | None) -> None:
    """Have in the checkpoint no frame that obeys, or follows from, other poses than those that are told now."""
    file, now = checkpoint.folder / OBEYED, _by_frame(told)
    former = json.loads(file.read_bytes()) if file.exists() else {}
    if now == former:
        return
    other = [int(frame) for frame in {*now, *former} if now.get(frame) != former.get(frame)]
    checkpoint.drop(min(other))  # first: what is told may only stand beside frames that obey it
    write_atomically(file, json.dumps(now).encode())


def _by_frame(told: PoseCorrections | None) -> dict[str, list[str]]:
    """What is told of each frame, in an order of its own."""
    found: dict[str, list[str]] = {}
    if told is not None:
        rows = zip(told.frame.tolist(), told.id.tolist(), np.stack([told.x, told.y, told.theta], axis=1), strict=True)
        for frame, name, pose in rows:
            found.setdefault(str(frame), []).append(f"{name} {pose.tolist()}")
    return {frame: sorted(lines) for frame, lines in found.items()}
