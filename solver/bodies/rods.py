"""Material and length of the rods, and the packing of rods of given radii."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from .grains import Array, Grains
from .packing import Material, Packing

EARTH_GRAVITY = 9.81  # [m/s²]


@dataclass(frozen=True, slots=True)
class RodMaterial:
    """Rods of one material and one length; the defaults are aluminium rods of 6 cm."""

    density: float = 2700.0  # [kg/m³]
    length: float = 0.06  # [m]
    friction: float = 0.25
    wall_friction: float | None = None  # None: as friction
    formal_weight: float = 0.0  # η in [0, ½]
    gravity: tuple[float, float] = (0.0, 0.0)  # [m/s²]
    base_friction: float = 0.0  # coefficient between the rods and the base on which they slide
    base_gravity: float = EARTH_GRAVITY  # [m/s²] normal to the picture
    base_friction_measured: bool = False  # True: estimated from the motion
    friction_measured: bool = False  # True: `friction` is an initial guess, estimated from the motion
    stiffness: float | Literal["rigid", "estimate"] | None = (
        None  # [Pa] contact stiffness per length; None: estimated from the gaps where they show it
    )

    def at_walls(self) -> float:
        """Return the coefficient of friction at walls."""
        return self.friction if self.wall_friction is None else self.wall_friction

    def friction_law(self) -> Material:
        """Return friction, formal weight and gravity as `Material`."""
        return Material(
            self.friction, self.at_walls(), self.formal_weight, self.gravity, self.base_friction * self.base_gravity
        )

    def pack(
        self, radius: Array, pressure: Array, inferred: int = 0, boundary: NDArray[np.bool_] | None = None
    ) -> Packing:
        """Make a packing of rods.

        Parameters
        ----------
        radius : (n,)
            Radii [m].
        pressure : (w,)
            Pressure on walls [Pa], NaN where the motion is imposed.
        inferred
            Number of rods that no photograph shows.
        boundary : (n,) bool, optional
            Rods whose motion is imposed.
        """
        return Packing(
            Grains.of_rods(radius, density=self.density, length=self.length, boundary=boundary),
            self.length,
            self.friction_law(),
            pressure,
            inferred,
        )
