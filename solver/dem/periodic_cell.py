"""A packing in a periodic cell under simple shear at constant pressure: the truth of experiments without walls.

The rods move with the cell, as in the simple shear of Lees & Edwards, and relative to it; b shears along a. The cell
changes its size isotropically until half the trace of the stress is the required pressure.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ..bodies.cell import Cell
from ..bodies.grains import Array, Grains
from .boundaries import AX, BX, BY, CELL, CELL_PRESSURE, Boundary
from .dem_truth import DemSettings
from .simulation import Simulation

RESPONSE = 300.0  # steps in which the servo removes a difference of pressure, if the packing were a solid
GREATEST_STRAIN = 3e-6  # of a step, by the servo
PRESSURE_TOLERANCE = 1e-3  # relative difference of pressure at rest


class PeriodicCell(Simulation):
    """A packing in a periodic cell. Column of the drive: shear rate [1/s]."""

    drive_columns: ClassVar[int] = 1

    def __init__(
        self, radius: Array, position: Array, vectors: Array, *, settings: DemSettings, drag: float = 0.0
    ) -> None:
        """Place grains of radius (n,) [m] at position (n, 2) [m] in a cell of vectors (2, 2) [m], at rest.

        drag [1/s] slows every grain: for the preparation of a packing only.

        Raises
        ------
        ValueError
            The settings have gravity or friction of a base.
        """
        if any(settings.gravity) or settings.base_drag > 0.0:
            raise ValueError("a periodic cell has neither gravity nor a base: set gravity and base_drag to 0")
        grains = Grains.of_rods(radius, density=settings.density, length=settings.length)
        boundary = Boundary(CELL, np.array([*np.ravel(vectors), 0.0, 0.0], np.float64), np.zeros((2, 3)), np.zeros(4))
        super().__init__(grains, position, boundary, settings=settings, drag=drag)
        bulk = settings.normal_stiffness / settings.length  # [Pa] about the bulk modulus of a dense packing
        boundary.servo[:] = (
            settings.pressure, RESPONSE * self.time_step * bulk, GREATEST_STRAIN / self.time_step, settings.length
        )  # fmt: skip

    @property
    def vectors(self) -> Array:
        """Vectors a and b of the cell (2, 2) [m]."""
        return self._boundary.state[AX : BY + 1].reshape(2, 2).copy()

    @property
    def endpoints(self) -> Array:
        """No walls (0, 2, 2)."""
        return np.empty((0, 2, 2))

    @property
    def area(self) -> float:
        """Area of the cell [m²]."""
        return Cell.at_rest(self.vectors).area

    @property
    def pressure(self) -> float:
        """Half the trace of the stress of the normal forces in the last step [Pa]."""
        return float(self._boundary.state[CELL_PRESSURE])

    @property
    def plate_unbalance(self) -> float:
        """|pressure − required pressure| over the required pressure."""
        return abs(self.pressure / self.settings.pressure - 1.0)

    @property
    def plate_tolerance(self) -> float:
        """Greatest relative difference of pressure at rest."""
        return PRESSURE_TOLERANCE

    @property
    def shear(self) -> float:
        """Displacement of b along a over its height."""
        return float(self._boundary.state[BX] / self._boundary.state[BY])

    def shear_to(self, shear: float) -> None:
        """Move the cell to a shear, smoothly, below the greatest inertial number."""
        displacement = shear - self.shear
        self._move(np.array([displacement]), abs(displacement))

    def _pair_neighbours(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        position, radius, cell = self.position, self.grains.radius, Cell.at_rest(self.vectors)
        reach = 2.0 * radius.max() + self._skin
        points, owner = cell.with_images(position, reach)
        found = owner[KDTree(points).query_pairs(reach, output_type="ndarray")]
        key = np.unique(found.min(axis=1) * len(radius) + found.max(axis=1))
        i, j = key // len(radius), key % len(radius)
        apart = position[j] - position[i]
        shift = cell.shift(apart)
        near = (np.linalg.norm(apart + shift, axis=1) < radius[i] + radius[j] + self._skin) & (i < j)
        return i[near], j[near], np.rint(shift[near] @ np.linalg.inv(cell.vectors)).astype(np.int64)

    def _wall_distance(self, position: Array) -> Array:
        return np.empty((len(position), 0))
