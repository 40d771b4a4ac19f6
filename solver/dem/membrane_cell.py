"""A packing between three straight walls and a membrane under pressure, as in a biaxial test.

The membrane is flexible, has no weight and bears no shear: it presses horizontally on whatever it meets first.
"""

from __future__ import annotations

import numpy as np

from ..bodies.grains import Array
from .boundaries import Boundary
from .dem_truth import DemSettings
from .shear_cell import FrameSize, ShearCell

FAR = 4.0  # width of the frame over that of the packing: its right side touches nothing
RAYS = 20  # horizontal lines within the smallest radius, on each of which the membrane meets one grain


class MembraneCell(ShearCell):
    """A packing whose right side is a membrane under the pressure of the settings; bottom and left side are at rest.

    The columns of the drive are those of a ShearCell.
    """

    def __init__(self, radius: Array, position: Array, frame: FrameSize, settings: DemSettings) -> None:
        """Place grains of radii (n,) and centres (n, 2) [m] in a frame [m]; the plate on top is driven."""
        super().__init__(radius, position, FrameSize(FAR * frame.width, frame.height, frame.span), settings)
        self.load(top=np.nan)

    @property
    def sides(self) -> None:
        """Shapes of the walls: all are straight."""
        return None

    @staticmethod
    def _flat_walls(boundary: Boundary) -> bool:
        return False  # the membrane follows the rods

    def _find_neighbours(self) -> None:
        super()._find_neighbours()
        width = membrane_width(self.position, self.grains.radius, self.height)
        self._bodies.external[:, 0] = -self.settings.pressure * self.settings.length * width


def membrane_width(position: Array, radius: Array, height: float) -> Array:
    """Return over which height (n,) [m] a membrane from the right meets each grain, between 0 and that of the plate.

    Parameters
    ----------
    position : (n, 2)
        Centres [m].
    radius : (n,)
        Radii [m].
    height : float
        Height of the plate [m].
    """
    spacing = float(radius.min()) / RAYS
    y = np.arange(0.5 * spacing, height, spacing)
    inside = radius[:, None] ** 2 - (y - position[:, 1, None]) ** 2
    surface = np.where(inside > 0.0, position[:, 0, None] + np.sqrt(np.maximum(inside, 0.0)), -np.inf)
    met = surface.argmax(axis=0)[np.isfinite(surface.max(axis=0))]
    return spacing * np.bincount(met, minlength=len(radius)).astype(np.float64)
