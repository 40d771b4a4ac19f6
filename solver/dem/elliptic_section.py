"""Contacts of rods whose section is slightly elliptic, to first order in the ovality.

The section of grain k is r_k(φ) = R_k (1 + e cos 2(φ − α_k)), α_k = θ_k + its axis at rotation zero, e the ovality; the
semi-axes are R (1 ± e), an ellipse but for terms of e².

Let φ be the direction of the branch vector from i to j and d its length. Two smooth convex sections touch where their
outward normals are opposite: at polar angles φ + a of i and φ + b + π of j, with the common normal at the angle
φ + a − r_i'/R_i = φ + b − r_j'/R_j and with R_i a + R_j b = 0, because both points lie on the line of the branch
vector to first order. Hence the gap is

    g = d − r_i(φ) − r_j(φ + π) + O(e²),

the normal is turned against the branch vector by −τ, τ = (r_i' + r_j') / d, and the arms from the centres to the point
of contact are r_i n + r_i' t and −(r_j n + r_j' t). With a flat wall in place of j the normal is the wall's and
g = distance − r_i(φ of that normal). The same n and arms are the gradient of −g, so that the potential energy of a
contact is k_n g² / 2 and that linear and angular momentum are kept exactly:

    n = (e_φ − τ e_φ+90°) / s,   s = √(1 + τ²),   f_n = k_n s (−g),
    torque on i = (r_i' f_n − r_i f_t) / s,   torque on j = (r_j' f_n − r_j f_t) / s,
    u_n = n·(v_j − v_i) + (r_i' ω_i + r_j' ω_j) / s = ġ / s,   u_t = t·(v_j − v_i) − (r_i ω_i + r_j ω_j) / s.

s = 1 + O(e²). The contact of two convex sections by common normals is that of Lin & Ng (1995) and of Rothenburg &
Bathurst (1991), who derive the force and the moment of ellipses from it; the expansion is ours.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def elliptic_radius(radius: float, ovality: float, angle: float, nx: float, ny: float) -> tuple[float, float]:
    """Return r and dr/dφ [m] of a section of mean radius [m] in the direction ±(nx, ny).

    angle [rad]: direction of its greatest radius.
    """
    cosine, sine = np.cos(2.0 * angle), np.sin(2.0 * angle)
    even, odd = nx * nx - ny * ny, 2.0 * nx * ny  # cos 2φ, sin 2φ
    wave = radius * ovality
    return radius + wave * (even * cosine + odd * sine), -2.0 * wave * (odd * cosine - even * sine)


@njit(cache=True)
def tilted_normal(nx: float, ny: float, tilt: float) -> tuple[float, float, float]:
    """Return a unit vector turned by −arctan(tilt), and cos of that angle."""
    cosine = 1.0 / np.sqrt(1.0 + tilt * tilt)
    return cosine * (nx + tilt * ny), cosine * (ny - tilt * nx), cosine
