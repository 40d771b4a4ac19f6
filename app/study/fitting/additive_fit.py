"""Additive model of arctanh r: a sum of non-increasing functions of measures, by backfitting."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import isotonic_regression

from ...solver.assessment.expected_correlation import weaken
from ...solver.bodies.grains import Array

KNOTS, ROUNDS = 9, 12
SMOOTH = 0.15  # of the range of a measure, over which its isotonic regression is averaged
BEST_R, WORST_R = 0.995, -0.2  # limits of r whose arctanh is fitted


@dataclass(frozen=True, slots=True)
class AdditiveFit:
    """arctanh r = max(constant + Σ value(measure), least); a measure's strength multiplies what it adds above zero."""

    constant: float
    least: float  # score of the frame of the fit with the worst evidence: beyond it nothing is known
    terms: dict[str, tuple[Array, Array]]  # knots of ln measure and values

    def score(self, measures: Mapping[str, Array], strength: Mapping[str, Array]) -> Array:
        """arctanh of the expected correlation (f,), of logarithms of measures (f,), NaN: not known, and strengths."""
        total = np.full(len(next(iter(measures.values()))), self.constant)
        for name, (at, value) in self.terms.items():
            total += weaken(_evaluate(measures[name], at, value), strength.get(name, 1.0))
        return np.maximum(total, self.least)

    def describe(self) -> list[str]:
        """Lines of its table in fitted.toml."""
        lines = [f"constant = {self.constant:.3f}", f"least = {self.least:.3f}"]
        for name, (at, value) in self.terms.items():
            knots, values = (", ".join(f"{x:.3g}" for x in np.exp(at))), ", ".join(f"{x:.3f}" for x in value)
            lines.append(f"{name} = {{ at = [{knots}], value = [{values}] }}")
        return lines


def correlation_target(r: Array) -> Array:
    """arctanh of the correlations (f,), which are limited to −.2 and .995."""
    return np.arctanh(np.clip(r, WORST_R, BEST_R))


def fit_additive(
    measures: Mapping[str, Array], strength: Mapping[str, Array], names: Sequence[str], target: Array, weight: Array
) -> AdditiveFit:
    """Fit a target by backfitting of isotonic regressions, each averaged to knots.

    Parameters
    ----------
    measures : mapping of str to ndarray, shape (f,)
        Logarithms of the measures; NaN: not known.
    strength : mapping of str to ndarray, shape (f,)
        Of those measures that do not always speak for r: factors in [0, 1] of what they add above zero.
    names : sequence of str
        Those that are used.
    target, weight : ndarray, shape (f,)
    """
    constant = float(np.average(target, weights=weight))
    nothing = np.zeros(len(target))
    parts = dict.fromkeys(names, nothing)
    terms: dict[str, tuple[Array, Array]] = {}
    for _ in range(ROUNDS):
        for name in names:
            rest = target - constant - sum((parts[other] for other in names if other != name), nothing)
            # parts above zero are those of the round before: the regression then stays linear
            factor = np.where(parts[name] > 0.0, strength.get(name, 1.0), 1.0)
            terms[name] = _regress(measures[name], rest, weight, factor)
            parts[name] = weaken(_evaluate(measures[name], *terms[name]), strength.get(name, 1.0))
    unlimited = AdditiveFit(constant, -np.inf, terms).score(measures, strength)
    return AdditiveFit(constant, float(unlimited.min()), terms)


def _regress(measure: Array, rest: Array, weight: Array, factor: Array) -> tuple[Array, Array]:
    """Knots and values of the h that minimises Σ w (rest − factor h(measure))², isotonic and smoothed."""
    known = np.isfinite(measure) & (factor > 0.0)
    x, y, w = measure[known], (rest / np.where(known, factor, 1.0))[known], (weight * factor**2)[known]
    order = np.argsort(x, kind="stable")
    x, w = x[order], w[order]
    fitted = isotonic_regression(y[order], weights=w, increasing=False).x
    knots = np.linspace(0.0, 1.0, KNOTS)
    at = np.unique(np.quantile(x, knots, method="nearest"))
    above = x[x > at[0]]
    if len(at) < KNOTS and len(above):  # many frames have the least value: the others have knots of their own
        at = np.append(at[0], np.unique(np.quantile(above, knots[1:], method="nearest")))
    reach = max(SMOOTH * float(at[-1] - at[0]), 1e-9)
    value = np.array([np.average(fitted[near], weights=w[near]) for near in (np.abs(x - c) <= reach for c in at)])
    value = np.minimum.accumulate(value)
    return at, value - np.average(np.interp(x, at, value), weights=w)


def _evaluate(measure: Array, at: Array, value: Array) -> Array:
    return np.where(np.isfinite(measure), np.interp(np.nan_to_num(measure), at, value), 0.0)
