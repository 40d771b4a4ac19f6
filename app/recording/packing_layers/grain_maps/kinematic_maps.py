"""Writes the kinematics of every frame: maps of the rods, fluctuations as arrows, and curves."""

from __future__ import annotations

import numpy as np
import rerun as rr

from ....solver.kinematics.sequence_kinematics import SequenceKinematics
from ...look import entities
from ...look.clock import Clock
from ...look.colours import SERIES, packed_one
from ...look.scene import Scene
from ...look.values import log_scalar
from ..grains_and_walls import last_seen
from .grain_map import GrainMap, usual_top

ARROW = 2.0  # length of the rms fluctuation, in mean radii
MICRO = 1e6


class KinematicMaps:
    """Maps and curves of the kinematics of one run."""

    def __init__(self, scene: Scene, found: SequenceKinematics) -> None:
        self._scene, self._found = scene, found
        self._maps = tuple(
            GrainMap(
                f"{entities.KINEMATIC_MAPS}/{name}", f"{entities.KINEMATIC_LEGENDS}/{name}", value, unit,
                usual_top(value), ramp,
            )
            for name, value, unit, ramp in (
                (entities.LOCAL_SHEAR, found.shear_strain, "", "size"),
                (entities.D2MIN, MICRO * np.sqrt(found.d2min), " µm", "size"),
                (entities.LOCAL_ROTATION, np.degrees(found.rotation), "°", "difference"),
            )
        )  # fmt: skip
        size = np.sum(found.fluctuation**2, axis=2)
        rms = float(np.sqrt(np.nanmean(size))) if np.isfinite(size).any() else 0.0
        self._stretch = ARROW * float(scene.tracks.radius.mean()) / rms if rms > 0.0 else 0.0

    def log_styles(self, stream: rr.RecordingStream) -> None:
        """Log legends and the names of the curves."""
        for each in self._maps:
            each.log_legend(stream, self._scene)
        for path, name, colour in (
            (entities.PARTICIPATION, "participation of the local shear", SERIES[0]),
            (entities.SOLID_FRACTION, "mean local solid fraction", SERIES[1]),
        ):
            stream.log(path, rr.SeriesLines(colors=[colour], names=name, widths=2.0), static=True)

    def log(self, clock: Clock) -> None:
        """Log the maps and curves of one frame."""
        scene, found, k = self._scene, self._found, clock.frame
        place = last_seen(scene.tracks.position, k)
        clock.start()
        for each in self._maps:
            each.log(clock, scene)
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
