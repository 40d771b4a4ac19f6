"""What does not change from frame to frame: the grains, their material, their length, the loads on the walls."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from solver.bodies.grains import Array, Grains
from solver.bodies.motion import Snapshot
from solver.bodies.wall_shapes import Sides
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
    # [Pa] on plates, NaN where the motion is imposed; of a load that was measured, what it makes on average
    pressure: Float[Array, " w"]
    inferred: int = 0  # grains that no photograph shows

    @property
    def weight(self) -> Array:
        """Weight of every grain (n, 2) [N]."""
        return self.grains.weight(self.material.gravity)

    @property
    def scale_is_known(self) -> bool:
        """Whether loads or weight fix the scale of the forces; else they are known up to a factor."""
        return bool(np.isfinite(self.pressure).any() or any(self.material.gravity))

    def mean_pressure(self, snapshot: Snapshot) -> float:
        """Mean pressure of the plates as they are loaded at a snapshot [Pa]; 0 without one."""
        plates = np.isfinite(self.pressure)
        if snapshot.load is None or not plates.any():
            return float(self.pressure[plates].mean()) if plates.any() else 0.0
        walls = self.walls_of(snapshot)
        return float((walls.load[plates] / (walls.face[plates] * self.length)).mean())

    def load(self, endpoints: Array, side: Sides = None, measured: Array | None = None) -> Array:
        """Load on every wall (w,) [N] of given endpoints (w, 2, 2) [m].

        measured (w,) [N]: loads that were measured, which count instead of a pressure; NaN: none.
        """
        pressed = self.pressure * Walls.at_rest(endpoints, side=side).face * self.length
        return pressed if measured is None else np.where(np.isfinite(measured), measured, pressed)

    def walls(self, endpoints: Array, side: Sides = None, measured: Array | None = None) -> Walls:
        """The walls at rest at these endpoints (w, 2, 2) [m], under their loads."""
        return Walls.at_rest(endpoints, self.load(endpoints, side, measured), side)

    def walls_of(self, snapshot: Snapshot) -> Walls:
        """The walls of a snapshot at rest, under the loads that they carry there."""
        load = self.load(snapshot.endpoints, snapshot.side, snapshot.load)
        return Walls.at_rest(snapshot.endpoints, load, snapshot.side, snapshot.cell)
