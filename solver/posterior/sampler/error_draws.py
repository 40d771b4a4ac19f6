"""The loop over blocks of grains: the error of every radius together with the errors of its centre in all frames."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from ...aligned_memory import aligned_numbers, aligned_singles
from ...grain_records import WIDTH, gather_records, scatter_records
from .blocks import RECORD
from .lanes import LANES, draw_uniform, logarithm
from .state import CX, CY, DELTA
from .truncated_normal import normal_of

L = LANES


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def factorize_errors(chain):  # type: ignore[no-untyped-def]
    """Factorise the precision of every grain's errors, which follows from b of its pairs alone.

    The rows of workspace.centre_factor are 1/L₀₀, L₁₀, 1/L₁₁ and v; workspace.radius_precision holds Q.

    Notes
    -----
    Sums go over the gaps of a grain in frame k, n' is the normal from the grain's side (−n for i, n for j):

        L_k L_kᵀ = I/σ_c² + Σ n' n'ᵀ/b²,  v_k = L_k⁻¹ Σ n'/b²,  Q = 1/σ_r² + Σ_k (Σ 1/b² − |v_k|²)
    """
    grains, workspace, weight_of = chain.grains, chain.workspace, chain.workspace.precision
    start, frames, precision = grains.start, grains.frames, workspace.radius_precision
    pair, present = grains.pair.reshape(grains.pair.size), grains.present.reshape(grains.present.size)
    normal, weights = grains.normal.reshape(grains.normal.size), workspace.pair_weight.reshape(grains.pair.size)
    factor = workspace.centre_factor.reshape(workspace.centre_factor.size)
    work = aligned_numbers(12 * L)  # sums of n'n'ᵀ/b² (3), n'/b² (2) and 1/b²; 1/b² of a row; the rows of the factor
    for block in range(len(precision)):
        for k in range(L):
            precision[block, k] = grains.radius_precision[block, k]
        for frame in range(block * frames, (block + 1) * frames):
            for k in range(L):
                work[k] = work[L + k] = grains.centre_precision[frame, k]
            for k in range(2 * L, 6 * L):
                work[k] = 0.0
            for row in range(start[frame], start[frame + 1]):
                for k in range(L):
                    nx, ny = normal[2 * row * L + k], normal[(2 * row + 1) * L + k]
                    weight = present[row * L + k] * weight_of[pair[row * L + k]]
                    work[6 * L + k] = weight
                    work[k] += weight * nx * nx
                    work[L + k] += weight * ny * ny
                    work[2 * L + k] += weight * nx * ny
                    work[3 * L + k] += weight * nx
                    work[4 * L + k] += weight * ny
                    work[5 * L + k] += weight
                for k in range(L):
                    weights[row * L + k] = work[6 * L + k]
            for k in range(L):
                l11 = math.sqrt(work[k])
                l21 = work[2 * L + k] / l11
                l22 = math.sqrt(work[L + k] - l21 * l21)
                tx = work[3 * L + k] / l11
                ty = (work[4 * L + k] - l21 * tx) / l22
                work[7 * L + k], work[8 * L + k], work[9 * L + k] = 1.0 / l11, l21, 1.0 / l22
                work[10 * L + k], work[11 * L + k] = tx, ty
                work[5 * L + k] -= tx * tx + ty * ty
            for k in range(5 * L):
                factor[5 * frame * L + k] = work[7 * L + k]
            for k in range(L):
                precision[block, k] += work[5 * L + k]


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def draw_errors(chain):  # type: ignore[no-untyped-def]
    """Draw the error δ of every radius together with those of its centre, ε_k, in all frames k.

    Notes
    -----
    With r = gap − offset + κ f (bearing) or gap − offset − γ (open), plus the errors of the other grain, each gap is a
    linear observation n'·ε_k + δ = r of standard deviation b. With L, v and Q of `factorize_errors` and
    u_k = L_k⁻¹ Σ n' r/b²,

        δ | rest ~ N(Q⁻¹ Σ_k (Σ r/b² − v_k·u_k), Q⁻¹),  L_kᵀ ε_k = u_k − δ v_k + N(0, I).
    """
    grains, state, workspace = chain.grains, chain.state, chain.workspace
    body, record, other = state.error.reshape(state.error.size), grains.record.reshape(grains.record.size), grains.other
    other, pair, weights = other.reshape(other.size), grains.pair.reshape(grains.pair.size), workspace.pair_weight
    weights, normal = weights.reshape(weights.size), grains.normal.reshape(grains.normal.size)
    factor, start, frames = workspace.centre_factor.reshape(workspace.centre_factor.size), grains.start, grains.frames
    residual, precision, random = workspace.residual, workspace.radius_precision, state.random
    # Rows: a record of the others; Σ n' r/b² (2); Σ r/b² less v·u, of all frames; δ.
    work, mean = aligned_numbers(8 * L), aligned_numbers(2 * frames * L)
    uniform = aligned_singles(2 * L)
    for block in range(len(precision)):
        for k in range(L):
            work[6 * L + k] = 0.0
        for frame in range(frames):
            at = block * frames + frame
            for k in range(2 * L):
                work[4 * L + k] = 0.0
            for row in range(start[at], start[at + 1]):
                for k in range(0, L, WIDTH):
                    gather_records(body, other, row * L + k, work, k, L)
                for k in range(L):
                    nx, ny = normal[2 * row * L + k], normal[(2 * row + 1) * L + k]
                    rest = residual[pair[row * L + k]] + nx * work[CX * L + k] + ny * work[CY * L + k]
                    rest = (rest - work[DELTA * L + k]) * weights[row * L + k]
                    work[4 * L + k] += nx * rest
                    work[5 * L + k] += ny * rest
                    work[6 * L + k] += rest
            f, u = 5 * at * L, 2 * frame * L
            for k in range(L):
                ux = work[4 * L + k] * factor[f + k]
                uy = (work[5 * L + k] - factor[f + L + k] * ux) * factor[f + 2 * L + k]
                work[6 * L + k] -= factor[f + 3 * L + k] * ux + factor[f + 4 * L + k] * uy
                mean[u + k], mean[u + L + k] = ux, uy
        draw_uniform(random, uniform, 0)
        for k in range(L):
            drawn = np.float64(normal_of(logarithm(uniform[k])))
            work[7 * L + k] = work[6 * L + k] / precision[block, k] + drawn / math.sqrt(precision[block, k])
        for frame in range(frames):
            at = block * frames + frame
            f, u = 5 * at * L, 2 * frame * L
            draw_uniform(random, uniform, 0)
            draw_uniform(random, uniform, L)
            for k in range(2 * L):
                uniform[k] = normal_of(logarithm(uniform[k]))
            for k in range(L):
                delta = work[7 * L + k]
                x = mean[u + k] - delta * factor[f + 3 * L + k] + np.float64(uniform[k])
                y = (mean[u + L + k] - delta * factor[f + 4 * L + k] + np.float64(uniform[L + k])) * factor[
                    f + 2 * L + k
                ]
                work[CX * L + k], work[CY * L + k] = (x - factor[f + L + k] * y) * factor[f + k], y
                work[DELTA * L + k], work[3 * L + k] = delta, 0.0
            for k in range(0, L, WIDTH):
                scatter_records(work, k, L, body, record, at * L + k)
        for q in range(RECORD):  # the absent grain has no errors: walls and further places of short lists read it
            body[RECORD * chain.grain_count + q] = 0.0
