"""Lower bound of r: a quantile of the errors of its expectation, linear in the expectation."""

from __future__ import annotations

from collections.abc import Sequence
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
    """T = tanh(g − max(constant + slope g, 0))."""

    constant: float
    slope: float  # of the score g

    def bound(self, score: Array) -> Array:
        """Lower bound (f,) of r for scores (f,)."""
        return np.maximum(np.tanh(score - np.maximum(self.constant + self.slope * score, 0.0)), 0.0)

    def describe(self) -> str:
        """Its entry in fitted.toml."""
        return f"bound = {{ constant = {self.constant:.3f}, score = {self.slope:.3f} }}"


@dataclass(frozen=True, slots=True)
class JudgedFrames:
    """Frames with their true r, and scores of fits that have not read them; f frames."""

    r: Array  # (f,)
    score: Array  # (f,)
    error: Array  # (f,) arctanh r − score
    weight: Array  # (f,)
    fold: NDArray[np.int64]  # (f,) frames of one fold are judged by a bound that was fitted on the others

    def select(self, chosen: NDArray[np.bool_]) -> JudgedFrames:
        """The chosen frames (f,)."""
        return JudgedFrames(
            self.r[chosen], self.score[chosen], self.error[chosen], self.weight[chosen], self.fold[chosen]
        )


def fit_bound(
    frames: JudgedFrames,
    groups: Sequence[NDArray[np.bool_]],
    limits: Sequence[tuple[float, float]],
) -> BoundFit:
    """Fit the bound of an expectation.

    Parameters
    ----------
    frames : JudgedFrames
    groups : sequence of ndarray, shape (f,)
        Groups of frames, each of which keeps the limits.
    limits : sequence of (float, float)
        Excess of T over r, and fraction of the frames of a group that may have more.

    Notes
    -----
    The slope by quantile regression (Koenker & Bassett 1978) with a penalty, then a constant by which frames of folds
    left out keep the limits.
    """
    fit = _regress_quantile(frames)
    judged = [
        (_regress_quantile(frames.select(frames.fold != each)), frames.fold == each)
        for each in np.unique(frames.fold)
        if (frames.fold != each).any()
    ] or [(fit, np.ones(len(frames.r), np.bool_))]

    def excess(shift: float) -> float:
        trust = np.zeros(len(frames.r))
        for one, chosen in judged:
            some = frames.select(chosen)
            trust[chosen] = _shifted(one, shift).bound(some.score)
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
    return BoundFit(fit.constant + shift, fit.slope)


def _regress_quantile(frames: JudgedFrames) -> BoundFit:
    """Minimise Σ w ρ(error + margin) + penalty |slope|, ρ the check function of the quantile."""
    middle = float(np.median(frames.score))
    design = np.stack([np.ones(len(frames.r)), frames.score - middle], axis=1)
    weight = frames.weight / frames.weight.sum()
    penalty = np.array([0.0, QUANTILE * PENALTY])
    eye = identity(len(frames.r))
    found = linprog(
        np.r_[penalty, penalty, QUANTILE * weight, (1.0 - QUANTILE) * weight],
        A_eq=hstack([csr_matrix(design), csr_matrix(-design), eye, -eye]), b_eq=frames.error, bounds=(0.0, None),
        method="highs",
    ).x  # fmt: skip
    level, slope = found[2:4] - found[:2]  # of the margin, which lies below the expectation
    return BoundFit(float(level - slope * middle), float(slope))
