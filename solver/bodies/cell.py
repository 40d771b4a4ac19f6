"""A periodic cell in place of walls, and the minimum-image convention.

Centres may lie outside the cell: a pair touches through its nearest images. A pair that touches has one nearest image
if both heights of the cell exceed two of the largest diameters.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from .grains import Array


@dataclass(frozen=True, slots=True)
class Cell:
    """The vectors of the cell at one instant, and their rates."""

    vectors: Float[Array, "2 2"]  # [m], a and b by rows
    velocity: Float[Array, "2 2"]  # [m/s] rates of both vectors

    @classmethod
    def at_rest(cls, vectors: Array) -> Cell:
        return cls(vectors, np.zeros((2, 2)))

    @property
    def area(self) -> float:
        """Area of the cell [m²]."""
        return abs(float(np.linalg.det(self.vectors)))

    @property
    def heights(self) -> Array:
        """Distances (2,) [m] between opposite sides, across a and across b, of the reduced cell."""
        a, b = np.linalg.norm(reduce_vectors(self.vectors)[1], axis=1)
        return self.area / np.array([b, a])

    def shift(self, separation: Array) -> Array:
        """Return the lattice vectors that lead from j to its image nearest to i.

        Parameters
        ----------
        separation : (c, 2)
            x_j − x_i [m].

        Returns
        -------
        (c, 2)
            The shift to add to x_j [m], an integer combination of the cell's vectors; zero where the separation is NaN.
        """
        _, reduced = reduce_vectors(self.vectors)
        known = np.isfinite(separation).all(axis=1, keepdims=True)
        fraction = np.where(known, separation, 0.0) @ np.linalg.inv(reduced)
        return -np.rint(fraction) @ reduced

    def drift(self, shift: Array) -> Array:
        """Return the velocity (c, 2) [m/s] of images relative to their originals; shift: lattice vectors (c, 2) [m]."""
        return np.rint(shift @ np.linalg.inv(self.vectors)) @ self.velocity

    def wrapped(self, position: Array) -> Array:
        """Return positions (n, 2) [m] wrapped into the cell whose corner is the origin."""
        fraction = position @ np.linalg.inv(self.vectors)
        return (fraction - np.floor(fraction)) @ self.vectors

    def with_images(self, position: Array, reach: float) -> tuple[Array, NDArray[np.intp]]:
        """Wrap points into the reduced cell and add their images around it.

        Parameters
        ----------
        position : (n, 2)
            Points [m].
        reach
            Greatest distance of an image from the cell [m].

        Returns
        -------
        points : (m, 2)
            The wrapped points [m] in their order, then their images.
        owners : (m,)
            Row of the original of each point.
        """
        _, reduced = reduce_vectors(self.vectors)
        fraction = position @ np.linalg.inv(reduced)
        fraction -= np.floor(fraction)
        margin = reach * np.linalg.norm(reduced, axis=1)[::-1] / self.area
        points, owners = [fraction @ reduced], [np.arange(len(position))]
        for step in product((-1, 0, 1), repeat=2):
            moved = fraction + step
            near = np.all((moved > -margin) & (moved < 1.0 + margin), axis=1) & any(step)
            points.append(moved[near] @ reduced)
            owners.append(np.flatnonzero(near))
        return np.concatenate(points), np.concatenate(owners)


def reduce_vectors(vectors: Array) -> tuple[NDArray[np.int64], Array]:
    """Reduce a lattice basis to its shortest vectors (Lagrange–Gauss).

    Returns
    -------
    transform : (2, 2) int
        Integer matrix T.
    reduced : (2, 2)
        T @ vectors [m].
    """
    steps, short = np.eye(2, dtype=np.int64), vectors.copy()
    while True:
        if short[1] @ short[1] < short[0] @ short[0]:
            steps, short = steps[::-1], short[::-1]
        times = int(np.rint(short[0] @ short[1] / (short[0] @ short[0])))
        if times == 0:
            return steps, short
        steps = np.stack([steps[0], steps[1] - times * steps[0]])
        short = np.stack([short[0], short[1] - times * short[0]])


def unwrap_cell(vectors: Array) -> Array:
    """Remove the jumps by lattice vectors from cell vectors (f, 2, 2) [m].

    Simulation codes make such jumps where they keep a sheared cell upright.
    """
    followed = vectors.copy()
    for k in range(1, len(vectors)):
        for one, other in ((1, 0), (0, 1)):
            step = vectors[k, other]
            jump = np.rint((followed[k - 1, one] - vectors[k, one]) @ step / (step @ step))
            followed[k, one] = vectors[k, one] + jump * step
    return followed


def unwrap(position: Array, vectors: Array) -> Array:
    """Remove the jumps by lattice vectors from positions, whether they were wrapped or not.

    Parameters
    ----------
    position : (f, n, 2)
        Positions [m]; NaN stays NaN.
    vectors : (f, 2, 2)
        Vectors of the cell [m].

    Returns
    -------
    (f, n, 2)
        Continuous positions [m]. Each grain starts inside the cell in the first frame that shows it.
    """
    inverse = np.linalg.inv(vectors)
    fraction = np.einsum("fnk,fkl->fnl", position, inverse)
    last = np.full(position.shape[1:], 0.5)
    for each in fraction:
        known = np.isfinite(each).all(axis=1)
        jump = np.rint(each[known] - last[known])
        each[known] -= jump
        last[known] = each[known]
    return np.einsum("fnk,fkl->fnl", fraction, vectors)
