"""Main effects from a space-filling design: the fraction of a result's variance that each factor makes by itself.

An additive model, a parabola for each factor, is fitted to the runs by least squares; the variance of a factor's
parabola over the total variance is its first-order Sobol index (Sobol 1993). With so few coefficients it needs far
fewer runs than the definition by nested sampling. The residual of the model contains interactions and chance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..solver.bodies.grains import Array


@dataclass(frozen=True, slots=True)
class MainEffects:
    """Main effects of d factors on one result."""

    index: Array  # (d,) fraction of the variance, 0 … 1
    change: Array  # (d,) of the result from a factor's low end to its high end
    explained: float  # fraction of the variance that the model explains, adjusted for its number of coefficients


def main_effects(unit: Array, result: Array) -> MainEffects:
    """Fit the additive model to n runs.

    Parameters
    ----------
    unit : ndarray, shape (n, d)
        Every factor mapped from its range to [0, 1].
    result : ndarray, shape (n,)

    Returns
    -------
    MainEffects
        All zero for a result that does not vary.

    Raises
    ------
    ValueError
        There are fewer than the 2 d + 2 runs that the fit needs.

    Notes
    -----
    y = ȳ + Σ_i g_i(x_i), g_i of Legendre polynomials of degree 1 and 2; S_i = Var g_i / Var y;
    explained: 1 − [SSR/(n − 2d − 1)] / [SST/(n − 1)].
    """
    n, d = unit.shape
    if n < 2 * d + 2:
        raise ValueError(f"{n} runs are too few for {d} factors")
    centred = result - result.mean()
    variance = float(centred @ centred) / n
    if variance <= np.finfo(float).eps * float(np.mean(result**2)):
        return MainEffects(np.zeros(d), np.zeros(d), 0.0)
    # Legendre polynomials on [0, 1]: orthogonal, so that the terms of one factor are independent.
    x = 2.0 * unit - 1.0
    terms = np.stack([x, 1.5 * x**2 - 0.5], axis=2).reshape(n, 2 * d)
    mean = terms.mean(axis=0)
    coefficients = np.linalg.lstsq(terms - mean, centred, rcond=None)[0]
    part = ((terms - mean) * coefficients).reshape(n, d, 2).sum(axis=2)
    rest = float(np.sum((centred - part.sum(axis=1)) ** 2))
    explained = 1.0 - rest / (n - 2 * d - 1) / (variance * n / (n - 1))
    index = part.var(axis=0) / variance
    return MainEffects(np.clip(index, 0.0, 1.0), 2.0 * coefficients[::2], float(max(explained, 0.0)))
