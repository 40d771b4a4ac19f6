"""Writes the kinematics of every frame: maps of the rods, fluctuations as arrows, and curves."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import rerun as rr

from ....solver.bodies.grains import Array
from ....solver.kinematics.sequence_kinematics import SequenceKinematics
from ...look import entities
from ...look.clock import Clock
from ...look.colours import SERIES, packed_one
from ...look.ramp_legend import log_legend_texts
from ...look.scene import Scene
from ...look.values import log_curve_style, log_scalar
from ..grains_and_walls import last_seen
from .grain_map import GrainMap, usual_top

ARROW = 2.0  # length of the rms fluctuation, in mean radii
MICRO = 1e6
MAPS = (  # entity, unit, ramp
    (entities.LOCAL_SHEAR, "", "size"),
    (entities.D2MIN, " µm", "size"),
    (entities.LOCAL_ROTATION, "°", "difference"),
)


class KinematicMaps:
    """Maps and curves of the kinematics of one run, of which one frame is in memory.

    read: returns the kinematics of some frames.
    """

    def __init__(self, scene: Scene, read: Callable[[slice], SequenceKinematics | None]) -> None:
        self._scene, self._read = scene, read
        found = self._found(slice(None))
        self._maps = tuple(
            GrainMap(
                f"{entities.KINEMATIC_MAPS}/{name}", f"{entities.KINEMATIC_LEGENDS}/{name}", unit, usual_top(value),
                ramp,
            )
            for (name, unit, ramp), value in zip(MAPS, _displayed(found), strict=True)
        )  # fmt: skip
        size = np.sum(found.fluctuation**2, axis=2)
        rms = float(np.sqrt(np.nanmean(size))) if np.isfinite(size).any() else 0.0
        self._stretch = ARROW * float(scene.tracks.radius.mean()) / rms if rms > 0.0 else 0.0
        self._rms, self._band = rms, bool(found.in_band.any())

    def log_styles(self, stream: rr.RecordingStream) -> None:
        """Log legends and the names of the curves."""
        texts = [(0.5, f"arrows × {self._stretch:.3g}, rms {MICRO * self._rms:.3g} µm")] if self._stretch else []
        notes = [(0.5, "in a shear band", SERIES[0])] if self._band else []
        log_legend_texts(stream, self._scene.canvas, entities.FLUCTUATION_LEGEND, texts, notes)
        for each in self._maps:
            each.log_legend(stream, self._scene)
        for path, name, colour in (
            (entities.PARTICIPATION, "participation of the local shear", SERIES[0]),
            (entities.SOLID_FRACTION, "mean local solid fraction", SERIES[1]),
        ):
            log_curve_style(stream, path, name, colour)

    def log(self, clock: Clock) -> None:
        """Log the maps and curves of one frame."""
        scene, found, k = self._scene, self._found(slice(clock.frame, clock.frame + 1)), clock.frame
        place, fluctuation = last_seen(scene.tracks.position, k), found.fluctuation[0]
        clock.start()
        for each, value in zip(self._maps, _displayed(found), strict=True):
            each.log(clock, scene, value[0])
        known = np.isfinite(fluctuation).all(axis=1) & np.isfinite(place).all(axis=1)
        start = scene.canvas.points(place[known])
        end = scene.canvas.points(place[known] + self._stretch * fluctuation[known])
        member = found.in_band[0, known]
        clock.log(
            entities.FLUCTUATIONS,
            rr.Arrows2D(
                origins=start.astype(np.float32), vectors=(end - start).astype(np.float32),
                radii=np.float32(0.08 * scene.canvas.grain_radius),
                colors=np.where(member, packed_one(SERIES[0]), packed_one(SERIES[1])).astype(np.uint32),
                draw_order=20.0,
            ),
        )  # fmt: skip
        clock.end()
        log_scalar(clock, entities.PARTICIPATION, float(found.participation[0]))
        solid = found.solid_fraction[0]
        mean = float(np.nanmean(solid)) if np.isfinite(solid).any() else np.nan
        log_scalar(clock, entities.SOLID_FRACTION, mean)

    def _found(self, frames: slice) -> SequenceKinematics:
        found = self._read(frames)
        assert found is not None  # the run has kinematics
        return found


def _displayed(found: SequenceKinematics) -> tuple[Array, Array, Array]:
    """Return the quantities of MAPS (f, n)."""
    return found.shear_strain, MICRO * np.sqrt(found.d2min), np.degrees(found.rotation)
