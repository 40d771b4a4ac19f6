"""Photographs in memory: a few as they are measured, and more at the eight bits that a page shows."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path
from typing import Any, Generic, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from ...experiment.pictures.image import Channel, Image, Rotation, rotated
from ...experiment.pictures.picture_file import read_levels, read_photograph

Name = tuple[Path, int, Channel, Rotation]  # of a photograph: changes with its file, its channel, its rotation
Levels = NDArray[np.uint8]  # (h, w)
Part = tuple[slice, slice]  # rows and columns
Kept = TypeVar("Kept")

WHOLE: Part = (slice(None), slice(None))
MEASURED_BYTES = 100 << 20  # a photograph of 20 megapixels has 80 MB as it is measured
SHOWN_BYTES = 60 << 20  # three photographs of 20 megapixels
SENT_BYTES = 16 << 20  # of pictures as they were sent
SMALL_PICTURE = 2_000_000  # [bytes] of those that are kept
QUALITY = 90  # of JPEG
BEYOND = 58  # grey level of a crop beyond the edge of the photograph


class PhotographStore:
    """Photographs of one experiment; those used last stay in memory."""

    def __init__(self) -> None:
        self._measured: _LastUsed[Image] = _LastUsed(MEASURED_BYTES, lambda image: image.nbytes)
        self._shown: _LastUsed[Levels] = _LastUsed(SHOWN_BYTES, lambda levels: levels.nbytes)
        self._sent: _LastUsed[bytes] = _LastUsed(SENT_BYTES, len)
        self._reading = threading.Lock()  # one photograph at a time: each takes up to six times its size meanwhile

    def measured(self, name: Name) -> Image:
        """Return a photograph as it is measured, with the precision of its file."""
        with self._reading:
            return self._measured.get(name, lambda: rotated(read_photograph(name[0], channel=name[2]), name[3]))

    def _levels(self, name: Name) -> Levels:
        with self._reading:
            return self._shown.get(name, lambda: read_levels(name[0], name[2], name[3]))

    def picture(self, name: Name, widest: int, part: Part = WHOLE) -> bytes | None:
        """Encode a part of a photograph as JPEG, no wider or higher than so many pixels; None: it is empty."""
        key = *name, widest, *(end for each in part for end in (each.start, each.stop))
        found = self._sent.peek(key)
        if found is not None:
            return found
        cut = self._levels(name)[part]
        if not cut.size:
            return None
        picture = encode_jpeg(cut, widest)
        return self._sent.get(key, lambda: picture) if len(picture) <= SMALL_PICTURE else picture

    def crop(self, name: Name, place: tuple[float, float], width: float, shape: tuple[int, int]) -> bytes:
        """Encode a part of a photograph as JPEG, moved by fractions of a pixel.

        Parameters
        ----------
        name : tuple
            The photograph.
        place : tuple of float
            Centre of the part [px].
        width : float
            Width of the part [px].
        shape : tuple of int
            Rows and columns of the picture that is sent.
        """
        rows, columns = shape
        zoom = columns / width
        # A place is the centre of a pixel where it is a whole number.
        matrix = np.array([
            [zoom, 0.0, 0.5 * (columns - 1) - zoom * place[0]], [0.0, zoom, 0.5 * (rows - 1) - zoom * place[1]]
        ])  # fmt: skip
        return _jpeg(cv2.warpAffine(
            self._levels(name), matrix, (columns, rows), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_CONSTANT,
            borderValue=(BEYOND,),
        ))  # fmt: skip


class _LastUsed(Generic[Kept]):
    """Values by name; those used last stay while they have no more than so many bytes, one always."""

    def __init__(self, most: int, size: Callable[[Kept], int]) -> None:
        self._most, self._size, self._lock = most, size, threading.Lock()
        self._values: OrderedDict[Any, Kept] = OrderedDict()

    def peek(self, name: Any) -> Kept | None:
        with self._lock:
            if name in self._values:
                self._values.move_to_end(name)
            return self._values.get(name)

    def get(self, name: Any, make: Callable[[], Kept]) -> Kept:
        """Return a value, made if it is not there."""
        found = self.peek(name)
        if found is not None:
            return found
        found = make()
        with self._lock:
            self._values[name] = found
            while len(self._values) > 1 and sum(map(self._size, self._values.values())) > self._most:
                self._values.popitem(last=False)
        return found


def encode_jpeg(image: Image | Levels, widest: int) -> bytes:
    """Encode a photograph as JPEG, no wider or higher than so many pixels."""
    shrink = min(1.0, widest / max(image.shape))
    return _jpeg(cv2.resize(image, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA) if shrink < 1.0 else image)


def _jpeg(image: NDArray[Any]) -> bytes:
    return cv2.imencode(".jpg", cv2.convertScaleAbs(image), [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1].tobytes()
