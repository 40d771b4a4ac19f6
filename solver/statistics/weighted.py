"""Means over contacts weighted by their probability to bear force."""

from __future__ import annotations

import numpy as np

from ..bodies.grains import Array


def weights_or_ones(weight: Array | None, count: int) -> Array:
    """Return the given weights (c,), or ones for `count` contacts."""
    return np.ones(count) if weight is None else weight


def weighted_mean(value: Array, weight: Array) -> float:
    """Return Σ w x / Σ w of values (c,) and weights (c,); 0 where Σ w = 0."""
    total = float(weight.sum())
    return float(weight @ value) / total if total > 0 else 0.0
