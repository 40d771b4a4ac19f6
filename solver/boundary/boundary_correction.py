"""Corrections of the boundary of a sequence, in the order in which they are applied."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array
from ..calibration.gaps import MeasuredSequence
from ..part_settings import BoundarySettings
from ..quantity import Quantity
from .bars import Bars, find_wall_bars
from .camera_pose import CameraPose, find_camera_pose
from .continuation import continue_walls, extend_walls


@dataclass(frozen=True, slots=True)
class Boundary:
    """Corrections of the given walls."""

    bars: Bars
    camera: CameraPose
    extension: Annotated[
        Array,
        Quantity(
            "length by which a wall continues beyond its end", "m", "wall end", since=2, path="boundary/beyond",
        ),
    ]  # fmt: skip

    def describe(self, walls: tuple[str, ...]) -> list[str]:
        """Describe the corrections in sentences for the user."""
        sentences = []
        for w in np.flatnonzero(self.bars.corner & (self.bars.stretch > 0.0)):
            if np.isnan(self.bars.end_fraction[w]):
                sentences.append(
                    f"the ends of wall {walls[w]!r} are corners whose hinge is unknown: too few rods touch it, so that "
                    "its sliding past them is set to their mean"
                )
                continue
            sentences.append(
                f"the ends of wall {walls[w]!r} are corners: its given length changes by "
                f"{100 * self.bars.stretch[w]:.2g} %, and the bar slides past them by up to "
                f"{1e6 * np.abs(self.bars.slip[:, w]).max():.0f} µm per photograph"
            )
        for w, end in np.argwhere(self.extension > 0.0):
            sentences.append(
                f"wall {walls[w]!r} continues {1e3 * self.extension[w, end]:.1f} mm beyond its end {end + 1}: "
                "rods touch its line there"
            )
        if self.camera.applied:
            size = 1e6 * float(np.sqrt(np.mean(np.sum(self.camera.shift**2, axis=1))))
            sentences.append(f"the camera moves relative to the walls by {size:.0f} µm rms between photographs")
        return sentences


def correct_boundary(
    sequence: MeasuredSequence, noise: float, end_kind: NDArray[np.int8], settings: BoundarySettings
) -> tuple[MeasuredSequence, Boundary]:
    """Extend walls that are too short, replace corners by points of bars, and subtract the camera's motion.

    Parameters
    ----------
    sequence : MeasuredSequence
    noise : float
        Standard deviation [m] of an end of a wall along it.
    end_kind : int array (w,)
        Kind of each wall's ends, as for `find_wall_bars`.
    settings : BoundarySettings

    Returns
    -------
    sequence : MeasuredSequence
        The corrected sequence.
    boundary : Boundary
        The corrections.
    """
    extension = continue_walls(sequence) if settings.continued else np.zeros((sequence.wall_count, 2))
    bars, points = find_wall_bars(sequence, noise, end_kind)
    corrected = replace(sequence, endpoints=extend_walls(points, extension))
    camera = find_camera_pose(corrected) if settings.camera else CameraPose.unknown(sequence.frame_count)
    if camera.applied:
        position = camera.correct(sequence.position)
        corrected = replace(corrected, position=position, rotation=sequence.rotation - camera.rotation[:, None])
        # The corners' sliding follows more accurately from the corrected positions.
        bars, points = find_wall_bars(replace(corrected, endpoints=sequence.endpoints), noise, end_kind)
        corrected = replace(corrected, endpoints=extend_walls(points, extension))
    return corrected, Boundary(bars, camera, extension)
