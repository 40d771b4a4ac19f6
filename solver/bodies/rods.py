"""What all rods of a packing have in common, and the packing that rods of given radii make."""

from __future__ import annotations

from dataclasses import dataclass

from solver.bodies.grains import Array, Grains
from solver.bodies.packing import Material, Packing


@dataclass(frozen=True, slots=True)
class RodMaterial:
    """Rods of one material and one length; the defaults are aluminium rods of 6 cm."""

    density: float = 2700.0  # [kg/m³]
    length: float = 0.06  # [m]
    friction: float = 0.25
    wall_friction: float | None = None  # None: as friction
    formal_weight: float = 0.0  # η in [0, ½]
    gravity: tuple[float, float] = (0.0, 0.0)  # [m/s²]

    def at_walls(self) -> float:
        """The coefficient of friction at walls."""
        return self.friction if self.wall_friction is None else self.wall_friction

    def pack(self, radius: Array, pressure: Array) -> Packing:
        """Make a packing of rods of radius (n,) [m]; pressure (w,) [Pa] on walls, NaN where motion is imposed."""
        return Packing(
            Grains.of_rods(radius, density=self.density, length=self.length),
            self.length,
            Material(self.friction, self.at_walls(), self.formal_weight, self.gravity),
            pressure,
        )
