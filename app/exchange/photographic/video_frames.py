"""Frames of a video as photographs: chosen by number or by time, stored without loss."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...process.atomic import replacing_folder
from ...process.errors import InputError, MissingFileError
from ...process.frame_range import ALL_FRAMES, FrameRange

SUFFIXES = frozenset((".mp4", ".avi", ".mov", ".mkv", ".m4v", ".mpg", ".mpeg", ".wmv", ".webm"))
MOST_FRAMES = 100_000


def is_video(name: str) -> bool:
    """Return whether a name is that of a video file."""
    return Path(name).suffix.lower() in SUFFIXES


def duration(video: Path) -> float:
    """Return how long a video plays [s], as its header states; NaN where it cannot be read."""
    import cv2

    stream = cv2.VideoCapture(str(video))
    try:
        count, rate = (float(stream.get(each)) for each in (cv2.CAP_PROP_FRAME_COUNT, cv2.CAP_PROP_FPS))
    finally:
        stream.release()
    return count / rate if count > 0.0 and np.isfinite(rate) and rate > 0.0 else np.nan


def extract_frames(
    video: Path, folder: Path, frames: FrameRange = ALL_FRAMES, interval: float | None = None
) -> tuple[int, float]:
    """Write frames of a video to a folder as PNG, named by their numbers.

    Parameters
    ----------
    video : Path
    folder : Path
        Must not exist.
    frames : FrameRange
        Numbers of the frames, from 0.
    interval : float, optional
        Time between the frames that are kept, among `frames` [s]: the first one at or after each multiple. None: all.

    Returns
    -------
    int
        Number of frames that were written.
    float
        Mean time between them [s].

    Raises
    ------
    InputError
        The video cannot be read, does not give its times, or has no such frames.
    """
    import cv2  # imported late: it takes a tenth of a second

    if not video.is_file():
        raise MissingFileError(video, "", "there is no such file")
    if folder.exists():
        raise InputError(folder, "", "exists already: remove it, or name its photographs instead of the video")
    stream = cv2.VideoCapture(str(video))
    try:
        rate = float(stream.get(cv2.CAP_PROP_FPS))
        if not stream.isOpened() or not np.isfinite(rate) or not rate > 0.0:
            raise InputError(video, "", "is no video that can be read")
        times: list[float] = []
        with replacing_folder(folder) as part:
            number = -1
            while stream.grab():
                number += 1
                if frames.stop is not None and number >= frames.stop:
                    break
                if number < frames.start or (number - frames.start) % frames.step:
                    continue
                time = number / rate
                # Half a frame of tolerance: the times of frames are rounded.
                if interval is not None and times and time - times[0] < len(times) * interval - 0.5 / rate:
                    continue
                seen, picture = stream.retrieve()
                if not seen:
                    raise InputError(video, f"frame {number}", "cannot be decoded")
                if len(times) >= MOST_FRAMES:
                    raise InputError(video, "", f"has more than {MOST_FRAMES} frames: choose them by --frames A:B:STEP")
                (part / f"{number:06d}.png").write_bytes(cv2.imencode(".png", picture)[1].tobytes())
                times.append(time)
            if len(times) < 1:
                raise InputError(video, "", f"has {number + 1} frames, of which --frames {frames} chooses none")
    finally:
        stream.release()
    return len(times), (times[-1] - times[0]) / max(len(times) - 1, 1) if len(times) > 1 else 1.0 / rate
