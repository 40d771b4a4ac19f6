"""Contact law of the discrete-element simulation: linear springs with dashpots, cut at the friction limit.

The force of contact (i, j) is the one that i exerts on j: f_n along the normal n from i to j, f_t along t, which is n
rotated by +90°. Relative velocities are those of j relative to i.
"""

from __future__ import annotations

from typing import NamedTuple

from numba import njit

from ..bodies.grains import Array


class Law(NamedTuple):
    """Constants of the contact law and of the time integration."""

    time_step: float  # [s]
    normal_stiffness: float  # [N/m]
    tangential_stiffness: float  # [N/m]
    tangential_damping: float  # –, tangential over normal dashpot
    friction: float
    wall_friction: float
    rolling_friction: float  # greatest rolling moment over f_n and the rolling radius
    adhesion: float  # [N], attraction of closed contacts
    ovality: float  # e of elliptic sections with semi-axes R (1 ± e)
    drag: float  # [1/s], preparation only
    gravity_x: float  # [m/s²]
    gravity_y: float


@njit(cache=True)
def contact_force(
    overlap: float, un: float, ut: float, damping: float, spring: float, friction: float, law: Law
) -> tuple[float, float, float]:
    """Return f_n, f_t [N] and the new tangential spring [N] of a closed contact.

    Notes
    -----
    f_n = max(k_n δ − c u_n, 0) − a; the spring s changes by −k_t u_t Δt, f_t = s − r c u_t, and both are cut at
    |f_t| = μ (f_n + a), a the adhesion (Cundall & Strack 1979).
    """
    fn = law.normal_stiffness * overlap - damping * un
    if fn < 0.0:  # a dashpot does not pull
        fn = 0.0
    spring -= law.tangential_stiffness * ut * law.time_step
    ft = spring - law.tangential_damping * damping * ut
    limit = friction * fn
    if ft > limit:
        ft = limit
        spring = limit
    elif ft < -limit:
        ft = -limit
        spring = -limit
    return fn - law.adhesion, ft, spring


@njit(cache=True)
def rolling_force(fn: float, rolling: float, damping: float, spring: float, law: Law) -> tuple[float, float]:
    """Return the rolling moment on j over the rolling radius [N] and its new spring [N].

    rolling [m/s]: angular velocity of j relative to i, times the rolling radius.
    """
    spring -= law.tangential_stiffness * rolling * law.time_step
    moment = spring - law.tangential_damping * damping * rolling
    limit = law.rolling_friction * fn
    if moment > limit:
        return limit, limit
    if moment < -limit:
        return -limit, -limit
    return moment, spring


@njit(cache=True)
def add_pair_force(
    force: Array, arms: tuple[float, float, float, float], i: int, j: int, nx: float, ny: float, fn: float, ft: float
) -> None:
    """Add f_n, f_t [N] of a contact between grains with normal n from i to j to the forces on both (n, 3).

    arms [m]: of f_t about i and j, then of f_n, which vanish for round sections.
    """
    fx = fn * nx - ft * ny
    fy = fn * ny + ft * nx
    force[j, 0] += fx
    force[j, 1] += fy
    force[j, 2] -= arms[1] * ft - arms[3] * fn
    force[i, 0] -= fx
    force[i, 1] -= fy
    force[i, 2] -= arms[0] * ft - arms[2] * fn


@njit(cache=True)
def add_wall_force(force: Array, arms: tuple[float, float], i: int, nx: float, ny: float, fn: float, ft: float) -> None:
    """Add f_n, f_t [N] of a contact with normal n from grain i to a wall to the force on the grain (n, 3).

    arms [m]: of f_t and of f_n.
    """
    force[i, 0] -= fn * nx - ft * ny
    force[i, 1] -= fn * ny + ft * nx
    force[i, 2] -= arms[0] * ft - arms[1] * fn
