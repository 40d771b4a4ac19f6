"""Line width and colour of a force, from one range for all frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from ...drawing.force_range import THICKEST, THINNEST, ForceRange
from ...drawing.ramps import FORCE_RAMP, RAMP_LEVELS
from ...solver.bodies.grains import Array
from .canvas import Canvas
from .colours import OPEN, WEAK, packed, packed_one
from .values import strips

_RAMP = packed(FORCE_RAMP)
_WEAK, _OPEN = packed_one(WEAK), packed_one(OPEN)


@dataclass(frozen=True, slots=True)
class ForceStyle:
    """Width [px] and colour of a contact."""

    range: ForceRange
    grain_radius: float  # [px]
    quantum: float  # [px]

    @classmethod
    def on(cls, canvas: Canvas, force_range: ForceRange) -> ForceStyle:
        """Return the style for a canvas."""
        return cls(force_range, canvas.grain_radius, canvas.quantum)

    def radii(self, fn: NDArray[np.floating]) -> NDArray[np.float32]:
        """Return half widths of lines [px], linear in fn [N], in multiples of the quantum."""
        fraction = np.clip(np.nan_to_num(fn) / self.range.top, 0.0, 1.0)
        radius = self.grain_radius * (THINNEST + (THICKEST - THINNEST) * fraction)
        return (np.maximum(np.round(radius / self.quantum), 1.0) * self.quantum).astype(np.float32)

    def colours(self, fn: NDArray[np.floating]) -> NDArray[np.uint32]:
        """Return colours 0xRRGGBBAA: faint without force, grey up to the weak level, then along the ramp."""
        fn = np.nan_to_num(fn)
        level = np.round(self.range.fraction_of_ramp(fn) * (RAMP_LEVELS - 1)).astype(np.int64)
        colours = np.where(fn < self.range.weak, _WEAK, _RAMP[level])
        return np.where(fn <= 0.0, _OPEN, colours).astype(np.uint32)

    def strips(self, lines: NDArray[np.floating], fn: Array, order: float = 20.0) -> rr.LineStrips2D:
        """Return contacts (c, 2, 2) [px] as lines in the widths and colours of their forces [N]."""
        return strips(lines, self.radii(fn), self.colours(fn), order)

    def clipped(self, fn: Array) -> int:
        """Return the number of forces above the top of the range."""
        return int(np.count_nonzero(fn > self.range.top))
