"""Fabric: how contact directions, branch vectors and forces are distributed over directions."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from solver.bodies.grains import Array
from solver.statistics.weighted import weighted_mean, weights_of

DEGENERATE = 1e-6  # variance of cos 2θ or sin 2θ below which directions cannot tell an amplitude from a mean


@dataclass(frozen=True, slots=True)
class Harmonic:
    """The second harmonic of a quantity over directions: mean (1 + amplitude cos 2(θ − direction))."""

    mean: float  # over directions, not over contacts; in the unit of the quantity
    amplitude: float  # ≥ 0; NaN where the mean is not positive
    direction: float  # [rad] in (−π/2, π/2]

    def along(self, direction: float) -> float:
        """The amplitude as seen along a direction [rad]: negative where it is greatest across it."""
        return self.amplitude * float(np.cos(2.0 * (self.direction - direction)))


@dataclass(frozen=True, slots=True)
class Anisotropies:
    """The anisotropies that make up the strength of a packing (Rothenburg & Bathurst 1989, Géotechnique 39, 601).

    Over directions θ: density of contacts (1 + a_c cos 2(θ − θ_c)) / 2π, mean branch length
    ℓ₀ (1 + a_l cos 2(θ − θ_l)), mean normal force f₀ (1 + a_n cos 2(θ − θ_n)) and mean tangential force
    −f₀ a_t sin 2(θ − θ_t).
    """

    contact: Harmonic  # a_c; its mean is 1
    branch: Harmonic  # a_l, [m]
    normal: Harmonic  # a_n, [N]
    tangential: Harmonic  # a_t; its mean is the f₀ of the normal forces [N]

    def sine_of_friction_angle(self, direction: float) -> float:
        """(σ₁ − σ₂) / (σ₁ + σ₂) that the anisotropies add up to, along σ₁ [rad].

        ½ (a_c + a_l + a_n + a_t) over 1 + ½ (a_c a_n + a_c a_l + a_l a_n), which is Rothenburg & Bathurst's
        ½ (a_c + a_n + a_t) / (1 + ½ a_c a_n) with the branches' part. Products of three are neglected.
        """
        scalars = (self.contact, self.branch, self.normal)
        total = sum(each.along(direction) for each in (*scalars, self.tangential))
        products = sum(a.amplitude * b.along(a.direction) for a, b in combinations(scalars, 2))
        return 0.5 * total / (1.0 + 0.5 * products)


def contact_fabric(normal: Array, weight: Array | None = None) -> Array:
    """Second-order fabric tensor (2, 2): mean of n ⊗ n over contacts (c, 2) by weight (c,); isotropic without any."""
    weight = weights_of(weight, len(normal))
    total = float(weight.sum())
    return (normal.T * weight) @ normal / total if total > 0 else 0.5 * np.eye(2)


def fabric_anisotropy(fabric: Array) -> float:
    """a = 2 (F₁ − F₂), the amplitude of the distribution E(θ) = (1 + a cos 2(θ − θ_F)) / 2π."""
    minor, major = np.linalg.eigvalsh(0.5 * (fabric + fabric.T))
    return float(2.0 * (major - minor))


def anisotropies(normal: Array, branch: Array, fn: Array, ft: Array, weight: Array | None = None) -> Anisotropies:
    """Anisotropies of the contacts given.

    normal (c, 2) from i to j; branch (c, 2) [m] centre to centre; fn, ft (c,) [N] that i exerts on j; weight (c,): how
    likely each bears force.
    """
    weight = weights_of(weight, len(normal))
    force = value_harmonic(normal, fn, weight)
    return Anisotropies(
        contact=contact_harmonic(normal, weight),
        branch=value_harmonic(normal, np.linalg.norm(branch, axis=1), weight),
        normal=force,
        tangential=tangential_harmonic(normal, ft, force.mean, weight),
    )


def contact_harmonic(normal: Array, weight: Array | None = None) -> Harmonic:
    """Second harmonic of the density of contact directions (c, 2), over the isotropic density."""
    weight = weights_of(weight, len(normal))
    cosine, sine = _double_angle(normal)
    return _harmonic(1.0, 2.0 * weighted_mean(cosine, weight), 2.0 * weighted_mean(sine, weight))


def value_harmonic(normal: Array, value: Array, weight: Array | None = None) -> Harmonic:
    """Second harmonic of a positive quantity (c,) over the directions (c, 2) of the contacts that carry it.

    Least squares over contacts, so that neither uneven nor missing directions bias it; the mean of the quantity and
    its mean over n ⊗ n are kept exactly. Directions along one axis only have no amplitude.
    """
    weight = weights_of(weight, len(normal))
    cosine, sine = _double_angle(normal)
    design = np.stack([cosine - weighted_mean(cosine, weight), sine - weighted_mean(sine, weight)], axis=1)
    x, y = _least_squares(design, value, weight)
    mean = weighted_mean(value, weight) - x * weighted_mean(cosine, weight) - y * weighted_mean(sine, weight)
    return _harmonic(mean, x, y)


def tangential_harmonic(normal: Array, ft: Array, mean_force: float, weight: Array | None = None) -> Harmonic:
    """a_t of tangential forces ft (c,) [N], which follow −f₀ a_t sin 2(θ − θ_t) over directions; mean_force is f₀ [N].

    Least squares over contacts. Tangential forces have no mean over directions: a grain in balance has no torque.
    """
    weight = weights_of(weight, len(normal))
    cosine, sine = _double_angle(normal)
    # −sin 2(θ − θ_t) = cos 2θ_t (−sin 2θ) + sin 2θ_t (cos 2θ)
    x, y = _least_squares(np.stack([-sine, cosine], axis=1), ft, weight)
    return _harmonic(mean_force, x, y)


def _double_angle(normal: Array) -> tuple[Array, Array]:
    """cos 2θ and sin 2θ (c,) of unit vectors: the same for n and −n."""
    x, y = normal[:, 0], normal[:, 1]
    return x * x - y * y, 2.0 * x * y


def _least_squares(design: Array, value: Array, weight: Array) -> tuple[float, float]:
    """Two coefficients of smallest norm; a combination of columns that hardly varies gets none."""
    total = max(float(weight.sum()), np.finfo(np.float64).tiny)
    variance, axes = np.linalg.eigh((design.T * weight) @ design / total)
    seen = variance > DEGENERATE
    slope = axes.T @ ((design.T * weight) @ value / total)
    x, y = axes @ np.where(seen, slope / np.where(seen, variance, 1.0), 0.0)
    return float(x), float(y)


def _harmonic(mean: float, x: float, y: float) -> Harmonic:
    """From mean + x cos 2θ + y sin 2θ."""
    amplitude = float(np.hypot(x, y))
    if amplitude == 0.0:
        return Harmonic(mean, 0.0, 0.0)
    direction = 0.5 * float(np.arctan2(y, x))
    return Harmonic(mean, amplitude / mean if mean > 0 else float("nan"), direction)
