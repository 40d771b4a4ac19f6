"""Means and quantiles over contacts weighted by their probability to bear force or to touch."""

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


def weighted_median(value: Array, weight: Array) -> float:
    """Return the value (c,) up to which half of the weight (c,) lies; Σ w > 0."""
    return weighted_quantile(value, weight, 0.5)


def weighted_quantile(value: Array, weight: Array, part: float) -> float:
    """Return the value (c,) up to which a part of the weight (c,) lies; Σ w > 0."""
    order = np.argsort(value)
    total = np.cumsum(weight[order])
    return float(value[order[np.searchsorted(total, part * total[-1])]])
