"""Main effects from a space-filling design: how much of a result's variance each factor makes by itself.

An additive model, a parabola for each factor, is fitted to the runs by least squares; the variance of a factor's
parabola over the total variance is its first-order Sobol index (Sobol 1993), which on a model of so few coefficients
needs far fewer runs than its definition by nested sampling. What the model leaves are interactions and chance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.bodies.grains import Array


@dataclass(frozen=True, slots=True)
class MainEffects:
    """Of d factors on one result."""

    index: Array  # (d,) share of the variance, 0 … 1
    change: Array  # (d,) of the result from a factor's low end to its high end
    explained: float  # share of the variance that the model explains, adjusted for its number of coefficients


def main_effects(unit: Array, result: Array) -> MainEffects:
    """Fit the additive model to n runs.

    unit (n, d) in [0, 1], place of every factor between its ends; result (n,). A result that does not vary has no
    indices: they are zero. Raises ValueError for fewer runs than the 2 d + 2 that the fit needs.
    """
    n, d = unit.shape
    if n < 2 * d + 2:
        raise ValueError(f"{n} runs are too few for {d} factors")
    centred = result - result.mean()
    variance = float(centred @ centred) / n
    if variance <= np.finfo(float).eps * float(np.mean(result**2)):
        return MainEffects(np.zeros(d), np.zeros(d), 0.0)
    # Legendre polynomials on [0, 1]: orthogonal, so that one factor's terms do not depend on each other.
    x = 2.0 * unit - 1.0
    terms = np.stack([x, 1.5 * x**2 - 0.5], axis=2).reshape(n, 2 * d)
    mean = terms.mean(axis=0)
    coefficients = np.linalg.lstsq(terms - mean, centred, rcond=None)[0]
    part = ((terms - mean) * coefficients).reshape(n, d, 2).sum(axis=2)
    rest = float(np.sum((centred - part.sum(axis=1)) ** 2))
    explained = 1.0 - rest / (n - 2 * d - 1) / (variance * n / (n - 1))
    index = part.var(axis=0) / variance
    return MainEffects(np.clip(index, 0.0, 1.0), 2.0 * coefficients[::2], float(max(explained, 0.0)))
