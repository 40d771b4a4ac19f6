"""Gaps of touching pairs as linear functions of unknown errors that many pairs share, by robust least squares."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ..bodies.grains import Array, move_freely
from ..robust_scale import SD_OVER_MAD

WIDEST = 0.15  # mean diameters: gap of a pair that may touch although it is distorted
FIRST_QUANTILE = 0.2  # of all gaps: where touching ones are looked for first
FIRST_WIDTH, SHRINK, LAST_WIDTH = 0.12, 0.75, 1.5  # mean diameters; factor of a round; robust standard deviations
NEAR_WIDTH = 0.04  # mean diameters: where the solution is nearly known
ROUNDS = 30
CONVERGED = 1e-3  # scatters: change of a residual in a round
SECTORS, RINGS = 8, 3  # parts of the picture in which gaps are compared
FEWEST_PAIRS = 100  # in such a part, or in a frame that shows a distortion
UNEXPLAINED = 1.0  # robust standard deviations of a touching gap: range of the usual one over the parts of the picture
SIGNIFICANT = 5.0  # standard errors of an unknown
NARROWEST = 1e-6  # mean diameters: width for gaps without any error


@dataclass(frozen=True, slots=True)
class NearPairs:
    """Pairs of one photograph that may touch."""

    i: Int[np.ndarray, " m"]
    j: Int[np.ndarray, " m"]
    normal: Float[Array, "m 2"]  # from i to j
    gap: Float[Array, " m"]  # [m]


@dataclass(frozen=True, slots=True)
class TouchingFit:
    """Errors that explain the gaps of touching pairs."""

    value: Float[Array, " u"]
    sd: Float[Array, " u"]  # standard error, as if errors were the same in all frames
    scatter: float  # [m] robust standard deviation of the gaps of touching pairs
    misfit: float  # [m] of all pairs, on whose number models compare
    residual: Float[Array, " m"]  # [m]
    weight: Float[Array, " m"]


def find_near_pairs(position: Array, radius: Array, boundary: NDArray[np.bool_] | None = None) -> NearPairs:
    """Find the pairs of grains that may touch.

    Parameters
    ----------
    position : (n, 2)
        Positions [m] in one photograph, NaN where a grain is missing.
    radius : (n,)
        Radii [m].
    boundary : (n,), optional
        Grains of the boundary, whose motion is imposed: two of them need not touch; None: none.
    """
    reach = WIDEST * 2.0 * float(radius.mean())
    here = np.flatnonzero(np.isfinite(position[:, 0]))
    i, j = here[KDTree(position[here]).query_pairs(2.0 * float(radius.max()) + reach, output_type="ndarray")].T
    i, j = i[moves := move_freely(boundary, i, j)], j[moves]
    branch = position[j] - position[i]
    length = np.linalg.norm(branch, axis=1)
    gap = length - radius[i] - radius[j]
    near = (gap < reach) & (length > 0.0)
    return NearPairs(i[near], j[near], branch[near] / length[near, None], gap[near])


def count_classes(pairs: NearPairs, size_class: Int[np.ndarray, " n"], classes: int) -> Float[Array, "m q"]:
    """Count how many grains of every class each pair has."""
    own = np.zeros((len(pairs.i), classes))
    for side in (pairs.i, pairs.j):
        np.add.at(own, (np.arange(len(side)), size_class[side]), 1.0)
    return own


def fit_touching_pairs(
    gap: Float[Array, " m"], design: Float[Array, "m u"], radius_error: Bool[np.ndarray, " u"], diameter: float,
    frames: int, *, start: Float[Array, " u"] | None = None,
) -> TouchingFit:  # fmt: skip
    """Fit g + D x = 0 over the pairs that touch.

    Parameters
    ----------
    gap : (m,)
        Gaps [m] of pairs that may touch, of all frames.
    design : (m, u)
        D, the change of every gap by a unit of each unknown.
    radius_error : (u,)
        Which unknowns are an error [m] that all radii, or those of a class, share.
    diameter : float
        Mean diameter [m].
    frames : int
        From which gaps are taken; they show the same errors again.
    start : (u,), optional
        Values near the solution; None: unknown.

    Notes
    -----
    Weighted least squares with weights (1 + (g/s)²)⁻² of the residuals g, with s shrinking from a fraction of a
    diameter to 1.5 robust standard deviations, which finds the most frequent gap wherever distortion has moved it.
    Pairs that do not touch only have positive residuals: the standard deviation is that of the negative ones. Weights
    are the same on both sides of zero, since otherwise the open pairs that are beside the touching ones shift the fit
    by as much as there are of them, which differs between the parts of a picture.
    """
    value = np.where(radius_error, 0.5 * np.quantile(gap, FIRST_QUANTILE), 0.0) if start is None else start
    width, scatter = (FIRST_WIDTH if start is None else NEAR_WIDTH) * diameter, 0.0
    rows = np.ascontiguousarray(design.T)
    normal, residual, weight = np.eye(len(value)), gap + design @ value, np.ones(len(gap))
    for _ in range(ROUNDS):
        weight = 1.0 / (1.0 + (residual / width) ** 2) ** 2
        weighted = weight * rows
        normal = weighted @ design
        value = -np.linalg.lstsq(normal, weighted @ gap, rcond=None)[0]
        before, residual = residual, gap + design @ value
        overlaps = residual[(residual < 0.0) & (residual > -WIDEST * diameter)]
        scatter = SD_OVER_MAD * float(np.median(-overlaps)) if len(overlaps) else 0.0
        last, width = width, max(SHRINK * width, LAST_WIDTH * scatter, NARROWEST * diameter)
        if width > SHRINK * last and float(np.abs(residual - before).max()) < CONVERGED * scatter:
            break
    sd = scatter * np.sqrt(frames * np.diag(np.linalg.pinv(normal)))
    return TouchingFit(
        np.asarray(value, np.float64), sd, scatter, SD_OVER_MAD * float(np.median(np.abs(residual))), residual, weight
    )


def place_dependence(fit: TouchingFit, place: Float[Array, "m 2"], diameter: float, frames: int) -> float:
    """Compute the range of the usual touching gap over the picture [m]; 0 where it is within scatter and error.

    Parameters
    ----------
    fit : TouchingFit
        Of the pairs.
    place : (m, 2)
        Their places from the middle of the picture, over its half-width.
    diameter : float
        Mean diameter [m].
    frames : int
        Photographs that the pairs were read from.
    """
    x, y = place.T
    ring = np.minimum((np.hypot(x, y) * RINGS).astype(int), RINGS - 1)
    part = ring * SECTORS + ((np.arctan2(y, x) / (2.0 * np.pi) + 0.5) * SECTORS).astype(int) % SECTORS
    usual, error = [], []
    for number in np.unique(part):
        gap = fit.residual[part == number]
        if len(gap) < FEWEST_PAIRS:
            continue
        local = fit_touching_pairs(gap, np.full((len(gap), 1), -1.0), np.array([False]), diameter, frames)
        usual.append(local.value[0])
        error.append(local.sd[0])
    if len(usual) < 2:
        return 0.0
    spread = float(np.ptp(usual))
    return spread if spread > max(UNEXPLAINED * fit.scatter, SIGNIFICANT * float(max(error))) else 0.0
