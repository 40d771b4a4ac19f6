"""Forces from positions, averaged over neighbouring photographs as far as these differ by errors alone.

An error of a position changes which contacts seem to bear, and with them the forces of all contacts around. It is
another one in the next photograph, while most forces are the same. Smoothing the gaps does not remove it: which
contacts bear follows from many gaps together, and from balance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from ..bodies.grains import Array
from ..contacts.pairs import Keys, are_among, join_keys, match_values
from ..posterior.frame_posterior import FramePosterior
from ..posterior.gap_series import MAX_SMOOTHING

WINDOW = 4  # photographs on either side; beyond them weights are below .05
# Photographs apart, up to which changes separate errors from true changes. Up to 3, 5 or 7 are alike in r on seventeen
# simulated packings of soft grains; true changes grow in proportion to time for a few photographs only.
MAX_LAG, FEWEST_LAGS = 3, 2
CALM = 0.4  # quantile of the changes of a window: a jump in its middle is part of half of those over three photographs


def smooth_forces(window: Sequence[FramePosterior], own: int, reviewed: Keys) -> FramePosterior:
    """Average the forces of a photograph with those of its neighbours.

    Parameters
    ----------
    window : sequence of FramePosterior
        Of successive photographs.
    own : int
        Which of them.
    reviewed : Keys
        Pairs that are judged in this photograph: they keep their own forces, since its neighbours do not know of that.

    Returns
    -------
    FramePosterior
        On the pairs of this photograph, with about the sum of f_n that it had; itself where no error shows.

    Notes
    -----
    Forces, their standard deviations and P(bears) are means with the weights of `neighbour_weights`. Variances are
    averaged without the reduction of independent errors: errors that last are the same in all photographs.
    """
    total = np.array([float(each.fn.sum()) for each in window])
    if not (total > 0.0).all():
        return window[own]
    key = join_keys(*(each.contacts.key for each in window))
    force = [match_values(key, each.contacts.key, each.fn, fill=np.nan) for each in window]
    weight = neighbour_weights(np.array(force) / total[:, None], own)
    if weight[own] == 1.0:
        return window[own]
    found, ratio = window[own], total[own] / total
    key = found.contacts.key
    kept = are_among(key, reviewed)

    def average(name: str, factor: Array, power: int = 1) -> Array:
        values = np.array([match_values(key, each.contacts.key, getattr(each, name)) for each in window])
        return np.where(kept, values[own], (factor @ values**power) ** (1.0 / power))

    scaled, squared = weight * ratio, weight * ratio**2
    return replace(
        found, fn=average("fn", scaled), ft=average("ft", scaled), fn_sd=average("fn_sd", squared, 2),
        ft_sd=average("ft_sd", squared, 2), bearing_probability=average("bearing_probability", weight),
    )  # fmt: skip


def neighbour_weights(force: Float[Array, "f c"], own: int) -> Float[Array, " f"]:
    """Compute the weights of successive photographs in the mean force of one of them.

    Parameters
    ----------
    force : (f, c)
        Normal forces over their sum in each photograph; NaN where it does not list a pair.
    own : int
        Photograph whose forces are wanted.

    Returns
    -------
    (f,)
        All for its own forces where the changes over one to three photographs show no error.

    Notes
    -----
    The mean square D_l of changes over l photographs is 2 v + q l, with the variance v of an error that is another one
    in every photograph and the mean square q of a true change: the nugget and the slope of a variogram (G. Matheron,
    Econ. Geol. 58, 1246 (1963)), by non-negative least squares of relative errors, each D_l the quantile 0.4 of those
    of all photographs. With d_k the mean square of the step from photograph k to the next, q_k = max(d_k − 2 v, v/3)
    is the variance of a random walk's step there, which keeps forces apart that jump. The best estimate of its states
    from measured ones has the weights of a row of

        (1 + Σ_k v/q_k e_k e_kᵀ)⁻¹,  e_k = 1 at photograph k + 1, −1 at k, 0 elsewhere.
    """
    frames, weight = len(force), np.eye(len(force))[own]
    lags = min(MAX_LAG, frames - 1)
    if lags < FEWEST_LAGS:
        return weight
    changes = [_mean_squares(force[lag:] - force[:-lag]) for lag in range(1, lags + 1)]
    error = _error_variance(np.array([np.quantile(each, CALM) for each in changes]))
    if not error > 0.0:
        return weight
    smoothing = error / np.maximum(changes[0] - 2.0 * error, error / MAX_SMOOTHING)
    difference = np.diff(np.eye(frames), axis=0)
    return np.linalg.solve(np.eye(frames) + difference.T @ (smoothing[:, None] * difference), weight)


def _error_variance(change: Array) -> float:
    """Extrapolate the mean squares of changes over 1, 2, … photographs to none; half of it is v, at least 0."""
    from scipy.optimize import nnls  # imported here: it is a tenth of all import time

    if not (change > 0.0).all():  # copies of photographs, or no pair that two of them list
        return 0.0
    lag = np.arange(1.0, len(change) + 1.0)
    design = np.column_stack([np.full(len(change), 2.0), lag]) / change[:, None]
    return float(nnls(design, np.ones(len(change)))[0][0])


def _mean_squares(change: Float[Array, "f c"]) -> Float[Array, " f"]:
    """Compute the mean squares of the known changes of every photograph; 0 of none."""
    known = np.isfinite(change)
    return np.sum(np.where(known, change, 0.0) ** 2, axis=1) / np.maximum(known.sum(axis=1), 1)
