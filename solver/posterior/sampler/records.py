"""Data of the sampler: pairs, grains, and the parameters of the posterior, in the order of the evidence."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...bodies.grains import Array

Rows = NDArray[np.int64]


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
    """Grains.

    m = k n rows: the n grains in one frame or, one frame after the other, in k frames with common radii.
    """

    lever: Array  # (m,) radius over the mean radius
    load: Array  # (m, 2) weight
    balance_weight: Array  # (m,) of the force balance, 0 … 1; 0 where forces on the grain are missing
    centre_sd: Array  # (m,) of an error of the centre along each axis
    radius_sd: Array  # (n,) of an error of the radius
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
