"""What a camera has noted in a photograph's file (EXIF): the time, and how it was held."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

ORIENTATION, CHANGED, CAMERA = 0x0112, 0x0132, 0x8769  # tags of EXIF: the last one leads to those of the camera
TAKEN, FRACTION = 0x9003, 0x9291  # among those: time, and its fraction of a second
ROTATIONS = {3: 180, 6: 90, 8: 270}  # [degrees] clockwise that shows a photograph as the camera believes to stand


@dataclass(frozen=True, slots=True)
class CameraNote:
    """The notes in one photograph."""

    time: float | None  # [s] since some day; None: not noted
    rotation: int = 0  # [degrees] clockwise


NOTHING = CameraNote(None)


def read_note(file: Path) -> CameraNote:
    """Read the notes of a photograph; a file without notes, or that cannot be read, has none."""
    try:
        stat = file.stat()
    except OSError:
        return NOTHING
    return _read(file, stat.st_mtime_ns, stat.st_size)


@lru_cache(maxsize=5000)
def _read(file: Path, _changed: int, _size: int) -> CameraNote:
    from PIL import Image, UnidentifiedImageError  # imported late: only photographs need it

    try:
        with warnings.catch_warnings(action="ignore"), Image.open(file) as picture:  # of many pixels: none is read
            notes = picture.getexif()
            camera = notes.get_ifd(CAMERA)
            time = _time_of(camera.get(TAKEN) or notes.get(CHANGED), camera.get(FRACTION))
            return CameraNote(time, ROTATIONS.get(notes.get(ORIENTATION, 1), 0))
    except (
        UnidentifiedImageError,
        OSError,
        ValueError,
        SyntaxError,
        KeyError,
        TypeError,
        Image.DecompressionBombError,
    ):
        return NOTHING  # damaged notes are no notes


def _time_of(text: Any, fraction: Any) -> float | None:
    """A time of EXIF, such as 2024:05:06 07:08:09, in seconds; cameras know no zone."""
    if not isinstance(text, str):
        return None
    try:
        time = datetime.strptime(text.strip("\0 "), "%Y:%m:%d %H:%M:%S").replace(tzinfo=UTC).timestamp()
        return time + float(f"0.{str(fraction).strip()}") if fraction else time
    except ValueError:
        return None


def camera_times(files: Sequence[Path]) -> NDArray[np.float64] | None:
    """Return the time (f,) [s] of every photograph by its camera, from the earliest one on; None where one lacks it."""
    times = [read_note(file).time for file in files]
    found = [time for time in times if time is not None]
    if len(found) < len(times) or not times:
        return None
    return np.array(found) - min(found)


def noted_rotation(files: Sequence[Path]) -> int | None:
    """Return the rotation [degrees] clockwise that all photographs note; None where they differ."""
    found = {read_note(file).rotation for file in files}
    return found.pop() if len(found) == 1 else None
