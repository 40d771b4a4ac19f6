"""Work memory of kernels, aligned to a line of the cache.

The functions are inlined, so that the compiler knows that no other array overlaps this memory.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(inline="always")
def aligned_numbers(size):  # type: ignore[no-untyped-def]
    """Allocate `size` numbers of double precision."""
    buffer = np.empty(size + 8)
    start = (-(buffer.ctypes.data >> 3)) & 7
    return buffer[start : start + size]


@njit(inline="always")
def aligned_singles(size):  # type: ignore[no-untyped-def]
    """Allocate `size` numbers of single precision."""
    buffer = np.empty(size + 16, np.float32)
    start = (-(buffer.ctypes.data >> 2)) & 15
    return buffer[start : start + size]
