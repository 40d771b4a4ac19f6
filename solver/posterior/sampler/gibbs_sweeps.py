"""The sweeps of the Gibbs sampler: pairs by blocks, grains by blocks, then the unknowns that all share.

Notes
-----
Lengths are in mean diameters, forces in force units, torques in force units times the mean radius. Unknowns: z whether
a pair bears force, its forces f and t (z = 1) or true gap γ (z = 0); ε the error of a centre (measured minus true), δ
of a radius (true minus given); κ the overlap per force; o the error that all gaps share. With P the prior probability
of z = 1, c the number of pairs, b² = gap_law_sd² + gap_sd², w = 1/s² and w_i = w times the balance weight of grain i,

    h = gap − o − n·(ε_j − ε_i) − δ_i − δ_j

is the corrected gap, and minus the logarithm of the posterior is the sum of

    balance   Σ_i w_i/2 (|ΣF_i|² + (ΣM_i)²) + Σ_groups w/2 (Σ f − L)²
    bearing   (h + κ f)²/(2 b²) + λ f + t²/(2 τ²) + ln(√(2π) τ) − ln P,   f ≥ 0, |t| ≤ μ f
    open      (h − γ)²/(2 b²) + γ/ℓ + ln ℓ − ln(1 − P),                   γ ≥ 0
    pressure  Σ_i v_i/2 (Σ f − p_i)², p_i the measured sum of the normal forces on grain i, v_i its inverse variance
    errors    Σ |ε|²/(2 σ_c²) + Σ δ²/(2 σ_r²) + o²/(2 σ_o²) + (κ − κ_0)²/(2 σ_κ²),   κ ≥ 0
    gauge     K/(2c) (Σ z (f − 1))² + K_N/(2c) (Σ z − Σ P)²

with t and its terms only where μ > 0, and K = 0 where a load or weight determines the scale of forces.
"""

from __future__ import annotations

from numba import njit

from .common_draws import draw_common, draw_scale
from .contact_draws import draw_contacts, weigh_pairs
from .error_draws import draw_errors, factorize_errors
from .records import ModelParameters
from .state import CX, NORMAL_SUM


@njit(cache=True, nogil=True)
def run(chain, schedule, kept, sums):  # type: ignore[no-untyped-def]
    """Run one sweep for each row of the schedule (sweeps, 11) and add up the last `kept` states.

    A sweep draws (z, f, t, γ) of the pairs, (δ, ε) of the grains, κ, o, and the scale of forces. sums out: of z, z f,
    z t, (z f)², (z t)² (p, 5) in the places of the blocks; of ε, δ, δ², Σ f and (Σ f)² (m, 6); of κ, κ², o, o² (4,).
    """
    discarded = len(schedule) - kept
    for k in range(len(schedule)):
        a = schedule[k]
        model = ModelParameters(a[0], a[1], a[2], a[3], a[4], a[5], a[6], a[7], a[8], a[9], a[10])
        if k == 0 or (a != schedule[k - 1]).any():
            weigh_pairs(chain, model)
            factorize_errors(chain)
        draw_contacts(chain, model)
        draw_errors(chain)
        draw_common(chain, model)
        draw_scale(chain, model)
        if k >= discarded:
            _add(chain.state, sums)


@njit(cache=True, nogil=True)
def _add(state, sums):  # type: ignore[no-untyped-def]
    by_pair, by_grain, shared = sums
    bearing, fn, ft, force, error = state.bearing, state.fn, state.ft, state.force, state.error
    for c in range(len(bearing)):
        f, t = fn[c], ft[c]
        by_pair[c, 0] += bearing[c]
        by_pair[c, 1] += f
        by_pair[c, 2] += t
        by_pair[c, 3] += f * f
        by_pair[c, 4] += t * t
    for g in range(len(by_grain)):
        for q in range(3):
            by_grain[g, q] += error[g, CX + q]
        by_grain[g, 3] += error[g, CX + 2] ** 2
        by_grain[g, 4] += force[g, NORMAL_SUM]
        by_grain[g, 5] += force[g, NORMAL_SUM] ** 2
    for q in range(2):
        shared[2 * q] += state.common[q]
        shared[2 * q + 1] += state.common[q] ** 2
