"""Photographs as recordings show them: JPEG, at half size where they are large."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .photographs import Image, Readable

LARGEST = 4_000_000  # px; above it a photograph is shown at half size
JPEG_QUALITY = 80


@dataclass(frozen=True, slots=True)
class ShownPhotograph:
    """A photograph as it is shown."""

    jpeg: NDArray[np.uint8]  # (bytes,)
    height: int  # [px] of the photograph itself
    width: int
    shrink: int  # shrink × shrink of its pixels are one

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the photograph itself [px]."""
        return self.height, self.width


class ShownPhotographs:
    """The photographs of a run's frames as they are shown; read where and when they are asked for."""

    def __init__(self, photographs: Readable[Image], first: int) -> None:
        """photographs: of the whole experiment, 255 is white; first: photograph of the run's frame 0."""
        self._photographs, self._first = photographs, first

    def __getitem__(self, frame: int) -> ShownPhotograph:
        return show(self._photographs[self._first + frame])


def shrink_of(shape: tuple[int, int]) -> int:
    """How many pixels of a photograph of these rows and columns are one as it is shown, either way."""
    return 2 if math.prod(shape) > LARGEST else 1


def show(photograph: Image) -> ShownPhotograph:
    """A grey photograph (H, W), 255 is white, as it is shown; whole blocks of pixels only, so that one keeps its place.

    Raises ValueError where it cannot be encoded.
    """
    import cv2  # not where there are tracks

    shrink = shrink_of(photograph.shape)  # type: ignore[arg-type]
    shown = cv2.convertScaleAbs(photograph)  # rounds, and keeps to 255
    if shrink > 1:
        rows, columns = (side - side % shrink for side in shown.shape)
        half = (columns // shrink, rows // shrink)
        shown = cv2.resize(shown[:rows, :columns], half, interpolation=cv2.INTER_AREA)
    done, data = cv2.imencode(".jpg", shown, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    if not done:
        raise ValueError(f"a photograph of {photograph.shape} pixels could not be encoded as JPEG")
    return ShownPhotograph(np.asarray(data, np.uint8).ravel(), photograph.shape[0], photograph.shape[1], shrink)
