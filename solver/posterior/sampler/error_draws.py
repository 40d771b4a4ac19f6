"""The loop over grains: the error of every radius together with the errors of its centre in all frames."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .records import CX, CY, DELTA


@njit(cache=True, nogil=True, error_model="numpy")
def factorize_errors(grains, model, workspace):  # type: ignore[no-untyped-def]
    """Factorise the precision of every grain's errors, which follows from b of its pairs alone.

    A row of workspace.centre_factor holds 1/L₀₀, L₁₀, 1/L₁₁ and v; workspace.precision holds Q.

    Notes
    -----
    Sums go over the gaps of a grain in frame k, n' is the normal from the grain's side (−n for i, n for j):

        L_k L_kᵀ = I/σ_c² + Σ n' n'ᵀ/b²,  v_k = L_k⁻¹ Σ n'/b²,  Q = 1/σ_r² + Σ_k (Σ 1/b² − |v_k|²)
    """
    start, row, centre_sd, radius_sd = grains.start, grains.row, grains.centre_sd, grains.radius_sd
    direction, observation, centre_factor = workspace.direction, workspace.observation, workspace.centre_factor
    n, m = len(radius_sd), len(centre_sd)
    for g in range(n):
        workspace.precision[g] = 1.0 / radius_sd[g] ** 2
    for g in range(m):
        xx = 1.0 / centre_sd[g] ** 2
        yy, xy, xr, yr, total = xx, 0.0, 0.0, 0.0, 0.0
        for q in range(start[g], start[g + 1]):
            weight, nx, ny = observation[row[q], 0], direction[q, 0], direction[q, 1]
            xx += weight * nx * nx
            xy += weight * nx * ny
            yy += weight * ny * ny
            xr += weight * nx
            yr += weight * ny
            total += weight
        l11 = math.sqrt(xx)
        l21 = xy / l11
        l22 = math.sqrt(yy - l21 * l21)
        tx = xr / l11
        ty = (yr - l21 * tx) / l22
        centre_factor[g, 0], centre_factor[g, 1], centre_factor[g, 2] = 1.0 / l11, l21, 1.0 / l22
        centre_factor[g, 3], centre_factor[g, 4] = tx, ty
        workspace.precision[g % n] += total - tx * tx - ty * ty


@njit(cache=True, nogil=True, error_model="numpy")
def draw_errors(rng, grains, workspace, state):  # type: ignore[no-untyped-def]
    """Draw the error δ of every radius together with those of its centre, ε_k, in all frames k.

    Notes
    -----
    With r = gap − offset + κ f (bearing) or gap − offset − γ (open), plus the errors of the other grain, each gap is a
    linear observation n'·ε_k + δ = r of standard deviation b. With L, v and Q of `factorize_errors` and
    u_k = L_k⁻¹ Σ n' r/b²,

        δ | rest ~ N(Q⁻¹ Σ_k (Σ r/b² − v_k·u_k), Q⁻¹),  L_kᵀ ε_k = u_k − δ v_k + N(0, I).
    """
    body, start, row = state.body, grains.start, grains.row
    direction, other, observation = workspace.direction, workspace.other, workspace.observation
    centre_factor, precision = workspace.centre_factor, workspace.precision
    n, m = len(precision), len(body)
    mean = np.empty((m // n, 2))  # u of every frame
    for first in range(n):
        linear = 0.0
        for k in range(m // n):
            g = first + k * n
            bx, by = 0.0, 0.0
            for q in range(start[g], start[g + 1]):
                c, o, nx, ny = row[q], other[q], direction[q, 0], direction[q, 1]
                rest = observation[c, 1]
                if o >= 0:
                    rest += nx * body[o, CX] + ny * body[o, CY] - body[o, DELTA]
                rest *= observation[c, 0]
                bx += nx * rest
                by += ny * rest
                linear += rest
            ux = bx * centre_factor[g, 0]
            uy = (by - centre_factor[g, 1] * ux) * centre_factor[g, 2]
            linear -= centre_factor[g, 3] * ux + centre_factor[g, 4] * uy
            mean[k, 0], mean[k, 1] = ux, uy
        delta = linear / precision[first] + rng.standard_normal() / math.sqrt(precision[first])
        for k in range(m // n):
            g = first + k * n
            u = mean[k, 0] - delta * centre_factor[g, 3] + rng.standard_normal()
            v = mean[k, 1] - delta * centre_factor[g, 4] + rng.standard_normal()
            y = v * centre_factor[g, 2]
            body[g, CX], body[g, CY], body[g, DELTA] = (u - centre_factor[g, 1] * y) * centre_factor[g, 0], y, delta
