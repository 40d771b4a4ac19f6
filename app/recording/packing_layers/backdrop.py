"""Writes photographs: JPEG, at half size when large, shown dimmed so that forces stand out."""

from __future__ import annotations

import cv2
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from ..look import entities
from ..look.canvas import Canvas
from ..look.clock import Clock

JPEG_QUALITY = 80
OPACITY = 0.38  # over the dark background of the views


def log_photograph(clock: Clock, canvas: Canvas, photograph: NDArray[np.uint8]) -> None:
    """Log one grey photograph (H, W)."""
    if photograph.dtype != np.uint8 or photograph.ndim != 2:
        raise ValueError(f"a photograph must be uint8 (H, W), not {photograph.dtype} {photograph.shape}")
    if photograph.shape[0] != canvas.scale.height:
        raise ValueError(f"the photograph has {photograph.shape[0]} rows, the scale says {canvas.scale.height}")
    clock.start()
    clock.stream.log(
        entities.PHOTOGRAPH,
        rr.EncodedImage(
            contents=encode_photograph(photograph, canvas.shrink),
            media_type="image/jpeg",
            opacity=OPACITY,
            draw_order=-10.0,
        ),
    )


def encode_photograph(photograph: NDArray[np.uint8], shrink: int) -> bytes:
    """Encode a photograph (H, W) as JPEG, every shrink × shrink pixels made one."""
    if shrink > 1:
        rows, columns = (side - side % shrink for side in photograph.shape)
        whole = photograph[:rows, :columns]  # whole blocks only, so that a pixel keeps its place
        photograph = cv2.resize(whole, (columns // shrink, rows // shrink), interpolation=cv2.INTER_AREA)  # pyright: ignore
    done, data = cv2.imencode(".jpg", photograph, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    if not done:
        raise ValueError(f"a photograph of {photograph.shape} pixels could not be encoded as JPEG")
    return data.tobytes()
