"""The contact law: Signorini and Coulomb conditions by projection, and the closed-form solution of a single contact."""

from __future__ import annotations

from numba import njit


@njit(inline="always")
def project_on_cone(fn: float, ft: float, friction: float) -> tuple[float, float]:
    """Project onto the Coulomb cone by components (paper, Eq. 2): first f_n ≥ 0, then |f_t| ≤ μ f_n.

    The projection is branch-free, because the sequence of sticking and sliding contacts is unpredictable.
    """
    fn = max(fn, 0.0)
    limit = friction * fn
    return fn, min(max(ft, -limit), limit)


@njit(inline="always")
def relax_contact(
    fn: float, ft: float, un: float, ut: float, inverse_wnn: float, inverse_wtt: float, friction: float
) -> tuple[float, float]:
    """Solve one contact with the forces of all others fixed (paper, Eq. 1 and 2).

    Parameters
    ----------
    fn, ft : float
        Present force [N].
    un, ut : float
        Formal velocity under the present forces [m/s].
    inverse_wnn, inverse_wtt : float
        1 / W of the diagonal local operator [N s/m].
    friction : float
        μ.

    Returns
    -------
    tuple of float
        Force (f_n, f_t) [N].

    Notes
    -----
    f_new = P(f − W⁻¹ u): the force that makes the formal velocity zero, projected onto the Coulomb cone.
    """
    return project_on_cone(fn - un * inverse_wnn, ft - ut * inverse_wtt, friction)
