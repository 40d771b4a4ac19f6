"""Writes photographs, shown dimmed so that forces stand out."""

from __future__ import annotations

import rerun as rr

from ...experiment.shown import ShownPhotograph
from ..look import entities
from ..look.canvas import Canvas
from ..look.clock import Clock

OPACITY = 0.38  # over the dark background of the views


def log_photograph(clock: Clock, canvas: Canvas, photograph: ShownPhotograph) -> None:
    """Log one photograph. Raises ValueError where it is not one that the canvas lies on."""
    if photograph.height != canvas.scale.height:
        raise ValueError(f"the photograph has {photograph.height} rows, the scale says {canvas.scale.height}")
    if photograph.shrink != canvas.shrink:
        raise ValueError(f"the photograph is shown 1:{photograph.shrink}, the canvas 1:{canvas.shrink}")
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
