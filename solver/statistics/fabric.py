"""Fabric: distributions of contacts, branch lengths and forces over directions."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ..bodies.grains import Array
from .weighted import weighted_mean, weights_or_ones

DEGENERATE = 1e-6  # variance of cos 2θ or sin 2θ below which amplitude and mean cannot be separated


@dataclass(frozen=True, slots=True)
class Harmonic:
    """The second harmonic of a quantity over directions: mean (1 + amplitude cos 2(θ − direction))."""

    mean: float  # over directions, not over contacts; in the unit of the quantity
    amplitude: float  # ≥ 0; NaN where the mean is not positive
    direction: float  # [rad] in (−π/2, π/2]

    def along(self, direction: float) -> float:
        """Return the amplitude along a direction [rad]: negative where the maximum is across it."""
        return self.amplitude * float(np.cos(2.0 * (self.direction - direction)))


@dataclass(frozen=True, slots=True)
class Anisotropies:
    """Anisotropies that determine the shear strength of a packing (Rothenburg & Bathurst 1989, Géotechnique 39, 601).

    Over directions θ: density of contacts (1 + a_c cos 2(θ − θ_c)) / 2π, mean branch length
    ℓ₀ (1 + a_l cos 2(θ − θ_l)), mean normal force f₀ (1 + a_n cos 2(θ − θ_n)) and mean tangential force
    −f₀ a_t sin 2(θ − θ_t).
    """

    contact: Harmonic  # a_c; its mean is 1
    branch: Harmonic  # a_l, [m]
    normal: Harmonic  # a_n, [N]
    tangential: Harmonic  # a_t; its mean is the f₀ of the normal forces [N]

    def sine_of_friction_angle(self, direction: float) -> float:
        """Return (σ₁ − σ₂) / (σ₁ + σ₂) from the anisotropies along the direction of σ₁ [rad].

        Notes
        -----
        sin φ = ½ (a_c + a_l + a_n + a_t) / (1 + ½ (a_c a_n + a_c a_l + a_l a_n)), the relation of Rothenburg &
        Bathurst, ½ (a_c + a_n + a_t) / (1 + ½ a_c a_n), extended by the branch lengths, without products of three.
        """
        scalars = (self.contact, self.branch, self.normal)
        total = sum(each.along(direction) for each in (*scalars, self.tangential))
        products = sum(a.amplitude * b.along(a.direction) for a, b in combinations(scalars, 2))
        return 0.5 * total / (1.0 + 0.5 * products)


def contact_fabric(normal: Array, weight: Array | None = None) -> Array:
    """Return the fabric tensor (2, 2), the weighted mean of n ⊗ n over contacts (c, 2); ½ 1 without contacts."""
    weight = weights_or_ones(weight, len(normal))
    total = float(weight.sum())
    return (normal.T * weight) @ normal / total if total > 0 else 0.5 * np.eye(2)


def fabric_anisotropy(fabric: Array) -> float:
    """Return a = 2 (F₁ − F₂), the amplitude of the distribution E(θ) = (1 + a cos 2(θ − θ_F)) / 2π."""
    minor, major = np.linalg.eigvalsh(0.5 * (fabric + fabric.T))
    return float(2.0 * (major - minor))


def anisotropies(normal: Array, branch: Array, fn: Array, ft: Array, weight: Array | None = None) -> Anisotropies:
    """Compute the anisotropies of contacts.

    Parameters
    ----------
    normal : (c, 2)
        Unit normals from i to j.
    branch : (c, 2)
        Vectors from centre to centre [m].
    fn, ft : (c,)
        Forces that i exerts on j [N].
    weight : (c,), optional
        P(bears force); 1 by default.
    """
    weight = weights_or_ones(weight, len(normal))
    force = value_harmonic(normal, fn, weight)
    return Anisotropies(
        contact=contact_harmonic(normal, weight),
        branch=value_harmonic(normal, np.linalg.norm(branch, axis=1), weight),
        normal=force,
        tangential=tangential_harmonic(normal, ft, force.mean, weight),
    )


def contact_harmonic(normal: Array, weight: Array | None = None) -> Harmonic:
    """Return the second harmonic of the density of contact directions (c, 2), relative to the isotropic density."""
    weight = weights_or_ones(weight, len(normal))
    cosine, sine = _double_angle(normal)
    return _harmonic(1.0, 2.0 * weighted_mean(cosine, weight), 2.0 * weighted_mean(sine, weight))


def value_harmonic(normal: Array, value: Array, weight: Array | None = None) -> Harmonic:
    """Fit the second harmonic of a positive quantity (c,) over the directions (c, 2) of its contacts.

    The fit is by least squares over contacts, so that uneven or missing directions do not bias it; it preserves the
    mean of the quantity and its mean weighted with n ⊗ n. Directions along one axis only have zero amplitude.
    """
    weight = weights_or_ones(weight, len(normal))
    cosine, sine = _double_angle(normal)
    design = np.stack([cosine - weighted_mean(cosine, weight), sine - weighted_mean(sine, weight)], axis=1)
    x, y = _least_squares(design, value, weight)
    mean = weighted_mean(value, weight) - x * weighted_mean(cosine, weight) - y * weighted_mean(sine, weight)
    return _harmonic(mean, x, y)


def tangential_harmonic(normal: Array, ft: Array, mean_force: float, weight: Array | None = None) -> Harmonic:
    """Fit ⟨f_t⟩(θ) = −f₀ a_t sin 2(θ − θ_t) to tangential forces (c,) [N] by least squares; mean_force is f₀ [N].

    Tangential forces have zero mean over directions, as a grain in equilibrium has no torque.
    """
    weight = weights_or_ones(weight, len(normal))
    cosine, sine = _double_angle(normal)
    # −sin 2(θ − θ_t) = cos 2θ_t (−sin 2θ) + sin 2θ_t (cos 2θ)
    x, y = _least_squares(np.stack([-sine, cosine], axis=1), ft, weight)
    return _harmonic(mean_force, x, y)


def _double_angle(normal: Array) -> tuple[Array, Array]:
    """Return cos 2θ and sin 2θ (c,) of unit vectors, the same for n and −n."""
    x, y = normal[:, 0], normal[:, 1]
    return x * x - y * y, 2.0 * x * y


def _least_squares(design: Array, value: Array, weight: Array) -> tuple[float, float]:
    """Return the two coefficients of least norm; combinations of columns with variance below DEGENERATE get zero."""
    total = max(float(weight.sum()), np.finfo(np.float64).tiny)
    variance, axes = np.linalg.eigh((design.T * weight) @ design / total)
    resolved = variance > DEGENERATE
    slope = axes.T @ ((design.T * weight) @ value / total)
    x, y = axes @ np.where(resolved, slope / np.where(resolved, variance, 1.0), 0.0)
    return float(x), float(y)


def _harmonic(mean: float, x: float, y: float) -> Harmonic:
    """Return the harmonic mean + x cos 2θ + y sin 2θ."""
    amplitude = float(np.hypot(x, y))
    if amplitude == 0.0:
        return Harmonic(mean, 0.0, 0.0)
    direction = 0.5 * float(np.arctan2(y, x))
    return Harmonic(mean, amplitude / mean if mean > 0 else float("nan"), direction)
