"""Kernels of the interior-point method: loops over contacts, 2 × 2 systems each, and over their Jacobian blocks.

The unknowns of a contact are the components w ≥ 0 of its force along the two edges of its Coulomb cone:
f_n = w₀ + w₁ and f_t = μ (w₁ − w₀). The cone then needs no further constraint, friction may be zero, and no digits
cancel near an edge.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from ..array_copies import copy_matrix, copy_vector
from ..bodies.grains import Array
from ..factor.blocks import TRIPLE, block_size
from ..factor.cholesky import factorize, solve
from ..factor.pattern import Ids
from .contact_jacobian import JACOBIAN_SIZE, PADDED_ROWS, ROWS, add_coupling_block, add_jacobian_columns

AREA = block_size(TRIPLE)
STEP_FRACTION = 0.99  # of the step to the boundary
# A correction costs one solve, so its number follows from the entries of the factor per grain.
ENTRIES_PER_CORRECTION, MAX_CORRECTIONS = 7, 3
SUFFICIENT_STEP = 1.8  # primal plus dual step length; longer steps are not corrected
STEP_EXTENSION, MIN_EXTENSION = 0.3, 0.03  # step length that a correction aims to add, and the least it must add
MIN_PRODUCT, MAX_PRODUCT = 0.3, 5.0  # w z over its target
RESIDUAL_TOLERANCE = 1e-3  # rms of the gradient or equilibrium residual, in units of sliding and of force
CONVERGED, STEP_LIMIT, BREAKDOWN = range(3)  # return codes of `iterate`


class Program(NamedTuple):
    """Minimise cost·f + λ/2 |f − centre|² + ρ/2 |H f − b|² over the Coulomb cones."""

    friction: Array  # (c,)
    cost: Array  # (c, 2) of f_n and f_t
    centre: Array  # (c, 2)
    proximal_weight: float  # λ
    equilibrium_weight: float  # ρ


class Iterate(NamedTuple):
    """Primal and dual variables, or a step of them."""

    edge_force: Array  # (c, 2) w > 0
    multiplier: Array  # (c, 2) z > 0 of w
    velocity: Array  # (4 n,) v = ρ (H f − b), by nodes


class Workspace(NamedTuple):
    """Arrays of one step; only `best` is kept from step to step."""

    gradient_residual: Array  # (c, 2) of the gradient
    equilibrium_residual: Array  # (4 n,) H f − b − v/ρ
    complementarity_residual: Array  # (c, 2) w z minus its target
    compliance: Array  # (c, 3) E: 00, 01, 11
    rhs: Array  # (c, 2) of the contacts' equations
    blocks: Array  # (k,) I/ρ + H E Hᵀ, then its factor
    row_offset: Ids  # (n,) scratch of the factorisation
    step: Iterate
    trial_step: Iterate  # with one more correction
    best: Array  # (c, 2)


@njit(cache=True, nogil=True, error_model="numpy")
def iterate(grains, program, current, workspace, tolerance, max_steps):  # type: ignore[no-untyped-def]
    """Iterate until the mean of w z is below the tolerance and both residuals below RESIDUAL_TOLERANCE.

    The edge forces of the best iterate are stored in `workspace.best`. Returns the code, the number of steps, and the
    mean of w z and the greater residual of the best iterate.
    """
    best_gap, best_residual = np.inf, np.inf
    steps, corrections = (
        0,
        min(grains.pattern.start[-1] // (ENTRIES_PER_CORRECTION * len(workspace.row_offset)), MAX_CORRECTIONS),
    )
    while True:
        gap, residual = _measure_residuals(grains, program, current, workspace)
        # Rounding may spoil late iterates: of those with small residuals the one with the smallest gap is kept.
        clipped, best_clipped = max(residual, RESIDUAL_TOLERANCE), max(best_residual, RESIDUAL_TOLERANCE)
        if clipped < best_clipped or (clipped == best_clipped and gap < best_gap):
            best_gap, best_residual = gap, residual
            copy_matrix(current.edge_force, workspace.best)
        if gap <= tolerance and residual <= RESIDUAL_TOLERANCE:
            return CONVERGED, steps, best_gap, best_residual
        if steps == max_steps:
            return STEP_LIMIT, steps, best_gap, best_residual
        _assemble_schur_complement(grains, program, current, workspace)
        # NaN is not positive either.
        if not factorize(grains.pattern, workspace.blocks, workspace.row_offset, TRIPLE):
            return BREAKDOWN, steps, best_gap, best_residual
        _set_complementarity_residual(current, workspace, 0.0, False)
        primal, dual = _find_step(grains, program, current, workspace, workspace.step)
        # Mehrotra's heuristic: the gap that the predictor step would leave sets the target of the corrector step.
        predicted_gap = _predict_gap(current, workspace.step, primal, dual)
        target = gap * (predicted_gap / gap) ** 3
        _set_complementarity_residual(current, workspace, target, True)
        primal, dual = _find_step(grains, program, current, workspace, workspace.step)
        for _ in range(corrections):
            if primal + dual > SUFFICIENT_STEP:
                break
            recentre(current, workspace, min(1.0, primal + STEP_EXTENSION), min(1.0, dual + STEP_EXTENSION), target)
            longer_primal, longer_dual = _find_step(grains, program, current, workspace, workspace.trial_step)
            if longer_primal + longer_dual < primal + dual + MIN_EXTENSION:
                break
            primal, dual = longer_primal, longer_dual
            _copy_step(workspace.trial_step, workspace.step)
        _apply_step(current, workspace.step, STEP_FRACTION * primal, STEP_FRACTION * dual)
        steps += 1


@njit(cache=True, nogil=True, error_model="numpy")
def _measure_residuals(grains, program, current, workspace):  # type: ignore[no-untyped-def]
    """Set the residuals in the workspace; return the mean of w z and the greater rms of the two residuals."""
    inverse = 1.0 / program.equilibrium_weight
    for k in range(len(current.velocity)):
        workspace.equilibrium_residual[k] = -grains.load[k] - current.velocity[k] * inverse
    gap, gradient_squares, equilibrium_squares = 0.0, 0.0, 0.0
    count = len(current.edge_force)
    for c in range(count):
        mu = program.friction[c]
        w0, w1 = current.edge_force[c, 0], current.edge_force[c, 1]
        fn, ft = w0 + w1, mu * (w1 - w0)
        un = program.cost[c, 0] + program.proximal_weight * (fn - program.centre[c, 0])
        ut = program.cost[c, 1] + program.proximal_weight * (ft - program.centre[c, 1])
        for q in range(grains.jacobian_start[c], grains.jacobian_start[c + 1]):
            x = PADDED_ROWS * grains.node[q]
            add_jacobian_columns(workspace.equilibrium_residual, x, grains.jacobian, q, fn, ft)
            for a in range(ROWS):
                hn, ht = grains.jacobian[JACOBIAN_SIZE * q + a], grains.jacobian[JACOBIAN_SIZE * q + PADDED_ROWS + a]
                un += hn * current.velocity[x + a]
                ut += ht * current.velocity[x + a]
        z0, z1 = current.multiplier[c, 0], current.multiplier[c, 1]
        r0, r1 = un - mu * ut - z0, un + mu * ut - z1
        workspace.gradient_residual[c, 0], workspace.gradient_residual[c, 1] = r0, r1
        gap += w0 * z0 + w1 * z1
        gradient_squares += r0 * r0 + r1 * r1
    for k in range(len(current.velocity)):
        equilibrium_squares += workspace.equilibrium_residual[k] ** 2
    return gap / (2 * count), max(
        np.sqrt(gradient_squares / (2 * count)), np.sqrt(equilibrium_squares / (ROWS * len(workspace.row_offset)))
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _assemble_schur_complement(grains, program, current, workspace):  # type: ignore[no-untyped-def]
    """Assemble E = (Λ + D)⁻¹ of every contact in closed form, Λ the matrix of λ in w, D = z/w, and I/ρ + H E Hᵀ."""
    blocks, start = workspace.blocks, grains.pattern.start
    for k in range(len(blocks)):
        blocks[k] = 0.0
    for j in range(len(start) - 1):
        for a in range(ROWS):
            blocks[AREA * start[j] + (PADDED_ROWS + 1) * a] = 1.0 / program.equilibrium_weight
    for c in range(len(current.edge_force)):
        mu, square = program.friction[c], program.friction[c] ** 2
        own, mixed = program.proximal_weight * (1.0 + square), program.proximal_weight * (1.0 - square)
        d0, d1 = (
            current.multiplier[c, 0] / current.edge_force[c, 0],
            current.multiplier[c, 1] / current.edge_force[c, 1],
        )
        # All terms are positive: differences would cancel where one d is large.
        inverse_determinant = 1.0 / (
            d0 * d1 + own * (d0 + d1) + 4.0 * program.proximal_weight * program.proximal_weight * square
        )
        workspace.compliance[c, 0] = (own + d1) * inverse_determinant
        workspace.compliance[c, 1] = -mixed * inverse_determinant
        workspace.compliance[c, 2] = (own + d0) * inverse_determinant
        nn, nt = (
            (4.0 * program.proximal_weight * square + d0 + d1) * inverse_determinant,
            mu * (d0 - d1) * inverse_determinant,
        )
        tt = square * (4.0 * program.proximal_weight + d0 + d1) * inverse_determinant
        e = grains.entry_start[c]
        for p in range(grains.jacobian_start[c], grains.jacobian_start[c + 1]):
            for q in range(grains.jacobian_start[c], p + 1):
                o = AREA * grains.entry[e]
                e += 1
                add_coupling_block(blocks, o, grains.jacobian, p, q, nn, nt, tt)


@njit(cache=True, nogil=True, error_model="numpy")
def _set_complementarity_residual(current, workspace, target, corrected):  # type: ignore[no-untyped-def]
    """Set w z minus its target; corrected: with the second-order term of the predictor step."""
    step = workspace.step
    for c in range(len(current.edge_force)):
        for k in range(2):
            residual = current.edge_force[c, k] * current.multiplier[c, k] - target
            if corrected:
                residual += step.edge_force[c, k] * step.multiplier[c, k]
            workspace.complementarity_residual[c, k] = residual


@njit(cache=True, nogil=True, error_model="numpy")
def _find_step(grains, program, current, workspace, step):  # type: ignore[no-untyped-def]
    """Compute the Newton step to zero residuals; return the primal and dual step lengths to the boundary."""
    v = step.velocity
    copy_vector(workspace.equilibrium_residual, v)
    for c in range(len(current.edge_force)):
        mu = program.friction[c]
        r0 = -workspace.gradient_residual[c, 0] - workspace.complementarity_residual[c, 0] / current.edge_force[c, 0]
        r1 = -workspace.gradient_residual[c, 1] - workspace.complementarity_residual[c, 1] / current.edge_force[c, 1]
        e00, e01, e11 = workspace.compliance[c, 0], workspace.compliance[c, 1], workspace.compliance[c, 2]
        w0, w1 = e00 * r0 + e01 * r1, e01 * r0 + e11 * r1
        fn, ft = w0 + w1, mu * (w1 - w0)
        workspace.rhs[c, 0], workspace.rhs[c, 1] = r0, r1
        for q in range(grains.jacobian_start[c], grains.jacobian_start[c + 1]):
            x = PADDED_ROWS * grains.node[q]
            add_jacobian_columns(v, x, grains.jacobian, q, fn, ft)
    solve(grains.pattern, workspace.blocks, v, TRIPLE)
    primal, dual = 1.0, 1.0
    for c in range(len(current.edge_force)):
        un, ut = 0.0, 0.0
        for q in range(grains.jacobian_start[c], grains.jacobian_start[c + 1]):
            x = PADDED_ROWS * grains.node[q]
            for a in range(ROWS):
                un += grains.jacobian[JACOBIAN_SIZE * q + a] * v[x + a]
                ut += grains.jacobian[JACOBIAN_SIZE * q + PADDED_ROWS + a] * v[x + a]
        ut *= program.friction[c]
        r0, r1 = workspace.rhs[c, 0] - un + ut, workspace.rhs[c, 1] - un - ut
        e00, e01, e11 = workspace.compliance[c, 0], workspace.compliance[c, 1], workspace.compliance[c, 2]
        step.edge_force[c, 0], step.edge_force[c, 1] = e00 * r0 + e01 * r1, e01 * r0 + e11 * r1
        for k in range(2):
            w, z, dw = current.edge_force[c, k], current.multiplier[c, k], step.edge_force[c, k]
            dz = -(workspace.complementarity_residual[c, k] + z * dw) / w
            step.multiplier[c, k] = dz
            if w + primal * dw < 0.0:
                primal = -w / dw
            if z + dual * dz < 0.0:
                dual = -z / dz
    return primal, dual


@njit(cache=True, nogil=True, error_model="numpy")
def recentre(current, workspace, primal, dual, target):  # type: ignore[no-untyped-def]
    """Correct the complementarity residual where a step of these lengths would leave w z far from its target.

    After Gondzio (1996): single contacts whose w or z would vanish long before the others keep every step short.
    """
    step, low, high = workspace.step, MIN_PRODUCT * target, MAX_PRODUCT * target
    for c in range(len(current.edge_force)):
        for k in range(2):
            w = current.edge_force[c, k] + primal * step.edge_force[c, k]
            product = w * (current.multiplier[c, k] + dual * step.multiplier[c, k])
            if product < low:
                workspace.complementarity_residual[c, k] -= low - product
            elif product > high:
                workspace.complementarity_residual[c, k] += min(product - high, high)


@njit(cache=True, nogil=True, error_model="numpy")
def _copy_step(step, to):  # type: ignore[no-untyped-def]
    copy_matrix(step.edge_force, to.edge_force)
    copy_matrix(step.multiplier, to.multiplier)
    copy_vector(step.velocity, to.velocity)


@njit(cache=True, nogil=True, error_model="numpy")
def _predict_gap(current, step, primal, dual):  # type: ignore[no-untyped-def]
    """Compute the mean of w z after a step of these lengths."""
    total = 0.0
    for c in range(len(current.edge_force)):
        for k in range(2):
            edge_force = current.edge_force[c, k] + primal * step.edge_force[c, k]
            total += edge_force * (current.multiplier[c, k] + dual * step.multiplier[c, k])
    return total / (2 * len(current.edge_force))


@njit(cache=True, nogil=True, error_model="numpy")
def _apply_step(current, step, primal, dual):  # type: ignore[no-untyped-def]
    for c in range(len(current.edge_force)):
        for k in range(2):
            current.edge_force[c, k] += primal * step.edge_force[c, k]
            current.multiplier[c, k] += dual * step.multiplier[c, k]
    for k in range(len(current.velocity)):
        current.velocity[k] += dual * step.velocity[k]
