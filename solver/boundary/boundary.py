"""What was found of the boundary of a sequence, in the order in which it is mended."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.bodies.quantity import Quantity
from solver.boundary.bars import Bars, find_bars
from solver.boundary.camera_pose import CameraPose, find_camera_pose
from solver.boundary.continuation import continue_walls, lengthen
from solver.calibration.gaps import MeasuredSequence


@dataclass(frozen=True, slots=True)
class BoundarySettings:
    """What may be wrong with the boundary."""

    camera: bool = True  # the camera may move against the walls
    continued: bool = True  # walls may be longer than they were told


@dataclass(frozen=True, slots=True)
class Boundary:
    """How the walls are, beside what was told of them."""

    bars: Bars
    camera: CameraPose
    beyond: Annotated[Array, Quantity("length by which a wall goes on beyond its end", "m", "wall end", since=2)]

    def describe(self, walls: tuple[str, ...]) -> list[str]:
        """Sentences on what was mended, for people."""
        said = []
        for w in np.flatnonzero(self.bars.corner):
            said.append(
                f"the ends of wall {walls[w]!r} are corners: its told length changes by "
                f"{100 * self.bars.stretch[w]:.2g} %, and the bar slides past them by up to "
                f"{1e6 * np.abs(self.bars.slip[:, w]).max():.0f} µm a photograph"
            )
        for w, end in np.argwhere(self.beyond > 0.0):
            said.append(
                f"wall {walls[w]!r} goes on {1e3 * self.beyond[w, end]:.1f} mm beyond its end {end + 1}: "
                "rods bear on it"
            )
        if self.camera.applied:
            size = 1e6 * float(np.sqrt(np.mean(np.sum(self.camera.shift**2, axis=1))))
            said.append(f"the camera moves against the walls by {size:.0f} µm rms from photograph to photograph")
        return said


def mend_boundary(
    sequence: MeasuredSequence, noise: float, told: NDArray[np.int8], settings: BoundarySettings
) -> tuple[MeasuredSequence, Boundary]:
    """Continue walls that are too short, take the camera's motion off, and make bars of corners.

    noise [m]: standard deviation of an end of a wall along it; told (w,): of each wall's ends, as `find_bars` takes it.
    """
    beyond = continue_walls(sequence) if settings.continued else np.zeros((sequence.wall_count, 2))
    bars, points = find_bars(sequence, noise, told)
    mended = replace(sequence, endpoints=lengthen(points, beyond))
    camera = find_camera_pose(mended) if settings.camera else CameraPose.unknown(sequence.frame_count)
    if camera.applied:
        position = camera.correct(sequence.position)
        mended = replace(mended, position=position, rotation=sequence.rotation - camera.turn[:, None])
        # Which corners slide, and how, is seen best from where the rods really are.
        bars, points = find_bars(replace(mended, endpoints=sequence.endpoints), noise, told)
        mended = replace(mended, endpoints=lengthen(points, beyond))
    return mended, Boundary(bars, camera, beyond)
