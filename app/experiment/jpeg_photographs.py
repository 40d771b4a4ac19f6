"""Photographs as JPEG for recordings and pages, at half size where they are large."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..process.frame_range import FrameRange
from .photographs import Readable
from .pictures.image import Image

LARGEST = 4_000_000  # px; above it a photograph is shown at half size
JPEG_QUALITY = 80


@dataclass(frozen=True, slots=True)
class JpegPhotograph:
    """A photograph encoded as JPEG."""

    jpeg: NDArray[np.uint8]  # (bytes,)
    height: int  # [px] of the original
    width: int
    shrink: int  # shrink × shrink original pixels are one

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the original [px]."""
        return self.height, self.width


class JpegPhotographs:
    """The photographs of a run's frames as JPEG, each read and encoded on access."""

    def __init__(self, photographs: Readable[Image], frames: FrameRange) -> None:
        """Wrap the photographs of an experiment, 255 is white; frames: those that the run covers."""
        self._photographs, self._frames = photographs, frames

    def __getitem__(self, frame: int) -> JpegPhotograph:
        return encode_jpeg(self._photographs[self._frames.number(frame)])


def shrink_factor(shape: tuple[int, int]) -> int:
    """Return the factor by which a photograph of these rows and columns is reduced, along each side."""
    return 2 if math.prod(shape) > LARGEST else 1


def encode_jpeg(photograph: Image) -> JpegPhotograph:
    """Encode a grey photograph (H, W), 255 is white; only whole blocks of pixels are kept, so that none shifts.

    Raises
    ------
    ValueError
        The photograph cannot be encoded.
    """
    import cv2  # imported late: given tracks do not need it

    shrink = shrink_factor(photograph.shape)  # type: ignore[arg-type]
    shown = cv2.convertScaleAbs(photograph)  # rounds and saturates at 255
    if shrink > 1:
        rows, columns = (side - side % shrink for side in shown.shape)
        half = (columns // shrink, rows // shrink)
        shown = cv2.resize(shown[:rows, :columns], half, interpolation=cv2.INTER_AREA)
    encoded, data = cv2.imencode(".jpg", shown, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    if not encoded:
        raise ValueError(f"a photograph of {photograph.shape} pixels could not be encoded as JPEG")
    return JpegPhotograph(np.asarray(data, np.uint8).ravel(), photograph.shape[0], photograph.shape[1], shrink)
