"""How forces are distributed: P(f), its tail and plateau, mobilised friction, the strong and the weak network.

Weights (c,) are the probabilities that the contacts bear force: what is doubtful counts as much as it is likely.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.statistics.weighted import weighted_mean, weights_of

FORCE_EDGES = np.linspace(0.0, 8.0, 33)  # of the bins of P(f), in units of the mean force
FORCE_BINS = len(FORCE_EDGES) - 1
MOBILISATION_EDGES = np.linspace(0.0, 1.0, 21)  # of the bins of the mobilisation
MOBILISATION_BINS = len(MOBILISATION_EDGES) - 1


@dataclass(frozen=True, slots=True)
class Estimate:
    """A number and how well it is known."""

    value: float
    standard_error: float


@dataclass(frozen=True, slots=True)
class StrongNetwork:
    """What the contacts with more than the mean normal force carry; the weak network has the rest.

    Radjai, Wolf, Jean & Moreau 1998, Phys. Rev. Lett. 80, 61.
    """

    contact_share: float  # of the contacts with force
    pressure_share: float  # of the mean stress
    deviator_share: float  # of the stress deviator along σ₁: above 1 where the weak network opposes it


def mean_normal_force(fn: NDArray[np.floating]) -> float:
    """Mean f_n of the contacts that bear force [N]; NaN where none does."""
    bearing = fn[np.isfinite(fn) & (fn > 0.0)]
    return float(bearing.mean()) if len(bearing) else float("nan")


def force_density(force: Array, weight: Array | None = None) -> Array:
    """P(f/⟨f⟩) of non-negative forces (c,) in the bins of FORCE_EDGES (FORCE_BINS,); zero without force.

    Forces beyond the last edge count in the normalisation, so that the density sums to the share within the edges.
    """
    weight = weights_of(weight, len(force))
    mean = weighted_mean(force, weight)
    if mean <= 0:
        return np.zeros(FORCE_BINS)
    counts, _ = np.histogram(force / mean, FORCE_EDGES, weights=weight)
    return counts / (weight.sum() * np.diff(FORCE_EDGES))


def tail_exponent(force: Array, weight: Array | None = None) -> Estimate:
    """β of P(f) ∝ exp(−β f/⟨f⟩) above the mean, by maximum likelihood, of positive forces (c,).

    β = 1 / mean(f/⟨f⟩ − 1) over the forces above the mean. The standard error counts the error of ⟨f⟩ too (first
    order, independent forces, a tail that is exponential): about a fifth less than β over the root of the number
    above the mean. NaN where no force is above the mean.
    """
    weight = weights_of(weight, len(force))
    mean = weighted_mean(force, weight)
    excess = np.maximum(force / mean - 1.0, 0.0) if mean > 0 else np.zeros(0)
    tail = excess > 0
    scale = weighted_mean(excess[tail], weight[tail]) if tail.any() else 0.0  # of the tail, over the mean force: 1/β
    if scale < 1e-9:  # forces that are equal but for rounding have no tail
        return Estimate(float("nan"), float("nan"))
    # What one force more does to ln β: it moves ⟨f⟩, and the scale of the tail if it is in it.
    share = weighted_mean(tail.astype(np.float64), weight)
    influence = force / mean - 1.0 - np.where(tail, excess / scale - 1.0, 0.0) / share
    variance = weighted_mean(influence**2, weight) - weighted_mean(influence, weight) ** 2
    return Estimate(1.0 / scale, float(np.sqrt(max(variance, 0.0) / weight.sum()) / scale))


def plateau_ratio(force: Array, weight: Array | None = None) -> Estimate:
    """Density of forces below half the mean over that of all forces below the mean, of positive forces (c,).

    1 on a plateau of weak forces, 1.24 where the exponential tail goes on to zero, 2^−α where P(f) ∝ f^α. A share of
    a count, it does not care how small the smallest forces are. NaN where no force is below the mean.
    """
    weight = weights_of(weight, len(force))
    mean = weighted_mean(force, weight)
    weak = force < mean
    count = float(weight[weak].sum())
    if count == 0.0:
        return Estimate(float("nan"), float("nan"))
    share = weighted_mean((force[weak] < 0.5 * mean).astype(np.float64), weight[weak])
    return Estimate(2.0 * share, 2.0 * float(np.sqrt(share * (1.0 - share) / count)))


def mobilisation(fn: Array, ft: Array, friction: Array) -> Array:
    """|f_t| / (μ f_n) of contacts with force (c,); 1 without friction, where any contact is at its limit."""
    limit = friction * fn
    held = limit > 0
    return np.where(held, np.abs(ft) / np.where(held, limit, 1.0), 1.0)


def mobilisation_density(mobilised: Array, weight: Array | None = None, slides: Array | None = None) -> Array:
    """Density of the mobilisation (c,) in the bins of MOBILISATION_EDGES (MOBILISATION_BINS,); zero without contacts.

    slides (c,): P(slides), which counts in the last bin, as do values above 1, which another friction leaves.
    """
    weight, slides = weights_of(weight, len(mobilised)), np.zeros(len(mobilised)) if slides is None else slides
    total = float(weight.sum())
    if total == 0.0:
        return np.zeros(MOBILISATION_BINS)
    counts, _ = np.histogram(np.minimum(mobilised, 1.0), MOBILISATION_EDGES, weights=weight * (1.0 - slides))
    counts[-1] += weight @ slides
    return counts / (total * np.diff(MOBILISATION_EDGES))


def strong_network(fn: Array, force: Array, branch: Array, weight: Array | None = None) -> StrongNetwork:
    """Shares of the strong network.

    fn (c,) [N] of contacts with force; force (c, 2) [N]; branch (c, 2) [m]. Shares of nothing are 0.
    """
    if len(fn) == 0:
        return StrongNetwork(0.0, 0.0, 0.0)
    weight = weights_of(weight, len(fn))
    strong = fn > weighted_mean(fn, weight)
    moment = np.einsum("ca,cb->cab", force, branch)
    total, part = moment.sum(axis=0), moment[strong].sum(axis=0)
    pressure, deviator = np.trace(total), _deviator(total)
    size = float(deviator @ deviator)
    return StrongNetwork(
        contact_share=weighted_mean(strong.astype(np.float64), weight),
        pressure_share=float(np.trace(part) / pressure) if pressure > 0 else 0.0,
        # Relative to the pressure, so that the deviator of an isotropic state is not a share of rounding errors.
        deviator_share=float(_deviator(part) @ deviator) / size if size > (1e-9 * pressure) ** 2 else 0.0,
    )


def _deviator(tensor: Array) -> Array:
    """(t_xx − t_yy, t_xy + t_yx): its direction is twice the principal one, its length the principal difference."""
    return np.array([tensor[0, 0] - tensor[1, 1], tensor[0, 1] + tensor[1, 0]])
