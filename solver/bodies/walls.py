"""Walls: straight segments or circles whose motion is imposed, or plates that carry a load.

A straight wall is directed: the packing lies to the LEFT of endpoint 0 → endpoint 1. The endpoints of a circular one
are the ends of a diameter that turns with it: centre, radius and rotation in the same four numbers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int8
from numpy.typing import NDArray

from solver.bodies.cell import Cell
from solver.bodies.grains import Array
from solver.bodies.wall_shapes import STRAIGHT, Sides, all_sides, reach_of_wall


@dataclass(frozen=True, slots=True)
class Walls:
    """The walls at one instant.

    Every wall has its tangential motion imposed. Along its normal either the motion is
    imposed too (`load` is NaN), or the wall is a rigid plate, free along its normal, that
    is pressed against the packing by `load`. A circle under load is free to widen: its load is the sum of the normal
    forces on it.
    """

    endpoints: Float[Array, "w 2 2"]  # [m], wall, end, (x, y)
    velocity: Float[Array, "w 2 2"]  # [m/s], of the endpoints
    load: Float[Array, " w"]  # [N], NaN where the normal motion is imposed
    side: Int8[np.ndarray, " w"] | None = None  # STRAIGHT, or a circle's: IN, OUT; None: all straight
    cell: Cell | None = None  # the packing goes on beyond its edges; there are no walls then

    def __post_init__(self) -> None:
        w = len(self.load)
        if self.endpoints.shape != (w, 2, 2) or self.velocity.shape != (w, 2, 2):
            raise ValueError("endpoints (w, 2, 2), velocity (w, 2, 2) and load (w,) must agree in w")
        if self.side is not None and self.side.shape != (w,):
            raise ValueError(f"side must be ({w},), not {self.side.shape}")
        if w and not np.all(self.length > 0):
            raise ValueError("a wall has no length: its two endpoints coincide")

    @classmethod
    def at_rest(
        cls, endpoints: Array, load: Array | None = None, side: Sides = None, cell: Array | None = None
    ) -> Walls:
        """Walls (w, 2, 2) [m] that do not move, under loads (w,) [N] if there are any; cell: its vectors (2, 2) [m]."""
        load = np.full(len(endpoints), np.nan) if load is None else load
        return cls(endpoints, np.zeros_like(endpoints), load, side, None if cell is None else Cell.at_rest(cell))

    @property
    def count(self) -> int:
        return len(self.load)

    @property
    def sides(self) -> NDArray[np.int8]:
        """What each wall is (w,): STRAIGHT, or a circle with the packing IN or OUT of it."""
        return all_sides(self.side, self.count)

    @property
    def curved(self) -> NDArray[np.bool_]:
        """Which walls are circles (w,)."""
        return self.sides != STRAIGHT

    @property
    def length(self) -> Array:
        """Length of every segment, diameter of every circle (w,) [m]."""
        return np.linalg.norm(self.endpoints[:, 1] - self.endpoints[:, 0], axis=1)

    @property
    def face(self) -> Array:
        """Length along which the packing meets every wall: that of a segment, or a circumference (w,) [m]."""
        return np.where(self.curved, np.pi, 1.0) * self.length

    @property
    def centre(self) -> Array:
        """Middle of every segment, centre of every circle (w, 2) [m]."""
        return self.endpoints.mean(axis=1)

    @property
    def direction(self) -> Array:
        """Unit vector from endpoint 0 to endpoint 1 (w, 2)."""
        return (self.endpoints[:, 1] - self.endpoints[:, 0]) / self.length[:, None]

    @property
    def outward(self) -> Array:
        """Unit normal that points out of the packing (w, 2): the contact normal of a grain on this wall.

        NaN of a circle, where it depends on the place: `reach` gives it.
        """
        d = self.direction
        return np.where(self.curved[:, None], np.nan, np.stack([d[:, 1], -d[:, 0]], axis=1))

    @property
    def loaded(self) -> NDArray[np.bool_]:
        """Which walls are plates under load (w,)."""
        return np.isfinite(self.load)

    def reach(self, wall: NDArray[np.integer], place: Array) -> tuple[Array, Array]:
        """Distance (c,) [m] of places (c, 2) [m] from walls (c,), negative beyond them, and outward normals (c, 2)."""
        return reach_of_wall(self.endpoints[wall], None if self.side is None else self.side[wall], place)

    def velocity_at(self, wall: NDArray[np.int32], point: Array) -> Array:
        """Velocity of wall `wall` (c,) at `point` (c, 2) [m], rigid motion between its endpoints (c, 2) [m/s].

        A circle also widens with its radius: its points move by the similarity that moves the diameter.
        """
        start, end = self.endpoints[wall, 0], self.endpoints[wall, 1]
        along = end - start
        square = np.einsum("ij,ij->i", along, along)
        s = np.einsum("ij,ij->i", point - start, along) / square
        v0, v1 = self.velocity[wall, 0], self.velocity[wall, 1]
        velocity = v0 + s[:, None] * (v1 - v0)
        if self.side is not None:
            off = (along[:, 0] * (point - start)[:, 1] - along[:, 1] * (point - start)[:, 0]) / square
            turned = np.stack([-(v1 - v0)[:, 1], (v1 - v0)[:, 0]], axis=1)
            velocity += np.where(self.curved[wall], off, 0.0)[:, None] * turned
        return velocity
