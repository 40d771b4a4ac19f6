"""Copies of arrays in kernels.

`target[:] = source` would compile the text of the error on unequal shapes, which takes seconds.
"""

from __future__ import annotations

from numba import njit


@njit(inline="always")
def copy_vector(source, target):  # type: ignore[no-untyped-def]
    """Copy an array (n,) to another of its shape."""
    for k in range(len(source)):
        target[k] = source[k]


@njit(inline="always")
def copy_matrix(source, target):  # type: ignore[no-untyped-def]
    """Copy an array (n, m) to another of its shape."""
    for k in range(source.shape[0]):
        for m in range(source.shape[1]):
            target[k, m] = source[k, m]
