"""A packing between two circles: a ring around it under a load, and a core in it that is pushed and turned.

The frame is that of a drum with a cylinder in it. The ring stays about the origin and does not turn; under its load
it widens and narrows as one, so that its normal forces together are the load.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.bodies.wall_shapes import IN, OUT, circle_ends
from solver.dem.kernels import LOAD
from solver.dem.ring_kernels import (
    CORE_RADIUS,
    CORE_TURN,
    CORE_X,
    CORE_Y,
    RING,
    RING_RADIUS,
    advance_between_circles,
)
from solver.dem.simulation import RAMP, ShearCell
from solver.dem.truth import DemSettings

CIRCLE_NAMES = ("ring", "core")
CIRCLE_SIDES = np.array([IN, OUT], np.int8)


class RingCell(ShearCell):
    """A packing between ring and core, advanced in time; the settings' pressure is the ring's, NaN: it is held."""

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
        """Place grains of radius (n,) [m] at position (n, 2) [m] between circles of radius `ring` and `core` [m].

        core_place [m]: its centre. drag [1/s] slows every grain: for the preparation of a packing only.
        """
        if settings.rolling_friction > 0.0:
            raise ValueError("circles know no rolling friction")
        face = 2.0 * np.pi * ring
        super().__init__(radius, position, width=face, height=ring, settings=settings, drag=drag)
        self._circles = np.array([ring, 0.0, core, *core_place, 0.0])

    @property
    def ring(self) -> float:
        """Radius of the ring [m]."""
        return float(self._circles[RING_RADIUS])

    @property
    def core_place(self) -> tuple[float, float]:
        """Centre of the core [m]."""
        return float(self._circles[CORE_X]), float(self._circles[CORE_Y])

    @property
    def endpoints(self) -> Array:
        """Diameters of ring and core (2, 2, 2) [m]."""
        circles = self._circles
        centre = np.array([[0.0, 0.0], [circles[CORE_X], circles[CORE_Y]]])
        return circle_ends(centre, circles[[RING_RADIUS, CORE_RADIUS]], np.array([0.0, circles[CORE_TURN]]))

    @property
    def pressure(self) -> float:
        """Half the trace of the stress that the normal forces carry [Pa]."""
        radius, pairs, walls = self.grains.radius, self._pairs, self._wall_pairs
        work = pairs.fn @ (radius[pairs.i] + radius[pairs.j]) + walls.fn @ radius[walls.i]
        area = np.pi * (self.ring**2 - self._circles[CORE_RADIUS] ** 2)
        return float(work) / (2.0 * area * self.settings.length)

    @property
    def plate_unbalance(self) -> float:
        """|sum of the normal forces on the ring − load| / load; zero where it has none."""
        load, walls = self._bodies.plates[0, LOAD], self._wall_pairs
        return 0.0 if np.isnan(load) else abs(float(walls.fn[walls.j == RING].sum()) - load) / load

    def run(self, drive: Array) -> None:
        """Take one time step per row of drive (steps, 4), or with all held where drive is (steps,).

        Columns: velocity of the core (x, y) [m/s], its spin [rad/s], and the ring's widening [m/s], which is passed
        over where it carries a load.
        """
        if drive.ndim == 1:
            drive = np.zeros((len(drive), 4))
        done = 0
        while done < len(drive):
            self._find_neighbours()
            done += advance_between_circles(
                self._bodies, self._pairs, self._wall_pairs, self._law, self._circles, drive[done:], self._skin
            )

    def press(self) -> None:
        """Load the ring with the settings' pressure on the face that it has at present."""
        face = 2.0 * np.pi * self.ring
        self._bodies.plates[0, LOAD] = self.settings.pressure * face * self.settings.length

    def move_core(self, way: tuple[float, float], turn: float = 0.0) -> None:
        """Push the core along a way [m] and turn it [rad], gently, never above the inertial number."""
        strain = max(float(np.hypot(*way)), abs(turn) * self._circles[CORE_RADIUS]) / self.ring
        fastest = self.settings.inertial_number / self.time_scale
        steps = max(20, int(np.ceil(strain / (fastest * self.time_step) / (1.0 - RAMP))))
        ramp = np.linspace(0.0, 1.0, int(RAMP * steps) + 1)
        profile = np.ones(steps)
        profile[: len(ramp)] = ramp
        profile[steps - len(ramp) :] = ramp[::-1]
        self.run(np.array([*way, turn, 0.0]) / self.time_step * profile[:, None] / profile.sum())

    def _distance(self, position: Array) -> Array:
        """Of places (n, 2) from both circles (n, 2) [m]."""
        circles = self._circles
        away = np.linalg.norm(position - circles[[CORE_X, CORE_Y]], axis=1)
        return np.column_stack([
            circles[RING_RADIUS] - np.linalg.norm(position, axis=1), away - circles[CORE_RADIUS]
        ])  # fmt: skip

    def _wall_neighbours(self, position: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        i, wall = np.nonzero(self._distance(position) < self.grains.radius[:, None] + self._skin)
        return i, wall
