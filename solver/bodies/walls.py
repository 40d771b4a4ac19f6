"""Walls: straight segments whose motion is imposed, or plates that carry a load.

A wall is directed: the packing lies to the LEFT of endpoint 0 → endpoint 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from solver.bodies.grains import Array


@dataclass(frozen=True, slots=True)
class Walls:
    """The walls at one instant.

    Every wall has its tangential motion imposed. Along its normal either the motion is
    imposed too (`load` is NaN), or the wall is a rigid plate, free along its normal, that
    is pressed against the packing by `load`.
    """

    endpoints: Float[Array, "w 2 2"]  # [m], wall, end, (x, y)
    velocity: Float[Array, "w 2 2"]  # [m/s], of the endpoints
    load: Float[Array, " w"]  # [N], NaN where the normal motion is imposed

    def __post_init__(self) -> None:
        w = len(self.load)
        if self.endpoints.shape != (w, 2, 2) or self.velocity.shape != (w, 2, 2):
            raise ValueError("endpoints (w, 2, 2), velocity (w, 2, 2) and load (w,) must agree in w")
        if w and not np.all(self.length > 0):
            raise ValueError("a wall has no length: its two endpoints coincide")

    @classmethod
    def at_rest(cls, endpoints: Array, load: Array | None = None) -> Walls:
        """Walls (w, 2, 2) [m] that do not move, under loads (w,) [N] if there are any."""
        load = np.full(len(endpoints), np.nan) if load is None else load
        return cls(endpoints, np.zeros_like(endpoints), load)

    @property
    def count(self) -> int:
        return len(self.load)

    @property
    def length(self) -> Array:
        """Length of every segment (w,) [m]."""
        return np.linalg.norm(self.endpoints[:, 1] - self.endpoints[:, 0], axis=1)

    @property
    def direction(self) -> Array:
        """Unit vector from endpoint 0 to endpoint 1 (w, 2)."""
        return (self.endpoints[:, 1] - self.endpoints[:, 0]) / self.length[:, None]

    @property
    def outward(self) -> Array:
        """Unit normal that points out of the packing (w, 2): the contact normal of a grain on this wall."""
        d = self.direction
        return np.stack([d[:, 1], -d[:, 0]], axis=1)

    @property
    def loaded(self) -> NDArray[np.bool_]:
        """Which walls are plates under load (w,)."""
        return np.isfinite(self.load)

    def velocity_at(self, wall: NDArray[np.int32], point: Array) -> Array:
        """Velocity of wall `wall` (c,) at `point` (c, 2) [m], rigid motion between its endpoints (c, 2) [m/s]."""
        start, end = self.endpoints[wall, 0], self.endpoints[wall, 1]
        along = end - start
        s = np.einsum("ij,ij->i", point - start, along) / np.einsum("ij,ij->i", along, along)
        v0, v1 = self.velocity[wall, 0], self.velocity[wall, 1]
        return v0 + s[:, None] * (v1 - v0)
