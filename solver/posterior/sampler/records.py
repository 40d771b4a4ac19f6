"""Data that the sampler's compiled loops read and change: pairs, grains, parameters, one draw, work memory.

Everything that a contact reads of a grain is one record, which is one cache line.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...bodies.grains import Array

Rows = NDArray[np.int64]

# Columns of a grain's record: ΣF; ΣM over the mean radius; ε; δ; radius over the mean radius; weight of its balance.
FX, FY, TORQUE, CX, CY, DELTA, LEVER, BALANCE_WEIGHT = range(8)
BODY = 8


class SamplerPairs(NamedTuple):
    """Candidate pairs, as they were measured."""

    i: Rows  # (c,) row of a grain
    j: Rows  # (c,) row of a grain, −1: a wall
    normal: Array  # (c, 2) from i towards j
    gap: Array  # (c,)
    odds: Array  # (c,) ln P/(1 − P), P the prior probability that the pair bears force
    friction: Array  # (c,)
    group: Rows  # (c,) group whose normal forces have a known sum, −1: none
    gap_sd: Array  # (c,) standard deviation of an error that belongs to this gap alone; 0: none
    factor: Array  # (c,) of the normal force in the sum of its group


class SamplerGrains(NamedTuple):
    """Grains, and the pairs of each.

    m = k n rows: the n grains in one frame or, one frame after the other, in k frames with common radii.
    """

    lever: Array  # (m,) radius over the mean radius
    load: Array  # (m, 2) weight
    balance_weight: Array  # (m,) of the force balance, 0 … 1; 0 where forces on the grain are missing
    centre_sd: Array  # (m,) of an error of the centre along each axis
    radius_sd: Array  # (n,) of an error of the radius
    start: Rows  # (m + 1,) where each grain's rows in `row` begin
    row: Rows  # (2c,) of pairs, in the order of the grains
    group_load: Array  # (g,) known sums of normal forces
    pressure: Array  # (m,) measured sum of a grain's normal forces
    pressure_weight: Array  # (m,) inverse variance of that measurement; 0: not measured


class ModelParameters(NamedTuple):
    """Parameters of the posterior in one sweep."""

    balance_sd: float  # s
    gap_law_sd: float  # b
    tangential_sd: float  # τ
    mean_open_gap: float  # ℓ
    mean_gauge: float  # K of the mean force; 0: a load determines it
    count_gauge: float  # K of the number of bearing pairs
    expected_count: float  # Σ P
    compliance_mean: float  # prior of κ
    compliance_sd: float
    offset_sd: float
    force_rate: float  # λ


class SamplerState(NamedTuple):
    """One draw of all unknowns; changes in place."""

    bearing: NDArray[np.bool_]  # (c,) z
    fn: Array  # (c,) f
    ft: Array  # (c,) t
    open_gap: Array  # (c,) γ
    body: Array  # (m, 8) records of the grains
    group_sum: Array  # (g,) Σ f of each group
    normal_sum: Array  # (m,) Σ f on each grain
    common: Array  # (4,) κ, offset, Σ_bearing (f − 1), Σ z


class Workspace(NamedTuple):
    """Quantities that follow from the pairs or from a sweep's parameters, and the residuals that contacts leave."""

    coefficients: Array  # (c, 4) b, 1/b², A without its term in κ, √A_t
    observation: Array  # (c, 2) 1/b², and the gap residual at ε = δ = 0: gap − offset + κ f, or gap − offset − γ
    direction: Array  # (2c, 2) normals from each grain's side, in the order of `SamplerGrains.row`
    other: Rows  # (2c,) the other grain, −1: a wall
    centre_factor: Array  # (m, 5) factor of the precision of ε
    precision: Array  # (n,) of δ


def initial_state(pairs: SamplerPairs, grains: SamplerGrains, compliance: float) -> SamplerState:
    """Build a state without errors: the nearest Σ P pairs bear one unit of force each."""
    count, between = len(pairs.i), pairs.j >= 0
    probability = 1.0 / (1.0 + np.exp(-pairs.odds))
    bearing = np.zeros(count, np.bool_)
    bearing[np.argsort(pairs.gap, kind="stable")[: round(float(probability.sum()))]] = True
    fn = bearing.astype(np.float64)
    force = fn[:, None] * pairs.normal
    body = np.zeros((len(grains.lever), BODY))
    body[:, :2], body[:, LEVER], body[:, BALANCE_WEIGHT] = grains.load, grains.lever, grains.balance_weight
    np.subtract.at(body[:, :2], pairs.i, force)
    np.add.at(body[:, :2], pairs.j[between], force[between])
    grouped = pairs.group >= 0
    known = (pairs.factor * fn)[grouped]
    normal_sum = np.bincount(pairs.i, fn, minlength=len(body)).astype(np.float64)
    normal_sum += np.bincount(pairs.j[between], fn[between], minlength=len(body))
    return SamplerState(
        bearing, fn, np.zeros(count), np.where(bearing, 0.0, np.maximum(pairs.gap, 0.0)), body,
        np.bincount(pairs.group[grouped], known, minlength=len(grains.group_load)).astype(np.float64), normal_sum,
        np.array([compliance, 0.0, 0.0, float(bearing.sum())]),
    )  # fmt: skip


def make_workspace(pairs: SamplerPairs, grains: SamplerGrains) -> Workspace:
    """Allocate the workspace of a chain and fill in what follows from the pairs alone."""
    count, rows = len(pairs.i), grains.row
    grain = np.repeat(np.arange(len(grains.lever)), np.diff(grains.start))
    first = pairs.i[rows] == grain
    return Workspace(
        np.empty((count, 4)), np.empty((count, 2)),
        np.where(first, -1.0, 1.0)[:, None] * pairs.normal[rows],  # h falls by n·ε_j and rises by n·ε_i
        np.where(first, pairs.j[rows], pairs.i[rows]),
        np.empty((len(grains.lever), 5)), np.empty(len(grains.radius_sd)),
    )  # fmt: skip
