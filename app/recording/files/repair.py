"""Mends a recording whose end is missing: a disk that was full, a copy that was cut, a machine that went down."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rerun.chunk import RrdReader

from ...atomic import replacing
from ..viewing.viewer import run_tool
from .readback import read_forces


@dataclass(frozen=True, slots=True)
class MendedRecording:
    """What could be saved."""

    path: Path
    size: int  # [bytes]
    former_size: int  # [bytes] of the damaged file
    frames: int  # whose reported forces are there


def repair_recording(damaged: Path | str, target: Path | str) -> MendedRecording:
    """Write all that can be read of a damaged recording to a new file that every viewer opens.

    Raises FileNotFoundError where there is no such file, OSError where nothing in it can be read.
    """
    damaged, target = Path(damaged), Path(target)
    if not damaged.is_file():
        raise FileNotFoundError(f"there is no recording {damaged}")
    with replacing(target) as part:
        run_tool("optimize", "--continue-on-error", "--profile", "live", damaged, "-o", part)
        frames = _frames_of(part)
        if frames == 0:
            raise OSError("no frame of it could be read; there is nothing to save")
        run_tool("verify", part)
    return MendedRecording(target, target.stat().st_size, damaged.stat().st_size, frames)


def _frames_of(path: Path) -> int:
    if not RrdReader(str(path)).recordings():
        return 0
    try:
        return len(read_forces(path))
    except ValueError:  # no frame's forces came through
        return 0
