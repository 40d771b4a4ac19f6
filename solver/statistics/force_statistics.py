"""Distribution of forces: P(f), its tail and plateau, mobilised friction, the strong and the weak network.

Weights (c,) are the probabilities that the contacts bear force.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array
from .weighted import weighted_mean, weights_or_ones

FORCE_EDGES = np.linspace(0.0, 8.0, 33)  # of the bins of P(f), in units of the mean force
FORCE_BINS = len(FORCE_EDGES) - 1
MOBILISATION_EDGES = np.linspace(0.0, 1.0, 21)  # of the bins of the mobilisation
MOBILISATION_BINS = len(MOBILISATION_EDGES) - 1


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value with its standard error."""

    value: float
    standard_error: float


@dataclass(frozen=True, slots=True)
class StrongNetwork:
    """Fractions carried by contacts with more than the mean normal force; the weak network carries the rest.

    Radjai, Wolf, Jean & Moreau 1998, Phys. Rev. Lett. 80, 61.
    """

    contact_fraction: float  # of the contacts with force
    pressure_fraction: float  # of the mean stress
    deviator_fraction: float  # of the stress deviator along σ₁: above 1 where the weak network opposes it


def mean_normal_force(fn: NDArray[np.floating]) -> float:
    """Return the mean f_n of the contacts that bear force [N]; NaN without such contacts."""
    bearing = fn[np.isfinite(fn) & (fn > 0.0)]
    return float(bearing.mean()) if len(bearing) else float("nan")


def force_density(force: Array, weight: Array | None = None) -> Array:
    """Return P(f/⟨f⟩) of non-negative forces (c,) in the bins of FORCE_EDGES (FORCE_BINS,); zero without force.

    The normalisation includes forces beyond the last edge: the density integrates to the fraction within the edges.
    """
    weight = weights_or_ones(weight, len(force))
    mean = weighted_mean(force, weight)
    if mean <= 0:
        return np.zeros(FORCE_BINS)
    counts, _ = np.histogram(force / mean, FORCE_EDGES, weights=weight)
    return counts / (weight.sum() * np.diff(FORCE_EDGES))


def tail_exponent(force: Array, weight: Array | None = None) -> Estimate:
    """Estimate β of P(f) ∝ exp(−β f/⟨f⟩) above the mean by maximum likelihood, of positive forces (c,).

    Returns
    -------
    Estimate
        β and its standard error; NaN where no force is above the mean.

    Notes
    -----
    β = 1 / mean(f/⟨f⟩ − 1) over the forces above the mean. The standard error includes the error of ⟨f⟩ (first order,
    independent forces, exponential tail): about a fifth less than β over the root of the number above the mean.
    """
    weight = weights_or_ones(weight, len(force))
    mean = weighted_mean(force, weight)
    excess = np.maximum(force / mean - 1.0, 0.0) if mean > 0 else np.zeros(0)
    tail = excess > 0
    scale = weighted_mean(excess[tail], weight[tail]) if tail.any() else 0.0  # of the tail over the mean force: 1/β
    if scale < 1e-9:  # forces equal up to rounding have no tail
        return Estimate(float("nan"), float("nan"))
    # Influence of one force on ln β: through ⟨f⟩, and through the scale of the tail if the force is in it.
    fraction = weighted_mean(tail.astype(np.float64), weight)
    influence = force / mean - 1.0 - np.where(tail, excess / scale - 1.0, 0.0) / fraction
    variance = weighted_mean(influence**2, weight) - weighted_mean(influence, weight) ** 2
    return Estimate(1.0 / scale, float(np.sqrt(max(variance, 0.0) / weight.sum()) / scale))


def plateau_ratio(force: Array, weight: Array | None = None) -> Estimate:
    """Return the density of forces below half the mean over that below the mean, of positive forces (c,).

    Returns
    -------
    Estimate
        1 on a plateau of weak forces, 1.24 where the exponential tail extends to zero, 2^−α where P(f) ∝ f^α; NaN where
        no force is below the mean. As a fraction of counts it does not depend on the size of the smallest forces.
    """
    weight = weights_or_ones(weight, len(force))
    mean = weighted_mean(force, weight)
    weak = force < mean
    count = float(weight[weak].sum())
    if count == 0.0:
        return Estimate(float("nan"), float("nan"))
    fraction = weighted_mean((force[weak] < 0.5 * mean).astype(np.float64), weight[weak])
    fraction = min(fraction, 1.0)  # the mean of ones exceeds it by rounding
    return Estimate(2.0 * fraction, 2.0 * float(np.sqrt(fraction * (1.0 - fraction) / count)))


def mobilisation(fn: Array, ft: Array, friction: Array) -> Array:
    """Return |f_t| / (μ f_n) of contacts with force (c,); 1 where μ = 0, as any contact is at its limit."""
    limit = friction * fn
    held = limit > 0
    return np.where(held, np.abs(ft) / np.where(held, limit, 1.0), 1.0)


def mobilisation_density(mobilised: Array, weight: Array | None = None, sliding: Array | None = None) -> Array:
    """Return the density of the mobilisation (c,) in the bins of MOBILISATION_EDGES; zero without contacts.

    sliding (c,): P(sliding), counted in the last bin, as are values above 1, which a different friction gives.
    """
    weight, sliding = weights_or_ones(weight, len(mobilised)), np.zeros(len(mobilised)) if sliding is None else sliding
    total = float(weight.sum())
    if total == 0.0:
        return np.zeros(MOBILISATION_BINS)
    counts, _ = np.histogram(np.minimum(mobilised, 1.0), MOBILISATION_EDGES, weights=weight * (1.0 - sliding))
    counts[-1] += weight @ sliding
    return counts / (total * np.diff(MOBILISATION_EDGES))


def strong_network(fn: Array, force: Array, branch: Array, weight: Array | None = None) -> StrongNetwork:
    """Compute the fractions carried by the strong network.

    Parameters
    ----------
    fn : (c,)
        Normal forces of contacts with force [N].
    force : (c, 2)
        Forces that i exerts on j [N].
    branch : (c, 2)
        Branch vectors [m].
    weight : (c,), optional
        P(bears force); 1 by default.

    Returns
    -------
    StrongNetwork
        Zeros without contacts.
    """
    if len(fn) == 0:
        return StrongNetwork(0.0, 0.0, 0.0)
    weight = weights_or_ones(weight, len(fn))
    strong = fn > weighted_mean(fn, weight)
    moment = np.einsum("ca,cb->cab", force, branch)
    total, part = moment.sum(axis=0), moment[strong].sum(axis=0)
    pressure, deviator = np.trace(total), _deviator(total)
    size = float(deviator @ deviator)
    return StrongNetwork(
        contact_fraction=weighted_mean(strong.astype(np.float64), weight),
        pressure_fraction=float(np.trace(part) / pressure) if pressure > 0 else 0.0,
        # The threshold relative to the pressure excludes the rounding errors of an isotropic state.
        deviator_fraction=float(_deviator(part) @ deviator) / size if size > (1e-9 * pressure) ** 2 else 0.0,
    )


def _deviator(tensor: Array) -> Array:
    """Return (t_xx − t_yy, t_xy + t_yx): at twice the principal angle, with the principal difference as its length."""
    return np.array([tensor[0, 0] - tensor[1, 1], tensor[0, 1] + tensor[1, 0]])
