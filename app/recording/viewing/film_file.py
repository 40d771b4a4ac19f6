"""Encoding of pictures as a film that browsers play."""

from __future__ import annotations

import errno
from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np

from ...process.atomic import replacing
from .headless import NoPictureError

PROBE = 1 << 16  # [bytes] more than a film begins with
CODECS = {".mp4": "vp09", ".webm": "VP90"}  # VP9, which all browsers play and every OpenCV can write; H.264 it cannot


def encode_film(file: Path, pictures: Iterable[bytes], rate: float) -> int:
    """Write pictures as a film; the suffix of the file selects the format.

    Parameters
    ----------
    file : Path
        The film: .webm or .mp4.
    pictures : iterable of bytes
        PNG pictures of one size; an odd last row or column is left out.
    rate : float
        Pictures per second.

    Returns
    -------
    int
        Size of the film [bytes].

    Raises
    ------
    NoPictureError
        The format is unknown, or this OpenCV cannot write it.
    """
    suffix = file.suffix.lower()
    if suffix not in CODECS:
        raise NoPictureError(f"{file}: a film is .mp4 or .webm")
    with replacing(file) as part:
        # OpenCV selects the container by the suffix of the file name.
        loose = part.with_name(f"{file.stem}.part{suffix}")
        writer: cv2.VideoWriter | None = None
        count = 0
        try:
            for picture in pictures:
                image = cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_COLOR)
                assert image is not None
                height, width = (side - side % 2 for side in image.shape[:2])  # films have even sides
                if writer is None:
                    code = cv2.VideoWriter.fourcc(*CODECS[suffix])
                    writer = cv2.VideoWriter(str(loose), cv2.CAP_FFMPEG, code, rate, (width, height))
                    if not writer.isOpened():
                        loose.write_bytes(bytes(PROBE))  # raises where the disk is full
                        raise NoPictureError(f"{file}: this OpenCV cannot write a film of {width} × {height} pixels")
                writer.write(image[:height, :width])
                count += 1
            if writer is not None:
                writer.release()
                _check_whole(loose, count, file)
            loose.replace(part)
        finally:
            loose.unlink(missing_ok=True)
    return file.stat().st_size


def _check_whole(film: Path, count: int, file: Path) -> None:
    """Raise OSError where a film has fewer pictures than were written: OpenCV reports no full disk."""
    reader = cv2.VideoCapture(str(film), cv2.CAP_FFMPEG)
    found = 0
    while reader.grab():
        found += 1
    reader.release()
    if found < count:
        raise OSError(errno.ENOSPC, f"only {found} of {count} pictures could be written", str(file))
