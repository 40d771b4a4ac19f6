"""Grains and their motion at one instant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from jaxtyping import Bool, Float
from numpy.typing import NDArray

from ..quantity import Quantity

# Spelt out: since numpy 2.5 NDArray is an alias, in which jaxtyping sees no array.
Array = np.ndarray[tuple[Any, ...], np.dtype[np.float64]]


@dataclass(frozen=True, slots=True)
class Grains:
    """The bodies of a packing: solid rods seen end on."""

    radius: Annotated[Float[Array, " n"], Quantity("radius as it was used", "m", "grain", essential=True)]
    mass: Annotated[Float[Array, " n"], Quantity("mass", "kg", "grain", essential=True)]
    boundary: Annotated[
        Bool[np.ndarray, " n"] | None,
        Quantity("whether the grain is the packing's boundary: its motion is imposed", dims="grain", since=2),
    ] = None  # None: no grain
    drag: Float[Array, "n 2"] | None = None  # [N] of a base in the frame at hand; None: no base
    # [N m] moment that no force at a contact exerts, as one of a base, and its standard deviation; None: 0
    moment: Float[Array, " n"] | None = None
    moment_sd: Float[Array, " n"] | None = None

    def __post_init__(self) -> None:
        if self.boundary is not None and self.boundary.shape != self.radius.shape:
            raise ValueError(f"boundary must have shape {self.radius.shape}, not {self.boundary.shape}")
        if self.radius.shape != self.mass.shape or self.radius.ndim != 1:
            raise ValueError("radius and mass must be one-dimensional and of equal length")
        if not (np.all(self.radius > 0) and np.all(self.mass > 0)):
            raise ValueError("every radius and every mass must be positive")

    @classmethod
    def of_rods(
        cls, radius: Array, *, density: float, length: float, boundary: NDArray[np.bool_] | None = None
    ) -> Grains:
        """Make solid rods of one material, of mass m = ρ L π R².

        Parameters
        ----------
        radius : (n,)
            Radii [m].
        density
            ρ [kg/m³].
        length
            Length L of the rods [m].
        boundary : (n,) bool, optional
            Grains whose motion is imposed.
        """
        radius = np.ascontiguousarray(radius, dtype=np.float64)
        return cls(radius, density * length * np.pi * radius**2, boundary)

    @property
    def count(self) -> int:
        return len(self.radius)

    @property
    def free(self) -> NDArray[np.bool_]:
        """Grains in equilibrium (n,): all but the boundary grains."""
        return np.ones(self.count, np.bool_) if self.boundary is None else ~self.boundary

    @property
    def inertia(self) -> Array:
        """Moment of inertia of a solid rod about its axis, ½ m R² (n,) [kg m²]."""
        return 0.5 * self.mass * self.radius**2

    def weight(self, gravity: tuple[float, float]) -> Array:
        """Weight of every grain, and its drag on a base (n, 2) [N]; gravity [m/s²]."""
        weight = self.mass[:, None] * np.asarray(gravity)
        return weight if self.drag is None else weight + self.drag


@dataclass(frozen=True, slots=True)
class GrainMotion:
    """Positions of the grains at one instant and their mean velocities over the interval before it.

    Rows of absent grains are never read and may hold any number.
    """

    position: Float[Array, "n 2"]  # [m]
    velocity: Float[Array, "n 2"]  # [m/s], the mean over the interval that ends here
    spin: Float[Array, " n"]  # [rad/s], counter-clockwise
    present: Bool[np.ndarray, " n"]  # False: lost or never seen

    def __post_init__(self) -> None:
        n = len(self.present)
        if self.position.shape != (n, 2) or self.velocity.shape != (n, 2) or self.spin.shape != (n,):
            raise ValueError("position (n, 2), velocity (n, 2), spin (n,) and present (n,) must agree in n")
        for name in ("position", "velocity", "spin"):
            if not np.all(np.isfinite(getattr(self, name)[self.present])):
                raise ValueError(f"the {name} of a present grain is not finite")


def move_freely(
    boundary: NDArray[np.bool_] | None, i: NDArray[np.integer], j: NDArray[np.integer]
) -> NDArray[np.bool_]:
    """Return which pairs have a body whose motion is not imposed: others need not touch, and bear what they may.

    Parameters
    ----------
    boundary : (n,) bool or None
        Grains of the boundary; None: none.
    i, j : (c,) int
        Grain, and grain or wall, of which the rows begin at n.
    """
    if boundary is None:
        return np.ones(len(i), np.bool_)
    imposed = np.append(boundary, True)  # the last row stands for all walls
    return ~(boundary[i] & imposed[np.minimum(j, len(boundary))])
