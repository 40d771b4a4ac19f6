"""Repairs a recording whose end is missing, after a full disk, an incomplete copy or a crash of the machine."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rerun.chunk import RrdReader

from ...process.atomic import replacing
from ..viewing.viewer import run_tool
from .readback import read_forces


@dataclass(frozen=True, slots=True)
class RepairedRecording:
    """The repaired recording and the frames recovered."""

    path: Path
    size: int  # [bytes]
    former_size: int  # [bytes] of the damaged file
    frames: int  # with reported forces


def repair_recording(damaged: Path | str, target: Path | str) -> RepairedRecording:
    """Write all readable data of a damaged recording to a new file that every viewer opens.

    Parameters
    ----------
    damaged : Path or str
        The damaged recording.
    target : Path or str
        The new recording.

    Returns
    -------
    RepairedRecording
        Size and frames of the new recording.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    OSError
        If nothing in it can be read.
    """
    damaged, target = Path(damaged), Path(target)
    if not damaged.is_file():
        raise FileNotFoundError(f"there is no recording {damaged}")
    with replacing(target) as part:
        run_tool("optimize", "--continue-on-error", "--profile", "live", damaged, "-o", part)
        frames = _frames_of(part)
        if frames == 0:
            raise OSError(f"{damaged}: no frame could be read, there is nothing to save")
        run_tool("verify", part)
    return RepairedRecording(target, target.stat().st_size, damaged.stat().st_size, frames)


def _frames_of(path: Path) -> int:
    if not RrdReader(str(path)).recordings():
        return 0
    try:
        return len(read_forces(path))
    except ValueError:  # no forces were recovered
        return 0
