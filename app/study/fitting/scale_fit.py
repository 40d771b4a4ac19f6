"""Fit of the standard deviation of the scale of forces, and its coverage."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from ...solver.bodies.grains import Array

COVERED = 0.95  # of the frames, within two standard deviations
AIMED = 0.97  # the same of kinds that the fit reads, so that COVERED of others are
SMALL = 1e-4  # factors below it do not matter
LEAST_ERROR = 1e-4  # of a scale: its logarithm is taken
STARTS, STEPS = 6, 3000  # of the minimisation
FOLDS = 6
STEP, MOST = 0.5, 6.0  # of the factor of first frames


@dataclass(frozen=True, slots=True)
class ScaleSample:
    """Frames whose scale is known; f frames."""

    kind: NDArray[np.str_]  # (f,)
    terms: Array  # (f, t) of the standard deviation
    error: Array  # (f,) |true over inferred scale − 1|

    def select(self, chosen: NDArray[np.bool_]) -> ScaleSample:
        """The chosen frames (f,)."""
        return ScaleSample(self.kind[chosen], self.terms[chosen], self.error[chosen])

    @property
    def weight(self) -> Array:
        """Weight of a frame (f,): every kind counts the same."""
        _, index, count = np.unique(self.kind, return_inverse=True, return_counts=True)
        return 1.0 / (count[index] * len(count))

    def coverage(self, sd: Array) -> tuple[float, float]:
        """Fractions of the frames within one and two standard deviations (f,); every kind counts the same."""
        return tuple(float(self.weight @ (self.error <= m * sd)) for m in (1.0, 2.0))  # pyright: ignore[reportReturnType]


def scale_sd_of(terms: Array, factors: Array, least: float) -> Array:
    """Standard deviations (f,) of terms (f, t) with factors (t,)."""
    return np.sqrt(least**2 + (terms**2) @ factors**2)


def fit_scale(sample: ScaleSample, least: float, start: Array) -> Array:
    """Factors (t,) of the terms; start (t,): where the search begins, besides random places.

    Notes
    -----
    Two standard deviations are the quantile of 95 % of |e|: Σ w ρ(ln |e| − ln 2σ) is least, ρ the check function of the
    quantile (Koenker & Bassett 1978). Then all factors are multiplied by one number with which 97 % are covered.
    """
    weight, error = sample.weight, np.log(np.maximum(sample.error, LEAST_ERROR))

    def loss(logarithms: Array) -> float:
        beyond = error - np.log(2.0 * scale_sd_of(sample.terms, np.exp(logarithms), least))
        return float(weight @ np.where(beyond > 0.0, COVERED * beyond, (COVERED - 1.0) * beyond))

    options = {"maxiter": STEPS, "maxfev": STEPS, "fatol": 1e-8, "xatol": 1e-4}
    random = np.log(0.1) + np.random.default_rng(0).normal(0.0, 1.0, (STARTS, len(start)))
    starts = [np.log(np.maximum(start, SMALL)), *random]
    trials = [minimize(loss, start, method="Nelder-Mead", options=options) for start in starts]
    factors = np.exp(min(trials, key=lambda trial: trial.fun).x)
    low, high = 0.05, 20.0
    for _ in range(40):
        middle = float(np.sqrt(low * high))
        enough = sample.coverage(scale_sd_of(sample.terms, middle * factors, least))[1] >= AIMED
        low, high = (low, middle) if enough else (middle, high)
    return np.where(high * factors < SMALL, 0.0, high * factors)


def fit_first(sample: ScaleSample) -> float:
    """Factor of the second term of first frames, whose first term has a factor of one: the least multiple of STEP.

    Parameters
    ----------
    sample : ScaleSample
        First frames. Terms: the standard deviation by their own evidence, and that of the second frame's scale.

    Notes
    -----
    So that two standard deviations cover COVERED of them.
    """
    factors = np.arange(0.0, MOST + STEP, STEP)
    covered = [sample.coverage(scale_sd_of(sample.terms, np.array([1.0, each]), 0.0))[1] for each in factors]
    return float(factors[int(np.argmax(np.array(covered) >= COVERED))]) if max(covered) >= COVERED else MOST


def describe_scale(sample: ScaleSample, used: Mapping[str, float], least: float) -> list[str]:
    """Fit from the factors in use, and describe as the table of fitted.toml, with the coverage of kinds left out."""
    start = np.array(list(used.values()))
    kinds, sd = np.unique(sample.kind), np.zeros(len(sample.error))
    for fold in range(FOLDS):
        away = np.isin(sample.kind, kinds[fold::FOLDS])
        if away.any() and not away.all():
            sd[away] = scale_sd_of(sample.terms[away], fit_scale(sample.select(~away), least, start), least)
    factors = fit_scale(sample, least, start)
    one, two = sample.coverage(sd)
    return [
        "[scale_sd]",
        f"# of kinds left out, {100.0 * one:.0f} and {100.0 * two:.0f} % lie within one and two standard deviations",
        f"least = {least:g}",
        *(f"{name} = {each:.3g}" for name, each in zip(used, factors, strict=True)),
    ]
