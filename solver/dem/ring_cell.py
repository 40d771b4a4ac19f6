"""A packing between two circles: a ring around it under a load, and a core inside it that is moved and rotated.

The ring is centred at the origin and does not rotate. Under its load it widens and narrows as a whole, so that the sum
of the normal forces on it is the load.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ..bodies.grains import Array, Grains
from ..bodies.wall_shapes import IN, OUT, circle_ends
from .boundaries import (
    CORE_RADIUS,
    CORE_ROTATION,
    CORE_X,
    CORE_Y,
    LOAD,
    RING,
    RING_RADIUS,
    RING_WALL,
    Boundary,
)
from .dem_truth import DemSettings
from .simulation import Simulation, plate_constants

CIRCLE_NAMES = ("ring", "core")
CIRCLE_SIDES = np.array([IN, OUT], np.int8)


class RingCell(Simulation):
    """A packing between ring and core; the pressure of the settings is that of the ring, NaN: it is driven.

    Columns of the drive: velocity of the core (x, y) [m/s], its spin [rad/s], and the rate of the ring's radius [m/s],
    ignored where the ring is under load.
    """

    drive_columns: ClassVar[int] = 4

    def __init__(
        self,
        radius: Array,
        position: Array,
        *,
        ring: float,
        core: float,
        settings: DemSettings,
        core_place: tuple[float, float] = (0.0, 0.0),
        drag: float = 0.0,
    ) -> None:
        """Place grains between two circles.

        Parameters
        ----------
        radius : (n,)
            Radii [m].
        position : (n, 2)
            Centres [m].
        ring, core
            Radii of the circles [m].
        settings
            Material, load and numerics.
        core_place
            Centre of the core [m].
        drag
            Damping rate of every grain [1/s], for the preparation of a packing only.

        Raises
        ------
        ValueError
            The settings have rolling friction.
        """
        if settings.rolling_friction > 0.0:
            raise ValueError("a packing between circles has no rolling friction: set rolling_friction to 0")
        grains = Grains.of_rods(radius, density=settings.density, length=settings.length)
        face = 2.0 * np.pi * ring
        plates = np.array([
            plate_constants(grains, settings, face, settings.pressure * face * settings.length),
            plate_constants(grains, settings, ring, np.nan),
        ])  # fmt: skip
        boundary = Boundary(RING, np.array([ring, 0.0, core, *core_place, 0.0]), plates, np.zeros(4))
        super().__init__(grains, position, boundary, settings=settings, drag=drag)

    @property
    def shear(self) -> float:
        """Zero: circles have no shear angle."""
        return 0.0

    @property
    def ring(self) -> float:
        """Radius of the ring [m]."""
        return float(self._boundary.state[RING_RADIUS])

    @property
    def core_place(self) -> tuple[float, float]:
        """Centre of the core [m]."""
        return float(self._boundary.state[CORE_X]), float(self._boundary.state[CORE_Y])

    @property
    def endpoints(self) -> Array:
        """Diameters of ring and core (2, 2, 2) [m]."""
        state = self._boundary.state
        centre = np.array([[0.0, 0.0], [state[CORE_X], state[CORE_Y]]])
        return circle_ends(centre, state[[RING_RADIUS, CORE_RADIUS]], np.array([0.0, state[CORE_ROTATION]]))

    @property
    def area(self) -> float:
        """Area between the circles [m²]."""
        return np.pi * (self.ring**2 - self._boundary.state[CORE_RADIUS] ** 2)

    @property
    def plate_unbalance(self) -> float:
        """|sum of the normal forces on the ring − load| / load; zero without a load."""
        return self._load_residual(0, RING_WALL)

    def press(self) -> None:
        """Load the ring with the pressure of the settings on its present circumference."""
        face = 2.0 * np.pi * self.ring
        self._boundary.plates[0, LOAD] = self.settings.pressure * face * self.settings.length

    def move_core(self, displacement: tuple[float, float], rotation: float = 0.0) -> None:
        """Move the core by a displacement [m] and a rotation [rad], smoothly, below the greatest inertial number."""
        core = self._boundary.state[CORE_RADIUS]
        strain = max(float(np.hypot(*displacement)), abs(rotation) * core) / self.ring
        self._move(np.array([*displacement, rotation, 0.0]), strain)

    def _wall_distance(self, position: Array) -> Array:
        state = self._boundary.state
        away = np.linalg.norm(position - state[[CORE_X, CORE_Y]], axis=1)
        return np.column_stack([state[RING_RADIUS] - np.linalg.norm(position, axis=1), away - state[CORE_RADIUS]])
