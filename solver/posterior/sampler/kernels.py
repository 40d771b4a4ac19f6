"""The Gibbs sampler: contact by contact, then centre by centre, then what all share.

Lengths in mean diameters, forces in force units, torques over the mean radius. With ε the error of a centre and δ how
much a radius is too small, h = gap − offset − n·(ε_j − ε_i) − δ_i − δ_j is the height of a pair over contact. With w
of a grain 1/s², or zero where its balance is not known, minus the logarithm of the posterior is the sum of

    balance   Σ_i w_i/2 (|ΣF|² + (ΣM)²) + Σ_groups w/2 (Σ f_n − load)²
    bears     (h + κ f)²/(2 b²) + t²/(2 τ²) + λ f,  0 ≤ f,  |t| ≤ μ f
    open      (h − γ)²/(2 b²) + γ/ℓ,  0 ≤ γ
    gauge     K/(2 c) (Σ_bears (f − 1))² + K/(2 c) (Σ z − Σ P)²

with b² larger by the square of an error that a pair's gap has for itself.
"""

from __future__ import annotations

from numba import njit

from solver.posterior.sampler.common_draws import draw_common, draw_scale
from solver.posterior.sampler.contact_draws import draw_contacts, weigh_contacts
from solver.posterior.sampler.error_draws import draw_errors, factorize_errors
from solver.posterior.sampler.records import CX, Law


@njit(cache=True, nogil=True)
def run(rng, pairs, centres, laws, state, room, kept, sums):  # type: ignore[no-untyped-def]
    """Sweep once for each row of `laws` (sweeps, 11), the last `kept` of which are added to the sums.

    Everything is drawn once a sweep, in the order of the pairs, then of the grains.
    sums: of bears, z f, z t, (z f)², (z t)² (c, 5), of ε, δ and δ² (m, 4), of κ, κ², offset, offset² (4,).
    """
    burnt = len(laws) - kept
    for k in range(len(laws)):
        a = laws[k]
        law = Law(a[0], a[1], a[2], a[3], a[4], a[5], a[6], a[7], a[8], a[9], a[10])
        if k == 0 or (a != laws[k - 1]).any():
            weigh_contacts(pairs, centres, law, room)
            factorize_errors(centres, law, room)
        draw_contacts(rng, pairs, centres.group_load, law, room, state)
        draw_errors(rng, centres, room, state)
        draw_common(rng, pairs, law, room, state)
        draw_scale(rng, pairs, centres, law, state)
        if k >= burnt:
            _add(state, sums)


@njit(cache=True, nogil=True)
def _add(state, sums):  # type: ignore[no-untyped-def]
    by_pair, by_grain, shared = sums
    bears, fn, ft, body = state.bears, state.fn, state.ft, state.body
    for c in range(len(bears)):
        if bears[c]:
            f, t = fn[c], ft[c]
            by_pair[c, 0] += 1.0
            by_pair[c, 1] += f
            by_pair[c, 2] += t
            by_pair[c, 3] += f * f
            by_pair[c, 4] += t * t
    for g in range(len(by_grain)):
        for q in range(3):
            by_grain[g, q] += body[g, CX + q]
        by_grain[g, 3] += body[g, CX + 2] ** 2
    for q in range(2):
        shared[2 * q] += state.common[q]
        shared[2 * q + 1] += state.common[q] ** 2
