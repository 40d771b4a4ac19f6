"""Safeguarded Anderson acceleration of a static load's sweeps.

A number of sweeps maps forces f to G(f), and a solution is a fixed point. Type II (Walker & Ni 2011, Eq. 2.2): from
the last few pairs (f, G(f)) take the combination whose residual G(f) − f is least, go where that combination of the
G(f) lies, and project it on the Coulomb cones. The step is kept only if the natural-map residual has fallen after
the next sweeps; else the forces before the step come back and the past is forgotten, which leaves plain sweeps.

For static loads alone: in a kinematic chain it is the number of sweeps that regularises, and more of them hurt.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from solver.bodies.grains import Array
from solver.nlgs.problem import ContactProblem
from solver.nlgs.sweeping.contact_law import project_on_cone
from solver.nlgs.sweeping.kernels import apply_forces, measure_forces, measure_natural_map, workspace
from solver.nlgs.sweeping.ordering import GROUP

PERIOD = 60  # sweeps between two steps: shorter ones gain less than they cost in large packings
REGULARISATION = 1e-10  # of the squared residuals' differences


class Acceleration:
    """The past of one solve, and the steps taken from it. Forces, body and plate are changed in place.

    `settle` is called after every PERIOD sweeps, `step` between that and the next sweep.
    """

    def __init__(self, problem: ContactProblem, force: Array, window: int) -> None:
        """force (c, 2) [N] in visiting order, at the start of the first period; window: pairs that are looked at."""
        self._problem = problem
        self._start = force.copy()
        self._former_image, self._former_residual = np.empty_like(force), np.empty_like(force)
        self._image_change = np.zeros((window, force.size))
        self._residual_change = np.zeros((window, force.size))
        self._gram = np.zeros((window, window))
        self._pairs = 0  # seen since the past was last forgotten
        self._kept: tuple[Array, Array, Array, float] | None = None  # before a step that is not yet accepted
        self._natural_map = np.inf
        self.accepted = 0
        self.rejected = 0

    def settle(self, body: Array, plate: Array, force: Array) -> bool:
        """Accept the last step, or undo it with the sweeps that followed; whether it was undone."""
        _, norm, _ = measure_forces(force, force)
        self._natural_map = measure_natural_map(self._problem, body, plate, force, norm)
        if self._kept is None:
            return False
        kept_force, kept_body, kept_plate, kept_natural_map = self._kept
        self._kept = None
        if self._natural_map < kept_natural_map:
            self.accepted += 1
            return False
        self.rejected += 1
        force[:], body[:], plate[:] = kept_force, kept_body, kept_plate
        self._natural_map = kept_natural_map
        self._pairs = -1  # the sweeps undone are no pair (f, G(f)) of the forces that came back
        return True

    def step(self, body: Array, plate: Array, force: Array) -> None:
        """Go where the residual would be least, if there is a past to tell."""
        if self._pairs < 0:
            self._pairs = 0
        elif self._remember(force):
            self._kept = (force.copy(), body.copy(), plate.copy(), self._natural_map)
            count = min(self._pairs - 1, len(self._gram))
            pairs = len(force) - len(self._problem.wall)
            weights = self._weights(count)
            extrapolate(force, self._image_change, weights, self._problem.friction, pairs)
            apply_forces(self._problem, body, plate, force)
        self._start[:] = force

    def _remember(self, image: Array) -> bool:
        """Add the pair of this period; whether there are two of them to compare."""
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
        """The share of every change (count,) that takes most out of the residual (least squares)."""
        gram = self._gram[:count, :count].copy()
        gram[np.diag_indices(count)] *= 1.0 + REGULARISATION
        right = inner_products(self._residual_change[:count], self._former_residual.reshape(-1))
        return np.asarray(np.linalg.lstsq(gram, right, rcond=1e-14)[0], np.float64)


@njit(cache=True, nogil=True, error_model="numpy")
def inner_products(rows, vector):  # type: ignore[no-untyped-def]
    """Products of rows (k, m) with a vector (m,), in an order of summation that no number of threads can change."""
    result = np.zeros(len(rows))
    count = len(vector)
    for r in range(len(rows)):
        row = rows[r]
        lanes = workspace(GROUP)
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
    """Take weights (k,) times the changes (k, 2 c) off the forces (c, 2), and project on the cones."""
    flat = force.reshape(force.size)
    for r in range(len(weights)):
        row, weight = change[r], weights[r]
        for k in range(len(row)):
            flat[k] -= weight * row[k]
    for c in range(len(force)):
        fn, ft = project_on_cone(flat[2 * c], flat[2 * c + 1], friction[0 if c < pairs else 1])
        flat[2 * c] = fn
        flat[2 * c + 1] = ft
