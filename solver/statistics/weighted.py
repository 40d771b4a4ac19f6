"""Means in which every contact counts as it is likely to bear force."""

from __future__ import annotations

import numpy as np

from solver.bodies.grains import Array


def weights_of(weight: Array | None, count: int) -> Array:
    """The weights (c,) given, or one for each of `count` contacts."""
    return np.ones(count) if weight is None else weight


def weighted_mean(value: Array, weight: Array) -> float:
    """Mean of values (c,) by weights (c,); 0 without any."""
    total = float(weight.sum())
    return float(weight @ value) / total if total > 0 else 0.0
