"""Rows of a sample: evenly spaced, the first and the last included."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def even_subset(count: int, most: int) -> NDArray[np.int64]:
    """Return at most `most` of the numbers 0 … count − 1, ascending; none of none."""
    if count <= 0 or most <= 0:
        return np.zeros(0, np.int64)
    return np.unique(np.linspace(0, count - 1, min(most, count)).round().astype(np.int64))
