"""What does not change from frame to frame: the grains, their material, their length, the loads on the walls."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from solver.bodies.grains import Array, Grains
from solver.bodies.walls import Walls


@dataclass(frozen=True, slots=True)
class Material:
    friction: float
    wall_friction: float
    formal_weight: float = 0.0  # η in [0, ½]
    gravity: tuple[float, float] = (0.0, 0.0)  # [m/s²]

    def __post_init__(self) -> None:
        if self.friction < 0 or self.wall_friction < 0:
            raise ValueError("a coefficient of friction cannot be negative")
        if not 0.0 <= self.formal_weight <= 0.5:
            raise ValueError(f"the formal weight lies in [0, 0.5], not at {self.formal_weight}")

    def friction_at(self, with_wall: NDArray[np.bool_]) -> Array:
        """Coefficient of friction of contacts with a wall or between grains (c,)."""
        return np.where(with_wall, self.wall_friction, self.friction)


@dataclass(frozen=True, slots=True)
class Packing:
    """What does not change from frame to frame."""

    grains: Grains
    length: float  # [m] of the rods
    material: Material
    pressure: Float[Array, " w"]  # [Pa] on plates, NaN where the motion is imposed

    @property
    def weight(self) -> Array:
        """Weight of every grain (n, 2) [N]."""
        return self.grains.weight(self.material.gravity)

    def load(self, endpoints: Array) -> Array:
        """Load on every wall (w,) [N] of given endpoints (w, 2, 2) [m]."""
        return self.pressure * np.linalg.norm(endpoints[:, 1] - endpoints[:, 0], axis=1) * self.length

    def walls(self, endpoints: Array) -> Walls:
        """The walls at rest at these endpoints (w, 2, 2) [m], under their loads."""
        return Walls.at_rest(endpoints, self.load(endpoints))
