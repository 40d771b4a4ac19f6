"""A periodic cell: the packing goes on beyond its edges as it is inside, in place of walls.

Centres may lie anywhere; what counts is where the images of a pair come nearest to each other. A cell that is higher
than two of the largest diameters, across either of its vectors, has one such image for a pair that touches.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from solver.bodies.grains import Array


@dataclass(frozen=True, slots=True)
class Cell:
    """The cell at one instant, and how it deforms."""

    vectors: Float[Array, "2 2"]  # [m], a and b by rows
    velocity: Float[Array, "2 2"]  # [m/s] of their ends, the origin at rest

    @classmethod
    def at_rest(cls, vectors: Array) -> Cell:
        return cls(vectors, np.zeros((2, 2)))

    @property
    def area(self) -> float:
        """Area of the cell [m²]."""
        return abs(float(np.linalg.det(self.vectors)))

    @property
    def heights(self) -> Array:
        """Distance between opposite sides (2,) [m], across a and across b, of the cell as upright as it can be."""
        a, b = np.linalg.norm(reduce_vectors(self.vectors)[1], axis=1)
        return self.area / np.array([b, a])

    def shift(self, separation: Array) -> Array:
        """What to add to x_j (c, 2) [m] for the image of j that is nearest to i; separation: x_j − x_i (c, 2) [m].

        Whole numbers of the cell's vectors; zero where the separation is NaN.
        """
        _, upright = reduce_vectors(self.vectors)
        known = np.isfinite(separation).all(axis=1, keepdims=True)
        share = np.where(known, separation, 0.0) @ np.linalg.inv(upright)
        return -np.rint(share) @ upright

    def drift(self, shift: Array) -> Array:
        """What a shift by whole vectors (c, 2) [m] adds to a velocity (c, 2) [m/s]."""
        return np.rint(shift @ np.linalg.inv(self.vectors)) @ self.velocity

    def wrapped(self, position: Array) -> Array:
        """The places (n, 2) [m] as they lie in the cell whose corner is the origin."""
        share = position @ np.linalg.inv(self.vectors)
        return (share - np.floor(share)) @ self.vectors

    def with_surroundings(self, position: Array, reach: float) -> tuple[Array, NDArray[np.intp]]:
        """Places (m, 2) [m] in an upright cell and of their images within `reach` [m] of it, and whose they are (m,).

        The first of them are those of position (n, 2) [m], in order.
        """
        _, upright = reduce_vectors(self.vectors)
        share = position @ np.linalg.inv(upright)
        share -= np.floor(share)
        margin = reach * np.linalg.norm(upright, axis=1)[::-1] / self.area
        places, owners = [share @ upright], [np.arange(len(position))]
        for step in product((-1, 0, 1), repeat=2):
            moved = share + step
            near = np.all((moved > -margin) & (moved < 1.0 + margin), axis=1) & any(step)
            places.append(moved[near] @ upright)
            owners.append(np.flatnonzero(near))
        return np.concatenate(places), np.concatenate(owners)


def reduce_vectors(vectors: Array) -> tuple[NDArray[np.int64], Array]:
    """The same lattice by its shortest vectors: whole numbers (2, 2) to multiply (2, 2) [m] by, and the product."""
    steps, short = np.eye(2, dtype=np.int64), vectors.copy()
    while True:
        if short[1] @ short[1] < short[0] @ short[0]:
            steps, short = steps[::-1], short[::-1]
        times = int(np.rint(short[0] @ short[1] / (short[0] @ short[0])))
        if times == 0:
            return steps, short
        steps = np.stack([steps[0], steps[1] - times * steps[0]])
        short = np.stack([short[0], short[1] - times * short[0]])


def follow_cell(vectors: Array) -> Array:
    """The vectors (f, 2, 2) [m] without jumps by whole vectors, as codes make them that keep a sheared cell upright."""
    followed = vectors.copy()
    for k in range(1, len(vectors)):
        for one, other in ((1, 0), (0, 1)):
            step = vectors[k, other]
            jump = np.rint((followed[k - 1, one] - vectors[k, one]) @ step / (step @ step))
            followed[k, one] = vectors[k, one] + jump * step
    return followed


def unwrap(position: Array, vectors: Array) -> Array:
    """Places (f, n, 2) [m] without jumps by whole vectors (f, 2, 2) [m] of the cell, wrapped or not as they were told.

    Each grain begins inside the cell where it is first seen. NaN stays NaN, and what lies between is passed over.
    """
    inverse = np.linalg.inv(vectors)
    share = np.einsum("fnk,fkl->fnl", position, inverse)
    last = np.full(position.shape[1:], 0.5)
    for each in share:
        known = np.isfinite(each).all(axis=1)
        jump = np.rint(each[known] - last[known])
        each[known] -= jump
        last[known] = each[known]
    return np.einsum("fnk,fkl->fnl", share, vectors)
