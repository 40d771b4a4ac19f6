"""Line width and colour of a force, from one range for all frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...solver.bodies.grains import Array
from ...solver.frame_forces import FrameForces
from .canvas import Canvas
from .colours import FORCE_RAMP, OPEN, RAMP_LEVELS, WEAK, packed, packed_one

WEAK_FRACTION = 0.5  # of the mean f_n: below it a contact is drawn thin and grey
TOP_QUANTILE = 0.998  # of all f_n > 0: above it width and colour are constant
THINNEST = 0.022  # line radius over grain radius, of a contact without force
THICKEST = 0.36  # of a contact at the top

_RAMP = packed(FORCE_RAMP)
_WEAK, _OPEN = packed_one(WEAK), packed_one(OPEN)


@dataclass(frozen=True, slots=True)
class ForceRange:
    """The range of forces that widths and colours resolve, the same in every frame."""

    mean: float  # [N]
    top: float  # [N] drawn widest and brightest, as are all forces above

    def __post_init__(self) -> None:
        if not (self.mean > 0.0 and WEAK_FRACTION * self.mean < self.top < np.inf):
            raise ValueError(f"mean {self.mean} N and top {self.top} N are not a valid range of forces")

    @property
    def weak(self) -> float:
        """Force [N] below which a contact is drawn thin and grey."""
        return WEAK_FRACTION * self.mean

    @classmethod
    def of(cls, frames: Sequence[FrameForces]) -> ForceRange:
        """Return the range of a finished run; mean 1 N if it has no force."""
        return cls.of_forces([frame.fn for frame in frames])

    @classmethod
    def of_forces(cls, forces: Sequence[Array]) -> ForceRange:
        """Return the range of forces [N]; mean 1 N if there is none."""
        fn = np.concatenate([np.empty(0), *forces])
        fn = fn[np.isfinite(fn) & (fn > 0.0)]
        if len(fn) == 0:
            return cls(1.0, 4.0)
        mean = float(fn.mean())
        return cls(mean, max(float(np.quantile(fn, TOP_QUANTILE)), 2.0 * mean))


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
        weak, top = self.range.weak, self.range.top
        level = np.clip(np.round((fn - weak) / (top - weak) * (RAMP_LEVELS - 1)), 0, RAMP_LEVELS - 1).astype(np.int64)
        colours = np.where(fn < weak, _WEAK, _RAMP[level])
        return np.where(fn <= 0.0, _OPEN, colours).astype(np.uint32)

    def clipped(self, fn: Array) -> int:
        """Return the number of forces above the top of the range."""
        return int(np.count_nonzero(fn > self.range.top))
