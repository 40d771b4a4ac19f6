"""How a force looks: line width and colour, from one range for all frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.sequence.frame_forces import FrameForces

from .canvas import Canvas
from .colours import FORCE_RAMP, OPEN, RAMP_LEVELS, WEAK, packed, packed_one

WEAK_SHARE = 0.5  # of the mean f_n: below it a contact is drawn thin and grey
TOP_QUANTILE = 0.998  # of all f_n > 0: above it width and colour no longer grow
THINNEST = 0.022  # line radius over grain radius, of a contact without force
THICKEST = 0.36  # of a contact at the top

_RAMP = packed(FORCE_RAMP)
_WEAK, _OPEN = packed_one(WEAK), packed_one(OPEN)


@dataclass(frozen=True, slots=True)
class ForceRange:
    """The forces that the drawing distinguishes, the same in every frame."""

    mean: float  # [N]
    top: float  # [N] drawn widest and brightest, as is everything above

    def __post_init__(self) -> None:
        if not (self.mean > 0.0 and WEAK_SHARE * self.mean < self.top < np.inf):
            raise ValueError(f"mean {self.mean} and top {self.top} do not make a range of forces")

    @property
    def weak(self) -> float:
        return WEAK_SHARE * self.mean

    @classmethod
    def of(cls, frames: Sequence[FrameForces]) -> ForceRange:
        """The range of a finished run; 1 N where it has no force at all."""
        return cls.of_forces([frame.fn for frame in frames])

    @classmethod
    def of_forces(cls, forces: Sequence[Array]) -> ForceRange:
        """The range of all these forces [N]; 1 N where there is none."""
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
        return cls(force_range, canvas.grain_radius, canvas.quantum)

    def radii(self, fn: NDArray[np.floating]) -> NDArray[np.float32]:
        """Half widths of lines [px] in multiples of the quantum, growing linearly with fn [N]."""
        share = np.clip(np.nan_to_num(fn) / self.range.top, 0.0, 1.0)
        radius = self.grain_radius * (THINNEST + (THICKEST - THINNEST) * share)
        return (np.maximum(np.round(radius / self.quantum), 1.0) * self.quantum).astype(np.float32)

    def colours(self, fn: NDArray[np.floating]) -> NDArray[np.uint32]:
        """Colours 0xRRGGBBAA: faint without force, grey up to the weak level, then along the ramp."""
        fn = np.nan_to_num(fn)
        weak, top = self.range.weak, self.range.top
        level = np.clip(np.round((fn - weak) / (top - weak) * (RAMP_LEVELS - 1)), 0, RAMP_LEVELS - 1).astype(np.int64)
        colours = np.where(fn < weak, _WEAK, _RAMP[level])
        return np.where(fn <= 0.0, _OPEN, colours).astype(np.uint32)

    def clipped(self, fn: Array) -> int:
        """How many forces are above the top of the range."""
        return int(np.count_nonzero(fn > self.range.top))
