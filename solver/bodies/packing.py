"""The packing: grains, material, rod length and wall pressures, constant over a sequence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from .grains import Array, Grains
from .motion import Snapshot
from .wall_shapes import Sides
from .walls import Walls

EXACT = 1e-12  # [m] floor of a displacement
NEAR = 0.1  # gap of a grain at a wall, over its radius, up to which it may bear part of the load
BASE_ARM = 2.0 / 3.0  # of a radius: greatest moment of a base over its friction, for a uniform pressure


@dataclass(frozen=True, slots=True)
class Material:
    """Friction, restitution weight and gravity, as the contact laws need them."""

    friction: float
    wall_friction: float
    formal_weight: float = 0.0  # η in [0, ½]
    gravity: tuple[float, float] = (0.0, 0.0)  # [m/s²]
    base_drag: float = 0.0  # [m/s²] friction coefficient of the base on which the grains slide × gravity onto it

    def __post_init__(self) -> None:
        if self.friction < 0 or self.wall_friction < 0:
            raise ValueError("a coefficient of friction cannot be negative")
        if not 0.0 <= self.formal_weight <= 0.5:
            raise ValueError(f"the formal weight must be in [0, 0.5], not {self.formal_weight}")

    def friction_at(self, with_wall: NDArray[np.bool_]) -> Array:
        """Return the coefficient of friction of contacts (c,), with a wall or between grains."""
        return np.where(with_wall, self.wall_friction, self.friction)


@dataclass(frozen=True, slots=True)
class Packing:
    """Quantities that are constant over a sequence."""

    grains: Grains
    length: float  # [m] of the rods
    material: Material
    # [Pa] on plates, NaN where the motion is imposed; of a measured load its mean over the frames
    pressure: Float[Array, " w"]
    inferred: int = 0  # number of grains that no photograph shows

    def at_frame(self, snapshots: Sequence[Snapshot], k: int) -> Packing:
        """Return the packing with the friction of the base on every grain in frame k; itself without a base.

        Notes
        -----
        F = −μ m g u / √(|u|² + 4 σ²), u the displacement since the frame before (of the first frame, until the next
        one) and σ the standard deviation of a position: what hardly moves has no direction of sliding. The base also
        resists the turning θ of a grain, by ⅔ μ m g R or less, the faster it slides: half of it is assumed, opposed to
        R θ as F is to u, and as much again is its standard deviation.
        """
        if self.material.base_drag == 0.0 or len(snapshots) < 2:
            return self
        before, after = (snapshots[k - 1], snapshots[k]) if k else (snapshots[0], snapshots[1])
        moved = np.nan_to_num(after.position - before.position)
        size = np.sqrt((moved**2).sum(axis=1) + 4.0 * snapshots[k].sigma ** 2)
        limit = self.material.base_drag * self.grains.mass
        drag = -limit[:, None] * moved / np.where(size > 0.0, size, 1.0)[:, None]
        rolled = self.grains.radius * np.nan_to_num(after.rotation - before.rotation)
        moment_sd = 0.5 * BASE_ARM * limit * self.grains.radius
        moment = -moment_sd * rolled / np.maximum(np.hypot(rolled, 2.0 * snapshots[k].sigma), EXACT)
        return replace(self, grains=replace(self.grains, drag=drag, moment=moment, moment_sd=moment_sd))

    @property
    def weight(self) -> Array:
        """Weight of every grain (n, 2) [N]."""
        return self.grains.weight(self.material.gravity)

    @property
    def scale_is_known(self) -> bool:
        """Whether loads or weight fix the scale of the forces; otherwise they are known up to a factor."""
        return bool(np.isfinite(self.pressure).any() or any(self.material.gravity))

    @property
    def is_loaded(self) -> bool:
        """Whether a known load bears on the grains, or weight in a packing without boundary grains.

        The forces of boundary grains, and of walls without a load, satisfy no balance.
        """
        weight_alone = any(self.material.gravity) and bool(self.grains.free.all())
        return bool(np.isfinite(self.pressure).any()) or weight_alone

    def mean_pressure(self, snapshot: Snapshot) -> float:
        """Return the mean pressure of the plates at a snapshot [Pa]; 0 without a plate."""
        plates = np.isfinite(self.pressure)
        if snapshot.load is None or not plates.any():
            return float(self.pressure[plates].mean()) if plates.any() else 0.0
        walls = self.walls(snapshot.endpoints, snapshot.side, snapshot.load)
        return float((walls.load[plates] / (walls.face[plates] * self.length)).mean())

    def load_ratio(self, snapshot: Snapshot, other: Snapshot) -> float:
        """Compute the mean stress by loads and weight at a snapshot over that at another one; 1 without plates.

        Notes
        -----
        Plates bear their load, and grains between them on average half of the weight on the faces of the plates, so
        that a light load changes the stress of a heavy packing little.
        """
        one, two = self.mean_pressure(snapshot), self.mean_pressure(other)
        if not min(one, two) > 0.0:
            return 1.0
        face = self.walls(snapshot.endpoints, snapshot.side, snapshot.load).face[np.isfinite(self.pressure)]
        weight = float(np.linalg.norm(self.weight.sum(axis=0))) / (2.0 * float(face.mean()) * self.length)
        return (one + weight) / (two + weight)

    def load(
        self,
        endpoints: Array,
        side: Sides = None,
        measured: Array | None = None,
        placed: tuple[Array, NDArray[np.bool_]] | None = None,
    ) -> Array:
        """Return the load on every wall (w,) [N], NaN where the motion is imposed.

        Parameters
        ----------
        endpoints : (w, 2, 2)
            Walls [m].
        side : (w,), optional
            Shapes of the walls.
        measured : (w,), optional
            Measured loads [N], used instead of the pressure; NaN: not measured.
        placed : (n, 2) and (n,), optional
            Centres [m] and presence of the grains, of which those of the boundary bear a part that is left out.

        Notes
        -----
        Forces between a boundary grain and a wall are not part of the model, as the motion of both is given: see
        `fraction_on_free_grains`.
        """
        pressed = self.pressure * Walls.at_rest(endpoints, side=side).face * self.length
        load = pressed if measured is None else np.where(np.isfinite(measured), measured, pressed)
        if placed is None:
            return load
        return load * fraction_on_free_grains(self.grains, Walls.at_rest(endpoints, side=side), *placed)

    def walls(self, endpoints: Array, side: Sides = None, measured: Array | None = None) -> Walls:
        """Return the walls of endpoints (w, 2, 2) [m] at rest under their loads; arguments as of `load`."""
        return Walls.at_rest(endpoints, self.load(endpoints, side, measured), side)

    def walls_of(self, snapshot: Snapshot) -> Walls:
        """Return the walls of a snapshot at rest under their loads."""
        placed = snapshot.position, snapshot.present
        load = self.load(snapshot.endpoints, snapshot.side, snapshot.load, placed)
        return Walls.at_rest(snapshot.endpoints, load, snapshot.side, snapshot.cell, snapshot.plate)


def fraction_on_free_grains(grains: Grains, walls: Walls, position: Array, present: NDArray[np.bool_]) -> Array:
    """Return the fraction of the load on every wall (w,) that free grains bear; 1 where none is at the wall.

    Parameters
    ----------
    grains : Grains
    walls : Walls
    position : (n, 2)
        Centres [m].
    present : (n,)
        Which grains are there.

    Notes
    -----
    Σ R of the free grains at the wall over Σ R of all: each bears the load on its width.
    """
    fraction = np.ones(walls.count)
    if grains.boundary is None:
        return fraction
    position, radius, free = position[present], grains.radius[present], grains.free[present]
    for w in range(walls.count):
        distance, _ = walls.distance(np.full(len(radius), w), position)
        width = radius * (np.abs(distance - radius) < NEAR * radius)
        if (width @ free) > 0.0:
            fraction[w] = float(width @ free) / float(width.sum())
    return fraction
