"""Blocks of pairs and of grains that are drawn at once, because no conditional distribution within a block matters.

Pairs of a block share no grain and no known sum; grains of a block share no pair. A block has LANES places; those that
are left over belong to an absent pair or grain, whose draws have no effect.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...bodies.grains import Array
from ...independent_blocks import independent_blocks
from .lanes import LANES
from .records import Rows, SamplerGrains, SamplerPairs

RECORD = 4  # numbers of a grain's record
# Of all pairs, the greatest part of a block: the pairs of a block see the gauges' sums before it, which a larger part
# of all pairs would overcorrect.
GREATEST_PART = 0.05
# Rows of a block of pairs; the last three follow from the parameters.
(
    NX, NY, BALANCE_I, LEVER_I, BALANCE_J, LEVER_J, PRESSURE_WEIGHT_I, PRESSURE_I, PRESSURE_WEIGHT_J, PRESSURE_J,
    GAP, PRIOR, FRICTION, FACTOR, OWN_SD, PRESENT, GAP_SD, NORMAL_PRECISION, ROOT_T, ROWS,
) = range(20)  # fmt: skip


class PairBlocks(NamedTuple):
    """Pairs in blocks; p = blocks × LANES places."""

    place: Rows  # (c,) place of every pair
    body: NDArray[np.uint32]  # (blocks, 2, LANES) places of the records of i and j; absent, or a wall: m × RECORD
    group: Rows  # (p,) known sum, −1: none
    grouped: NDArray[np.bool_]  # (blocks,) whether a pair of the block belongs to a known sum
    value: Array  # (blocks, ROWS, LANES)


class GrainBlocks(NamedTuple):
    """Grains in blocks of equal radii's rows, and the pairs of each, in rows of LANES; frames of a block follow it."""

    frames: int
    record: NDArray[np.uint32]  # (blocks × frames, LANES) place of the record; absent: m × RECORD
    start: Rows  # (blocks × frames + 1,) first row of pairs
    pair: Rows  # (rows, LANES) place of a pair, 0 where the grain has no further one
    other: NDArray[np.uint32]  # (rows, LANES) record of the other grain; a wall or absent: m × RECORD
    normal: Array  # (rows, 2, LANES) from the grain's side: h falls by n·ε_j and rises by n·ε_i
    present: Array  # (rows, LANES) 1 or 0
    centre_precision: Array  # (blocks × frames, LANES) 1/σ_c²
    radius_precision: Array  # (blocks, LANES) 1/σ_r²


def make_pair_blocks(pairs: SamplerPairs, grains: SamplerGrains) -> PairBlocks:
    """Arrange the pairs in blocks that share neither a grain nor a known sum."""
    count, m = len(pairs.i), len(grains.lever)
    between, summed = pairs.j >= 0, pairs.group >= 0
    resource = np.column_stack([pairs.i, np.where(between, pairs.j, -1), np.where(summed, m + pairs.group, -1)])
    size = int(np.clip(GREATEST_PART * count, 1, LANES))
    start = 3 * np.arange(count + 1)
    row, blocks = _in_lanes(start, resource.ravel(), m + len(grains.group_load), size)
    place = np.empty(count, np.int64)
    place[row[row >= 0]] = np.flatnonzero(row >= 0)
    present, source = row >= 0, np.maximum(row, 0)
    i, j = (np.where(present & (each[source] >= 0), each[source], m) for each in (pairs.i, pairs.j))
    value = np.zeros((ROWS, len(row)))

    def of_pair(values: Array, absent: float = 0.0) -> Array:
        return np.where(present, values[source], absent)

    def of_grain(values: Array, body: Rows) -> Array:
        return np.append(values, 0.0)[body]

    value[NX], value[NY] = of_pair(pairs.normal[:, 0]), of_pair(pairs.normal[:, 1])
    value[GAP], value[PRIOR], value[FRICTION] = of_pair(pairs.gap), of_pair(pairs.odds, -1e3), of_pair(pairs.friction)
    value[FACTOR], value[OWN_SD], value[PRESENT] = of_pair(pairs.factor), of_pair(pairs.gap_sd), present
    for first, body in ((BALANCE_I, i), (BALANCE_J, j)):
        value[first], value[first + 1] = of_grain(grains.balance_weight, body), of_grain(grains.lever, body)
    for first, body in ((PRESSURE_WEIGHT_I, i), (PRESSURE_WEIGHT_J, j)):
        value[first], value[first + 1] = of_grain(grains.pressure_weight, body), of_grain(grains.pressure, body)
    group = np.where(present, pairs.group[source], -1)
    return PairBlocks(
        place,
        np.stack([(RECORD * each).reshape(blocks, LANES) for each in (i, j)], axis=1).astype(np.uint32),
        group,
        np.any((group >= 0).reshape(blocks, LANES), axis=1),
        np.ascontiguousarray(value.reshape(ROWS, blocks, LANES).transpose(1, 0, 2)),
    )


