"""The law of one contact: Signorini and Coulomb by projection, and the closed-form single contact.

Scalars only; the loop over contacts (kernels) and the plain reference in the tests use the same lines.
"""

from __future__ import annotations

from numba import njit


@njit(inline="always")
def project_on_cone(fn: float, ft: float, friction: float) -> tuple[float, float]:
    """Project by components on the Coulomb cone (paper, Eq. 2): f_n ≥ 0 first, then |f_t| ≤ μ f_n.

    Branch-free, since sticking and sliding contacts come in no order a processor could predict.
    """
    fn = max(fn, 0.0)
    limit = friction * fn
    return fn, min(max(ft, -limit), limit)


@njit(inline="always")
def relax_contact(
    fn: float, ft: float, un: float, ut: float, inverse_wnn: float, inverse_wtt: float, friction: float
) -> tuple[float, float]:
    """Solve one contact with all others frozen (paper, Eq. 1 and 2).

    fn, ft: present force [N]; un, ut: formal velocity under the present forces [m/s]; inverse_wnn, inverse_wtt:
    1 / W of the diagonal local operator [N s/m]. Returns the force that brings the formal velocity to zero,
    projected on the cone.
    """
    return project_on_cone(fn - un * inverse_wnn, ft - ut * inverse_wtt, friction)
