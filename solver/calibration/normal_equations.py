"""Normal equations of gaps, factorised."""

from __future__ import annotations

from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu

from solver.bodies.grains import Array


def factor_normal(matrix: sparse.csr_matrix, precision: Array, penalty: Array) -> SuperLU:
    """Factorise Aᵀ P A + D: derivatives A (m, u) of the gaps, their precision (m,), penalties (u,) of the unknowns.

    Pairs of neighbours make an almost planar graph, where a direct factorisation is cheap and exact. What is coupled
    with all grains is left to the end by the ordering by degree.
    """
    normal = matrix.T @ matrix.multiply(precision[:, None]).tocsr() + sparse.diags_array(penalty)
    return splu(
        sparse.csc_matrix(normal), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
