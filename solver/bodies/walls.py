"""Walls: straight segments or circles whose motion is imposed, or plates under a load.

A straight wall is directed: the packing lies to the LEFT of endpoint 0 → endpoint 1. The endpoints of a circular wall
are the ends of a diameter that rotates with it, which give its centre, radius and rotation.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float, Int8, Int32
from numpy.typing import NDArray

from .cell import Cell
from .grains import Array
from .wall_shapes import STRAIGHT, NearestEnds, Sides, all_sides, nearest_ends, wall_distance

PARALLEL = 0.1  # sine of the angle between two walls below which they do not bound each other
BEYOND_END = 0.2  # of a wall's length: so far beyond its ends it still bounds another one
ON_FACE = 1.0 - 1e-9  # cosine of the angle between the normals of a contact and of its wall: less at an end of the wall
NEGLIGIBLE_OVERHANG = 1e-3  # of the length: within the precision of ends


@dataclass(frozen=True, slots=True)
class Walls:
    """The walls at one instant.

    The tangential motion of every wall is imposed. Along its normal either the motion is imposed too (`load` is NaN),
    or the wall is a rigid plate, free along its normal and pressed against the packing by `load`. A circle under load
    changes its radius freely; its load is the sum of the normal forces on it. A wall that is fixed to a plate, such as
    a corner disc, moves with it: free along the plate's normal, it carries part of the plate's load.
    """

    endpoints: Float[Array, "w 2 2"]  # [m], wall, end, (x, y)
    velocity: Float[Array, "w 2 2"]  # [m/s], of the endpoints
    load: Float[Array, " w"]  # [N], NaN where the normal motion is imposed
    side: Int8[np.ndarray, " w"] | None = None  # STRAIGHT, or a circle's: IN, OUT; None: all straight
    cell: Cell | None = None  # periodic cell in place of walls
    plate: Int32[np.ndarray, " w"] | None = None  # loaded wall that it is fixed to, −1: none; None: none is fixed

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
        cls,
        endpoints: Array,
        load: Array | None = None,
        side: Sides = None,
        cell: Array | None = None,
        plate: NDArray[np.int32] | None = None,
    ) -> Walls:
        """Make walls (w, 2, 2) [m] at rest, with loads (w,) [N] if given; cell: its vectors (2, 2) [m]."""
        load = np.full(len(endpoints), np.nan) if load is None else load
        return cls(endpoints, np.zeros_like(endpoints), load, side, None if cell is None else Cell.at_rest(cell), plate)

    @property
    def count(self) -> int:
        return len(self.load)

    @property
    def sides(self) -> NDArray[np.int8]:
        """Shape of every wall (w,): STRAIGHT, or a circle with the packing inside (IN) or outside (OUT)."""
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
        """Length of the surface of every wall that rods can touch (w,) [m].

        Of a circle the circumference; of a segment the part between its neighbours, which it may overhang.
        """
        return np.where(self.curved, np.pi * self.length, self.length - self._overhang())

    def _overhang(self) -> Array:
        """Length of every segment that lies outside of the walls crossing it (w,) [m]."""
        return _overhang(self.endpoints.tobytes(), self.curved.tobytes())

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
        """Unit normal out of the packing (w, 2), the contact normal of a grain on this wall; NaN of a circle."""
        d = self.direction
        return np.where(self.curved[:, None], np.nan, np.stack([d[:, 1], -d[:, 0]], axis=1))

    @property
    def loaded(self) -> NDArray[np.bool_]:
        """Which walls are plates under load (w,)."""
        return np.isfinite(self.load)

    @property
    def carrier(self) -> NDArray[np.int32]:
        """Return the plate under load that every wall belongs to (w,), itself or another; −1: its motion is imposed."""
        own = np.where(self.loaded, np.arange(self.count), -1).astype(np.int32)
        if self.plate is None:
            return own
        other = np.append(own, np.int32(-1))[self.plate]
        return np.where(self.loaded, own, other).astype(np.int32)

    def plate_components(self, wall: NDArray[np.integer], normal: Array) -> tuple[NDArray[np.int32], Array, Array]:
        """Return how forces on walls act on the free motion of their plates.

        Parameters
        ----------
        wall : (c,)
            Walls of contacts.
        normal : (c, 2)
            Contact normals, out of the packing.

        Returns
        -------
        plate : (c,)
            Carrier of each wall; the wall itself where its motion is imposed.
        along_normal, along_tangent : (c,)
            n·p and t·p, with p the outward normal of the plate: 1 and 0 on its face, also on a circle under load.
        """
        carrier = self.carrier[wall]
        plate = np.where(carrier >= 0, carrier, wall).astype(np.int32)
        outward = self.outward[plate]
        at_end = ~self.curved[plate] & (np.einsum("ij,ij->i", normal, outward) < ON_FACE)
        fixed = (carrier >= 0) & ((carrier != wall) | at_end)
        along_normal = np.where(fixed, np.einsum("ij,ij->i", normal, outward), 1.0)
        along_tangent = np.where(fixed, normal[:, 0] * outward[:, 1] - normal[:, 1] * outward[:, 0], 0.0)
        return plate, along_normal, along_tangent

    def distance(self, wall: NDArray[np.integer], place: Array) -> tuple[Array, Array]:
        """Return distances (c,) [m] of points (c, 2) [m] from walls (c,), and outward normals; see `wall_distance`."""
        return wall_distance(self.endpoints[wall], None if self.side is None else self.side[wall], place)

    def nearest_ends(self, wall: NDArray[np.integer], place: Array, radius: Array) -> NearestEnds:
        """Return the ends of walls (c,) nearest to grains at places (c, 2) [m]; see `wall_shapes.nearest_ends`."""
        return nearest_ends(self.endpoints[wall], None if self.side is None else self.side[wall], place, radius)

    def velocity_at(self, wall: NDArray[np.int32], point: Array) -> Array:
        """Return the velocity (c, 2) [m/s] of walls (c,) at points (c, 2) [m].

        A segment moves linearly between its endpoints. A circle moves by the similarity transformation of its diameter,
        widening included.
        """
        start, end = self.endpoints[wall, 0], self.endpoints[wall, 1]
        along = end - start
        square = np.einsum("ij,ij->i", along, along)
        s = np.einsum("ij,ij->i", point - start, along) / square
        v0, v1 = self.velocity[wall, 0], self.velocity[wall, 1]
        velocity = v0 + s[:, None] * (v1 - v0)
        if self.side is not None:
            offset = (along[:, 0] * (point - start)[:, 1] - along[:, 1] * (point - start)[:, 0]) / square
            rotated = np.stack([-(v1 - v0)[:, 1], (v1 - v0)[:, 0]], axis=1)
            velocity += np.where(self.curved[wall], offset, 0.0)[:, None] * rotated
        return velocity


@lru_cache(maxsize=16)  # the walls of a frame are made many times
def _overhang(endpoints: bytes, curved: bytes) -> Array:
    """Length of every segment that lies outside of the walls crossing it (w,) [m]; of walls (w, 2, 2) [m] and (w,)."""
    ends, count = np.frombuffer(endpoints).reshape(-1, 2, 2), len(curved)
    start, vector = ends[:, 0], ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(vector, axis=1)
    along = vector / length[:, None]
    straight = np.flatnonzero(~np.frombuffer(curved, np.bool_))
    begin, end = np.zeros(count), length.copy()
    for w in straight.tolist():
        for v in straight.tolist():
            crossing = along[v, 0] * along[w, 1] - along[v, 1] * along[w, 0]
            if v == w or abs(crossing) < PARALLEL:
                continue
            apart = start[w] - start[v]
            here = -(along[v, 0] * apart[1] - along[v, 1] * apart[0]) / crossing  # [m] along w
            there = (along[w, 1] * apart[0] - along[w, 0] * apart[1]) / crossing  # [m] along v
            if not (0.0 < here < length[w] and abs(there / length[v] - 0.5) < 0.5 + BEYOND_END):
                continue
            # the packing is to the left of v: towards the end of w, or towards its beginning
            if crossing > 0.0:
                begin[w] = max(begin[w], here)
            else:
                end[w] = min(end[w], here)
    overhang = length - (end - begin)
    return np.where((end > begin) & (overhang > NEGLIGIBLE_OVERHANG * length), overhang, 0.0)
