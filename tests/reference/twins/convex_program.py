"""The convex program solved by Clarabel, a general interior-point solver for cones."""

# clarabel is compiled and ships no types.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import clarabel
import numpy as np
from rodsight.solver.bodies.grains import Array
from rodsight.solver.convex.interior_point_kernels import Program
from scipy import sparse

TOLERANCE = 1e-9


def solve_with_clarabel(
    matrix: sparse.csr_matrix, load: Array, program: Program, tolerance: float = TOLERANCE
) -> Array:
    """Forces (c, 2) in units of force; H (m, 2c), b (m,) as in `Balance`. The force residual is a separate variable."""
    c, m = len(program.friction), len(load)
    quadratic = sparse.diags_array(np.repeat([program.proximal_weight, program.equilibrium_weight], [2 * c, m]))
    linear = np.concatenate([(program.cost - program.proximal_weight * program.centre).T.ravel(), np.zeros(m)])
    mu, one = sparse.diags_array(program.friction), sparse.eye_array(c)
    # Without friction the two edges of a cone do not bound f_n, so f_n ≥ 0 has a row of its own.
    cones = sparse.block_array([[-mu, one], [-mu, -one], [-one, None]])
    constraints = sparse.block_array([[matrix, -sparse.eye_array(m)], [cones, None]])
    options = clarabel.DefaultSettings()
    options.verbose = False
    options.max_threads = 1
    options.tol_feas = options.tol_gap_abs = options.tol_gap_rel = tolerance
    solution = clarabel.DefaultSolver(
        quadratic.tocsc(), linear, constraints.tocsc(), np.concatenate([load, np.zeros(3 * c)]),
        [clarabel.ZeroConeT(m), clarabel.NonnegativeConeT(3 * c)], options,
    ).solve()  # fmt: skip
    assert str(solution.status) == "Solved"
    return np.asarray(solution.x)[: 2 * c].reshape(2, c).T
