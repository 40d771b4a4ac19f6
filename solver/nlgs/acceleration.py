"""Safeguarded Anderson acceleration of a static load's sweeps.

A number of sweeps maps forces f to G(f); a solution is a fixed point. Type II (Walker & Ni 2011, Eq. 2.2): of the last
few pairs (f, G(f)), find the combination with the smallest residual G(f) − f, move to the same combination of the G(f),
and project it onto the Coulomb cones. The step is kept only if the natural-map residual has fallen after the next
sweeps. Otherwise the forces before the step are restored and the history is cleared, which leaves plain sweeps.

Use it for static loads only: in a kinematic chain the number of sweeps regularises, and more sweeps worsen the forces.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..aligned_memory import aligned_numbers
from ..bodies.grains import Array
from .problem import ContactProblem
from .sweeping.contact_law import project_on_cone
from .sweeping.kernels import apply_forces, measure_forces, measure_natural_map
from .sweeping.ordering import GROUP

PERIOD = 60  # sweeps between two steps; shorter periods cost more than they save in large packings
REGULARISATION = 1e-10  # relative, of the Gram matrix of residual differences


class Acceleration:
    """History of one solve, and the Anderson steps from it. Forces, body and plate are changed in place.

    Call `accept_or_undo` after every PERIOD sweeps, and `step` between it and the next sweep.
    """

    def __init__(self, problem: ContactProblem, force: Array, window: int) -> None:
        """Start the history.

        Parameters
        ----------
        problem : ContactProblem
            The problem of the solve.
        force : (c, 2)
            Forces at the start of the first period, in visiting order [N].
        window : int
            Number of pairs that a step combines.
        """
        self._problem = problem
        self._start = force.copy()
        self._former_image, self._former_residual = np.empty_like(force), np.empty_like(force)
        self._image_change = np.zeros((window, force.size))
        self._residual_change = np.zeros((window, force.size))
        self._gram = np.zeros((window, window))
        self._pairs = 0  # since the history was cleared
        self._fallback: tuple[Array, Array, Array, float] | None = None  # state before a step that is not yet accepted
        self._natural_map = np.inf
        self.accepted = 0
        self.rejected = 0

    def accept_or_undo(self, body: Array, plate: Array, force: Array) -> bool:
        """Accept the last step, or undo it with the sweeps that followed; return whether it was undone."""
        _, norm, _ = measure_forces(force, force)
        self._natural_map = measure_natural_map(self._problem, body, plate, force, norm)
        if self._fallback is None:
            return False
        kept_force, kept_body, kept_plate, kept_natural_map = self._fallback
        self._fallback = None
        if self._natural_map < kept_natural_map:
            self.accepted += 1
            return False
        self.rejected += 1
        force[:], body[:], plate[:] = kept_force, kept_body, kept_plate
        self._natural_map = kept_natural_map
        self._pairs = -1  # the undone sweeps are no pair (f, G(f)) of the restored forces
        return True

    def step(self, body: Array, plate: Array, force: Array) -> None:
        """Extrapolate to the smallest residual if the history holds two pairs or more."""
        if self._pairs < 0:
            self._pairs = 0
        elif self._add_pair(force):
            self._fallback = (force.copy(), body.copy(), plate.copy(), self._natural_map)
            count = min(self._pairs - 1, len(self._gram))
            pairs = len(force) - len(self._problem.wall)
            weights = self._weights(count)
            extrapolate(force, self._image_change, weights, self._problem.friction, pairs)
            apply_forces(self._problem, body, plate, force)
        self._start[:] = force

    def _add_pair(self, image: Array) -> bool:
        """Add the pair of this period; return whether the history holds two pairs or more."""
        residual = image - self._start
        if self._pairs > 0:
            row = (self._pairs - 1) % len(self._gram)
            self._image_change[row] = (image - self._former_image).reshape(-1)
            self._residual_change[row] = (residual - self._former_residual).reshape(-1)
            known = min(self._pairs, len(self._gram))
            products = inner_products(self._residual_change[:known], self._residual_change[row])
            self._gram[row, :known] = self._gram[:known, row] = products
        self._former_image[:], self._former_residual[:] = image, residual
        self._pairs += 1
        return self._pairs > 1

    def _weights(self, count: int) -> Array:
        """Least-squares weights (count,) of the changes that minimise the residual."""
        gram = self._gram[:count, :count].copy()
        gram[np.diag_indices(count)] *= 1.0 + REGULARISATION
        right = inner_products(self._residual_change[:count], self._former_residual.reshape(-1))
        return np.asarray(np.linalg.lstsq(gram, right, rcond=1e-14)[0], np.float64)


@njit(cache=True, nogil=True, error_model="numpy")
def inner_products(rows, vector):  # type: ignore[no-untyped-def]
    """Products of rows (k, m) with a vector (m,), in a fixed order of summation."""
    result = np.zeros(len(rows))
    count = len(vector)
    for r in range(len(rows)):
        row = rows[r]
        lanes = aligned_numbers(GROUP)
        lanes[:] = 0.0
        for block in range((count + GROUP - 1) // GROUP):
            first = block * GROUP
            for k in range(min(GROUP, count - first)):
                lanes[k] += row[first + k] * vector[first + k]
        for k in range(GROUP):
            result[r] += lanes[k]
    return result


@njit(cache=True, nogil=True, error_model="numpy")
def extrapolate(force, change, weights, friction, pairs):  # type: ignore[no-untyped-def]
    """Subtract weights (k,) times the changes (k, 2 c) from the forces (c, 2), and project onto the cones."""
    flat = force.reshape(force.size)
    for r in range(len(weights)):
        row, weight = change[r], weights[r]
        for k in range(len(row)):
            flat[k] -= weight * row[k]
    for c in range(len(force)):
        fn, ft = project_on_cone(flat[2 * c], flat[2 * c + 1], friction[0 if c < pairs else 1])
        flat[2 * c] = fn
        flat[2 * c + 1] = ft
