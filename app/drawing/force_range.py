"""The range of normal forces that widths and colours resolve, the same in all frames and pictures of a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..solver.bodies.grains import Array
from ..solver.frame_forces import FrameForces

WEAK_FRACTION = 0.5  # of the mean f_n: below it a contact is drawn thin and grey
DIFFERENCE_FRACTION = 0.4  # of the range: the difference of forces drawn widest and brightest
TOP_QUANTILE = 0.998  # of all f_n > 0: above it width and colour are constant
THINNEST, THICKEST = 0.022, 0.36  # line radius over grain radius, of a contact without force and of one at the top


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

    def fraction_of_ramp(self, fn: NDArray[np.floating]) -> Array:
        """Return places of forces [N] on the ramp of colours, 0 at the weak level and 1 at the top."""
        place = (np.nan_to_num(fn) - self.weak) / (self.top - self.weak)
        return np.asarray(np.clip(place, 0.0, 1.0), np.float64)

    @classmethod
    def of(cls, frames: Sequence[FrameForces]) -> ForceRange:
        """Return the range of a finished run; mean 1 N if it has no force."""
        return cls.of_forces([frame.fn for frame in frames])

    @classmethod
    def of_forces(cls, forces: Sequence[Array]) -> ForceRange:
        """Return the range of forces [N]; mean 1 N if there is none."""
        fn = np.concatenate([np.empty(0), *(each[np.isfinite(each) & (each > 0.0)] for each in forces)])
        if len(fn) == 0:
            return cls(1.0, 4.0)
        mean = float(fn.mean())
        return cls(mean, max(float(np.quantile(fn, TOP_QUANTILE)), 2.0 * mean))
