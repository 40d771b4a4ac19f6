"""A map of the grains: each a disc, coloured by one quantity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from ....drawing.ramps import FORCE_RAMP
from ....solver.bodies.grains import Array
from ...look.clock import Clock
from ...look.colours import DIFFERENCE_RAMP, OPEN, UNCERTAINTY_RAMP, packed, packed_one
from ...look.ramp_legend import PIECES, log_ramp_legend
from ...look.scene import Scene
from ..grains_and_walls import last_seen

TOP_QUANTILE = 0.99  # of a quantity over all grains and frames: above it the colour is constant
_RAMPS = {"size": packed(UNCERTAINTY_RAMP), "difference": packed(DIFFERENCE_RAMP), "force": packed(FORCE_RAMP)}


def usual_top(*values: Array) -> float:
    """Return the value at which the colours of quantities end: few are beyond it."""
    known = np.concatenate([np.abs(each[np.isfinite(each)]) for each in values])
    return float(np.quantile(known, TOP_QUANTILE)) if len(known) and known.any() else 1.0


@dataclass(frozen=True, slots=True)
class GrainMap:
    """A quantity of the grains in every frame by colour."""

    path: str  # entity of the map
    legend: str  # entity of its legend
    unit: str
    top: float  # the colours end there
    ramp: str = "size"  # or force, or difference: of both signs

    def colours(self, value: Array) -> NDArray[np.uint32]:
        """Return colours of values (k,), faint where they are unknown."""
        ramp = _RAMPS[self.ramp]
        place = np.clip(0.5 * (1.0 + value / self.top) if self._signed else value / self.top, 0.0, 1.0)
        level = np.round(np.nan_to_num(place) * (len(ramp) - 1)).astype(np.int64)
        return np.where(np.isfinite(value), ramp[level], packed_one(OPEN)).astype(np.uint32)

    def log_legend(self, stream: rr.RecordingStream, scene: Scene) -> None:
        """Log the line of colours with its values, static."""
        fraction = np.linspace(0.0, 1.0, PIECES)
        value = ((2.0 * fraction - 1.0) if self._signed else fraction) * self.top
        log_ramp_legend(stream, scene.canvas, self.legend, self.colours(value), self._texts())

    def log(self, clock: Clock, scene: Scene, value: Array) -> None:
        """Log the grains of one frame with their values (n,) as displayed, NaN: unknown; the clock is at its start."""
        points = scene.canvas.points(last_seen(scene.tracks.position, clock.frame)).astype(np.float32)
        radii = (0.94 * scene.canvas.lengths(scene.tracks.radius)).astype(np.float32)
        colours = self.colours(value)
        clock.log(self.path, rr.Points2D(points, radii=radii, colors=colours, draw_order=5.0))

    @property
    def _signed(self) -> bool:
        return self.ramp == "difference"

    def _texts(self) -> list[tuple[float, str]]:
        if self._signed:
            return [(0.0, f"−{self.top:.3g}{self.unit}"), (0.5, "0"), (1.0, f"{self.top:.3g}{self.unit}")]
        return [(0.0, "0"), (0.5, f"{0.5 * self.top:.3g}"), (1.0, f"≥ {self.top:.3g}{self.unit}")]
