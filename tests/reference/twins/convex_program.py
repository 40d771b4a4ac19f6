"""The convex program solved by general solvers for cones: Clarabel, by interior points, and SCS, by splitting."""

# clarabel and scs are compiled and ship no types.
# pyright: reportAttributeAccessIssue=false, reportMissingImports=false

from __future__ import annotations

from typing import NamedTuple

import clarabel
import numpy as np
from rodsight.solver.bodies.grains import Array
from rodsight.solver.convex.interior_point_kernels import Program
from scipy import sparse

TOLERANCE = 1e-9
MOST_STEPS = 1_000_000  # of SCS: it takes thousands where interior points take ten


class ConicProgram(NamedTuple):
    """min ½ xᵀ P x + qᵀ x with A x + s = b, the first `equal` of s zero and the others not negative."""

    quadratic: sparse.csc_array
    linear: Array
    constraints: sparse.csc_array
    bound: Array
    equal: int


def conic_program(matrix: sparse.csr_matrix, load: Array, program: Program) -> ConicProgram:
    """State a program; H (m, 2c), b (m,) as in `Balance`. The force residual is a separate variable."""
    c, m = len(program.friction), len(load)
    quadratic = sparse.diags_array(np.repeat([program.proximal_weight, program.equilibrium_weight], [2 * c, m]))
    linear = np.concatenate([(program.cost - program.proximal_weight * program.centre).T.ravel(), np.zeros(m)])
    mu, one = sparse.diags_array(program.friction), sparse.eye_array(c)
    # Without friction the two edges of a cone do not bound f_n, so f_n ≥ 0 has a row of its own.
    cones = sparse.block_array([[-mu, one], [-mu, -one], [-one, None]])
    constraints = sparse.block_array([[matrix, -sparse.eye_array(m)], [cones, None]])
    return ConicProgram(quadratic.tocsc(), linear, constraints.tocsc(), np.concatenate([load, np.zeros(3 * c)]), m)


def solve_with_clarabel(
    matrix: sparse.csr_matrix, load: Array, program: Program, tolerance: float = TOLERANCE
) -> Array:
    """Forces (c, 2) in units of force; H (m, 2c), b (m,) as in `Balance`."""
    stated, c = conic_program(matrix, load, program), len(program.friction)
    options = clarabel.DefaultSettings()
    options.verbose = False
    options.max_threads = 1
    options.tol_feas = options.tol_gap_abs = options.tol_gap_rel = tolerance
    solution = clarabel.DefaultSolver(
        stated.quadratic, stated.linear, stated.constraints, stated.bound,
        [clarabel.ZeroConeT(stated.equal), clarabel.NonnegativeConeT(3 * c)], options,
    ).solve()  # fmt: skip
    assert str(solution.status) == "Solved"
    return np.asarray(solution.x)[: 2 * c].reshape(2, c).T


def solve_with_scs(matrix: sparse.csr_matrix, load: Array, program: Program, tolerance: float) -> Array:
    """Forces (c, 2) in units of force; H (m, 2c), b (m,) as in `Balance`."""
    import scs  # only benchmarks compare with it

    stated, c = conic_program(matrix, load, program), len(program.friction)
    data = {"P": stated.quadratic, "A": stated.constraints, "b": stated.bound, "c": stated.linear}
    options = {"eps_abs": tolerance, "eps_rel": tolerance, "max_iters": MOST_STEPS, "verbose": False}
    solution = scs.SCS(data, {"z": stated.equal, "l": 3 * c}, **options).solve()
    assert solution["info"]["status"] == "solved"
    return np.asarray(solution["x"])[: 2 * c].reshape(2, c).T