def make_grain_blocks(pairs: SamplerPairs, grains: SamplerGrains, place: Rows) -> GrainBlocks:
    """Arrange the grains in blocks that share no pair; place (c,) of every pair in its blocks."""
    m, n = len(grains.lever), len(grains.radius_sd)
    frames, between = m // n, np.flatnonzero(pairs.j >= 0)
    grain = np.concatenate([pairs.i, pairs.j[between]])
    order = np.argsort(grain, kind="stable")
    pair = np.concatenate([np.arange(len(pairs.i)), between])[order]
    other = np.concatenate([np.where(pairs.j >= 0, pairs.j, m), pairs.i[between]])[order]
    sign = np.concatenate([np.full(len(pairs.i), -1.0), np.ones(len(between))])[order]
    start = np.concatenate([[0], np.cumsum(np.bincount(grain, minlength=m))])
    by_radius = np.argsort(grain[order] % n, kind="stable")  # the pairs of a radius in all frames
    first = np.concatenate([[0], np.cumsum(np.bincount(grain % n, minlength=n))])
    chosen, blocks = _in_lanes(first, pair[by_radius], len(pairs.i), LANES)
    present = (chosen >= 0).reshape(blocks, 1, LANES)
    row = np.where(present, chosen.reshape(blocks, 1, LANES) + n * np.arange(frames)[:, None], m)
    row = row.reshape(blocks * frames, LANES)
    degree = np.append(np.diff(start), 0)[row]
    rows = np.concatenate([[0], np.cumsum(degree.max(axis=1))])
    block = np.repeat(np.arange(len(row)), degree.max(axis=1))
    step = (np.arange(rows[-1]) - rows[block])[:, None]
    real = step < degree[block]
    entry = np.where(real, np.append(start[:-1], 0)[row[block]] + step, 0)
    normal = np.where(real, sign[entry], 0.0)[:, :, None] * pairs.normal[pair[entry]]
    radius = np.where(present[:, 0], chosen.reshape(blocks, LANES), 0)
    return GrainBlocks(
        frames,
        (RECORD * row).astype(np.uint32),
        rows,
        np.where(real, place[pair[entry]], 0),
        (RECORD * np.where(real, other[entry], m)).astype(np.uint32),
        np.ascontiguousarray(normal.transpose(0, 2, 1)),
        real.astype(np.float64),
        np.append(grains.centre_sd**-2.0, 1.0)[row],
        np.where(present[:, 0], grains.radius_sd[radius] ** -2.0, 1.0),
    )


def _in_lanes(start: Rows, resource: Rows, resources: int, size: int) -> tuple[Rows, int]:
    """Items of independent blocks (blocks × LANES,), −1 beyond those of a block, and the number of blocks."""
    items, begin = independent_blocks(start, resource, resources, size)
    found = np.full(LANES * (len(begin) - 1), -1)
    block = np.repeat(np.arange(len(begin) - 1), np.diff(begin))
    found[LANES * block + np.arange(len(items)) - begin[block]] = items
    return found, len(begin) - 1
