"""Writes the kinematics of every frame: maps of the rods, fluctuations as arrows, and curves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from ...solver.bodies.grains import Array
from ...solver.kinematics.sequence_kinematics import SequenceKinematics
from ..look import entities
from ..look.clock import Clock
from ..look.colours import DIFFERENCE_RAMP, OPEN, SERIES, UNCERTAINTY_RAMP, packed, packed_one
from ..look.ramp_legend import PIECES, log_ramp_legend
from ..look.scene import Scene
from ..look.values import log_scalar
from .grains_and_walls import last_seen

TOP_QUANTILE = 0.99  # of a quantity over all rods and frames: above it the colour is constant
ARROW = 2.0  # length of the rms fluctuation, in mean radii
MICRO = 1e6


@dataclass(frozen=True, slots=True)
class _Map:
    """A quantity of the rods by colour."""

    name: str
    value: Array  # (f, n) as displayed
    signed: bool
    unit: str

    @property
    def top(self) -> float:
        known = np.abs(self.value[np.isfinite(self.value)])
        return float(np.quantile(known, TOP_QUANTILE)) if len(known) and known.any() else 1.0

    def colours(self, value: Array, top: float) -> NDArray[np.uint32]:
        """Return colours of values (k,), faint where they are unknown."""
        ramp = packed(DIFFERENCE_RAMP if self.signed else UNCERTAINTY_RAMP)
        place = np.clip(0.5 * (1.0 + value / top) if self.signed else value / top, 0.0, 1.0)
        level = np.round(np.nan_to_num(place) * (len(ramp) - 1)).astype(np.int64)
        return np.where(np.isfinite(value), ramp[level], packed_one(OPEN)).astype(np.uint32)

    def texts(self, top: float) -> list[tuple[float, str]]:
        if self.signed:
            return [(0.0, f"−{top:.3g}{self.unit}"), (0.5, "0"), (1.0, f"{top:.3g}{self.unit}")]
        return [(0.0, "0"), (0.5, f"{0.5 * top:.3g}"), (1.0, f"≥ {top:.3g}{self.unit}")]


class KinematicMaps:
    """Maps and curves of the kinematics of one run."""

    def __init__(self, scene: Scene, found: SequenceKinematics) -> None:
        self._scene, self._found = scene, found
        self._maps = (
            _Map(entities.LOCAL_SHEAR, found.shear_strain, False, ""),
            _Map(entities.D2MIN, MICRO * np.sqrt(found.d2min), False, " µm"),
            _Map(entities.LOCAL_ROTATION, np.degrees(found.rotation), True, "°"),
        )
        self._tops = tuple(each.top for each in self._maps)
        size = np.sum(found.fluctuation**2, axis=2)
        rms = float(np.sqrt(np.nanmean(size))) if np.isfinite(size).any() else 0.0
        self._stretch = ARROW * float(scene.tracks.radius.mean()) / rms if rms > 0.0 else 0.0

    def log_styles(self, stream: rr.RecordingStream) -> None:
        """Log legends and the names of the curves."""
        fraction = np.linspace(0.0, 1.0, PIECES)
        for each, top in zip(self._maps, self._tops, strict=True):
            legend = f"{entities.KINEMATIC_LEGENDS}/{each.name}"
            value = (2.0 * fraction - 1.0) * top if each.signed else fraction * top
            log_ramp_legend(
                stream, self._scene.canvas, legend, f"{legend}/ticks", each.colours(value, top), each.texts(top)
            )
        for path, name, colour in (
            (entities.PARTICIPATION, "participation of the local shear", SERIES[0]),
            (entities.SOLID_FRACTION, "mean local solid fraction", SERIES[1]),
        ):
            stream.log(path, rr.SeriesLines(colors=[colour], names=name, widths=2.0), static=True)

    def log(self, clock: Clock) -> None:
        """Log the maps and curves of one frame."""
        scene, found, k = self._scene, self._found, clock.frame
        place = last_seen(scene.tracks.position, k)
        points = scene.canvas.points(place).astype(np.float32)
        radii = (0.94 * scene.canvas.lengths(scene.tracks.radius)).astype(np.float32)
        clock.start()
        for each, top in zip(self._maps, self._tops, strict=True):
            clock.stream.log(
                f"{entities.KINEMATIC_MAPS}/{each.name}",
                rr.Points2D(points, radii=radii, colors=each.colours(each.value[k], top), draw_order=5.0),
            )
        known = np.isfinite(found.fluctuation[k]).all(axis=1) & np.isfinite(place).all(axis=1)
        start = scene.canvas.points(place[known])
        end = scene.canvas.points(place[known] + self._stretch * found.fluctuation[k, known])
        member = found.in_band[k, known]
        clock.stream.log(
            entities.FLUCTUATIONS,
            rr.Arrows2D(
                origins=start.astype(np.float32), vectors=(end - start).astype(np.float32),
                radii=np.float32(0.08 * scene.canvas.grain_radius),
                colors=np.where(member, packed_one(SERIES[0]), packed_one(SERIES[1])).astype(np.uint32),
                draw_order=20.0,
            ),
        )  # fmt: skip
        clock.end()
        log_scalar(clock, entities.PARTICIPATION, float(found.participation[k]))
        solid = found.solid_fraction[k]
        mean = float(np.nanmean(solid)) if np.isfinite(solid).any() else np.nan
        log_scalar(clock, entities.SOLID_FRACTION, mean)
