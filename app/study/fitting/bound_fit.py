"""Lower bound of r: a quantile of the errors of its expectation, linear in the expectation and in measures."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.sparse import csr_matrix, hstack, identity

from ...solver.bodies.grains import Array

QUANTILE = 0.05  # of the errors that are below the bound
PENALTY = 0.03  # of a slope, over the mean error: slopes that explain nothing stay zero


@dataclass(frozen=True, slots=True)
class BoundFit:
    """T = tanh(g − max(constant + slope g + Σ slope ln(measure / typical), 0))."""

    constant: float
    slope: float  # of the score g
    slopes: dict[str, tuple[float, float]]  # slope and ln typical of each measure

    def bound(self, score: Array, measures: Mapping[str, Array]) -> Array:
        """Lower bound (f,) of r for scores (f,) and logarithms of measures (f,)."""
        return np.maximum(np.tanh(score - np.maximum(self._margin(score, measures), 0.0)), 0.0)

    def _margin(self, score: Array, measures: Mapping[str, Array]) -> Array:
        total = self.constant + self.slope * score
        for name, (slope, typical) in self.slopes.items():
            total = total + slope * np.where(np.isfinite(measures[name]), measures[name] - typical, 0.0)
        return total

    def describe(self) -> str:
        """Its entry in fitted.toml."""
        slopes = "".join(
            f", {name} = [{slope:.3f}, {math.exp(typical):.3g}]" for name, (slope, typical) in self.slopes.items()
        )
        return f"bound = {{ constant = {self.constant:.3f}, score = {self.slope:.3f}{slopes} }}"


@dataclass(frozen=True, slots=True)
class JudgedFrames:
    """Frames with their true r, and scores of fits that have not read them; f frames."""

    r: Array  # (f,)
    score: Array  # (f,)
    error: Array  # (f,) arctanh r − score
    measures: Mapping[str, Array]  # (f,) each
    weight: Array  # (f,)
    fold: NDArray[np.int64]  # (f,) frames of one fold are judged by a bound that was fitted on the others

    def select(self, chosen: NDArray[np.bool_]) -> JudgedFrames:
        """The chosen frames (f,)."""
        return JudgedFrames(
            self.r[chosen], self.score[chosen], self.error[chosen],
            {name: each[chosen] for name, each in self.measures.items()}, self.weight[chosen], self.fold[chosen],
        )  # fmt: skip


def fit_bound(
    frames: JudgedFrames,
    names: Sequence[str],
    groups: Sequence[NDArray[np.bool_]],
    limits: Sequence[tuple[float, float]],
) -> BoundFit:
    """Fit the bound of an expectation.

    Parameters
    ----------
    frames : JudgedFrames
    names : sequence of str
        Measures that it may depend on.
    groups : sequence of ndarray, shape (f,)
        Groups of frames, each of which keeps the limits.
    limits : sequence of (float, float)
        Excess of T over r, and fraction of the frames of a group that may have more.

    Notes
    -----
    Slopes by quantile regression (Koenker & Bassett 1978) with a penalty, then a constant by which frames of folds left
    out keep the limits.
    """
    fit = _regress_quantile(frames, names)
    judged = [
        (_regress_quantile(frames.select(frames.fold != each), names), frames.fold == each)
        for each in np.unique(frames.fold)
        if (frames.fold != each).any()
    ] or [(fit, np.ones(len(frames.r), np.bool_))]

    def excess(shift: float) -> float:
        trust = np.zeros(len(frames.r))
        for one, chosen in judged:
            some = frames.select(chosen)
            trust[chosen] = _shifted(one, shift).bound(some.score, some.measures)
        return max(
            np.average(trust[group] > frames.r[group] + above, weights=frames.weight[group]) / allowed
            for group in groups
            for above, allowed in limits
            if group.any()
        )

    low, high = -1.0, 3.0
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) > 1.0 else (low, middle)
    return _shifted(fit, high)


def _shifted(fit: BoundFit, shift: float) -> BoundFit:
    return BoundFit(fit.constant + shift, fit.slope, fit.slopes)


def _regress_quantile(frames: JudgedFrames, names: Sequence[str]) -> BoundFit:
    """Minimise Σ w ρ(error + margin) + penalty Σ |slope|, ρ the check function of the quantile."""
    typical = {name: float(np.nanmedian(frames.measures[name])) for name in names}
    middle = float(np.median(frames.score))
    columns = [np.ones(len(frames.r)), frames.score - middle]
    columns += [
        np.where(np.isfinite(frames.measures[name]), frames.measures[name] - typical[name], 0.0) for name in names
    ]
    design, count = np.stack(columns, axis=1), len(columns)
    weight = frames.weight / frames.weight.sum()
    penalty = np.r_[0.0, np.full(count - 1, QUANTILE * PENALTY)]
    eye = identity(len(frames.r))
    found = linprog(
        np.r_[penalty, penalty, QUANTILE * weight, (1.0 - QUANTILE) * weight],
        A_eq=hstack([csr_matrix(design), csr_matrix(-design), eye, -eye]), b_eq=frames.error, bounds=(0.0, None),
        method="highs",
    ).x  # fmt: skip
    slope = found[count : 2 * count] - found[:count]  # of the margin, which lies below the expectation
    return BoundFit(
        float(slope[0] - slope[1] * middle), float(slope[1]),
        {name: (float(slope[2 + k]), typical[name]) for k, name in enumerate(names)},
    )  # fmt: skip
