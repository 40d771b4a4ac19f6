"""One draw of all unknowns, and the work memory of a chain, in the order of the blocks."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...bodies.grains import Array
from .blocks import (
    GAP,
    RECORD,
    GrainBlocks,
    PairBlocks,
    make_grain_blocks,
    make_pair_blocks,
)
from .lanes import LANES, seed_lanes
from .records import SamplerGrains, SamplerPairs

# Columns of a grain's two records: ΣF, ΣM over the mean radius and Σ f; ε, δ and nothing.
FX, FY, TORQUE, NORMAL_SUM = range(RECORD)
CX, CY, DELTA, _NOTHING = range(RECORD)


class SamplerState(NamedTuple):
    """One draw of all unknowns; changes in place. p places of pairs; r records of the grains, with absent ones."""

    bearing: Array  # (p,) z, 1 or 0
    fn: Array  # (p,) f
    ft: Array  # (p,) t
    open_gap: Array  # (p,) γ
    force: Array  # (r, 4) sums of forces on each grain
    error: Array  # (r, 4) errors of each grain, 0 of absent ones
    group_sum: Array  # (g,) Σ f of each group
    common: Array  # (4,) κ, offset, Σ_bearing (f − 1), Σ z
    random: NDArray[np.uint32]  # (4 LANES,) generators of random numbers


class Workspace(NamedTuple):
    """What contacts leave for the draws of errors and those for the next contacts, and what parameters determine."""

    height: Array  # (p,) gaps corrected for ε and δ, not for the offset
    residual: Array  # (p,) at ε = δ = 0: gap − offset + κ f, or gap − offset − γ
    precision: Array  # (p,) 1/b²
    group_load: Array  # (g,)
    grain: Array  # (r, 5) weight (2), of the balance, measured pressure, its inverse variance
    pair_weight: Array  # (rows of pairs, LANES) 1/b², in the order of `GrainBlocks.pair`
    centre_factor: Array  # (blocks of grains × frames, 5, LANES) factor of the precision of ε
    radius_precision: Array  # (blocks of grains, LANES) of δ


class Chain(NamedTuple):
    """Everything that the sweeps of a chain read and change."""

    pairs: PairBlocks
    grains: GrainBlocks
    state: SamplerState
    workspace: Workspace
    pair_count: int
    grain_count: int  # m


def start_chain(pairs: SamplerPairs, grains: SamplerGrains, compliance: float, rng: np.random.Generator) -> Chain:
    """Arrange pairs and grains in blocks, with a state without errors: the nearest Σ P pairs bear one unit of force."""
    blocks = make_pair_blocks(pairs, grains)
    state = _initial_state(pairs, grains, blocks, compliance, rng)
    by_grain = make_grain_blocks(pairs, grains, blocks.place)
    return Chain(
        blocks, by_grain, state, _make_workspace(grains, blocks, by_grain), len(pairs.i), len(grains.lever)
    )  # fmt: skip


def _initial_state(
    pairs: SamplerPairs, grains: SamplerGrains, blocks: PairBlocks, compliance: float, rng: np.random.Generator
) -> SamplerState:
    count, between = len(pairs.i), pairs.j >= 0
    expected = 1.0 / (1.0 + np.exp(-pairs.odds))
    bearing = np.zeros(count)
    bearing[np.argsort(pairs.gap, kind="stable")[: round(float(expected.sum()))]] = 1.0
    force = np.zeros((_whole_blocks(len(grains.lever)), RECORD))
    force[: len(grains.lever), :2] = grains.load
    on_other = bearing[:, None] * pairs.normal
    np.subtract.at(force[:, :2], pairs.i, on_other)
    np.add.at(force[:, :2], pairs.j[between], on_other[between])
    np.add.at(force[:, NORMAL_SUM], pairs.i, bearing)
    np.add.at(force[:, NORMAL_SUM], pairs.j[between], bearing[between])
    grouped = pairs.group >= 0
    known = (pairs.factor * bearing)[grouped]
    fn, open_gap = np.zeros(blocks.group.shape), np.zeros(blocks.group.shape)
    fn[blocks.place] = bearing
    open_gap[blocks.place] = np.where(bearing > 0.0, 0.0, np.maximum(pairs.gap, 0.0))
    return SamplerState(
        fn.copy(), fn, np.zeros(len(fn)), open_gap, force, np.zeros_like(force),
        np.bincount(pairs.group[grouped], known, minlength=len(grains.group_load)).astype(np.float64),
        np.array([compliance, 0.0, 0.0, bearing.sum()]), seed_lanes(rng),
    )  # fmt: skip


def _make_workspace(grains: SamplerGrains, blocks: PairBlocks, by_grain: GrainBlocks) -> Workspace:
    gap = blocks.value[:, GAP].flatten()  # a copy
    grain = np.zeros((_whole_blocks(len(grains.lever)), 5))
    columns = grains.load, grains.balance_weight, grains.pressure, grains.pressure_weight
    grain[: len(grains.lever)] = np.column_stack(columns)
    return Workspace(
        gap, gap.copy(), np.empty(len(gap)), grains.group_load, grain, np.empty(by_grain.pair.shape),
        np.empty((len(by_grain.record), 5, LANES)), np.empty(by_grain.radius_precision.shape),
    )  # fmt: skip


def _whole_blocks(grains: int) -> int:
    """Records of this many grains and an absent one, in whole blocks."""
    return -(-(grains + 1) // LANES) * LANES
