"""Writes photographs, dimmed so that the forces are visible."""

from __future__ import annotations

import rerun as rr

from ...experiment.jpeg_photographs import JpegPhotograph
from ..look import entities
from ..look.canvas import Canvas
from ..look.clock import Clock

OPACITY = 0.2  # over the dark background of the views


def log_photograph(clock: Clock, canvas: Canvas, photograph: JpegPhotograph) -> None:
    """Log one photograph; raise ValueError if its size differs from that of the canvas."""
    if photograph.height != canvas.scale.height:
        raise ValueError(f"the photograph has {photograph.height} rows, the scale has {canvas.scale.height}")
    if photograph.shrink != canvas.shrink:
        raise ValueError(f"the photograph is reduced 1:{photograph.shrink}, the canvas 1:{canvas.shrink}")
    clock.start()
    clock.stream.log(
        entities.PHOTOGRAPH,
        rr.EncodedImage(
            contents=photograph.jpeg.tobytes(),
            media_type="image/jpeg",
            opacity=OPACITY,
            draw_order=-10.0,
        ),
    )
