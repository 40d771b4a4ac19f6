"""What the sampler's loops read and change: pairs, grains, the law of a sweep, one draw, and room to work in.

All that a contact asks of a grain is one record, which is one line of the cache.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array

Rows = NDArray[np.int64]

# Of a grain's record: ΣF, ΣM over the mean radius; ε and δ; radius over the mean radius; 1 where ΣF is known, else 0.
FX, FY, TORQUE, CX, CY, DELTA, LEVER, KNOWN = range(8)
BODY = 8


class Pairs(NamedTuple):
    """Pairs within reach, as they were measured."""

    i: Rows  # (c,) row of a grain
    j: Rows  # (c,) row of a grain, −1: a wall
    normal: Array  # (c, 2) from i towards j
    gap: Array  # (c,)
    odds: Array  # (c,) ln P/(1 − P) before gap and balance are looked at
    friction: Array  # (c,)
    group: Rows  # (c,) group whose normal forces have a known sum, −1: none
    deviation: Array  # (c,) of an error that this gap has for itself; 0: none


class Centres(NamedTuple):
    """Grains, and the pairs that each of them has.

    m = k n rows: the n grains in one frame or, one frame after the other, in k frames that share the radii.
    """

    lever: Array  # (m,) radius over the mean radius
    load: Array  # (m, 2) weight
    balanced: Array  # (m,) 1.0, or 0.0 where forces on the grain are missing
    deviation: Array  # (m,) of the centre's error along each axis
    radius_deviation: Array  # (n,) of the radius' error
    start: Rows  # (m + 1,) of a grain's rows in `row`
    row: Rows  # (2c,) of pairs, a grain's own after one another
    group_load: Array  # (g,) known sums of normal forces


class Law(NamedTuple):
    """What holds in one sweep."""

    balance: float  # s
    width: float  # b
    shear: float  # τ
    open_gap: float  # ℓ
    gauge: float  # K of the mean force; 0: a load fixes it
    share: float  # K of the number that bear
    expected: float  # Σ P
    stiffness_mean: float  # of κ, before anything is known
    stiffness_sd: float
    offset_sd: float
    rarity: float  # λ of large forces


class State(NamedTuple):
    """One draw of everything unknown; changes in place."""

    bears: NDArray[np.bool_]  # (c,)
    fn: Array  # (c,)
    ft: Array  # (c,)
    open_gap: Array  # (c,) γ
    body: Array  # (m, 8) the grains' records
    group_sum: Array  # (g,)
    common: Array  # (4,) κ, offset, Σ_bears (f − 1), Σ z


class Room(NamedTuple):
    """What follows from the pairs or from a sweep's law, and what contacts tell the grains."""

    sharp: Array  # (c, 4) b, 1/b², A without κ, √ of t's A: −½ A f² of f's law
    told: Array  # (c, 2) 1/b², and the height over contact that remains without any error, less what it should be
    toward: Array  # (2c, 2) normals as the grains see them, in the order of `Centres.row`
    other: Rows  # (2c,) the other grain, −1: a wall
    fixed: Array  # (m, 5) factor of the precision of ε
    precision: Array  # (n,) of δ


def start_state(pairs: Pairs, centres: Centres, stiffness: float) -> State:
    """A start without errors of centres: as many bear, the nearest first, as are expected to; each the same force."""
    count, between = len(pairs.i), pairs.j >= 0
    share = 1.0 / (1.0 + np.exp(-pairs.odds))
    bears = np.zeros(count, np.bool_)
    bears[np.argsort(pairs.gap, kind="stable")[: round(float(share.sum()))]] = True
    fn = bears.astype(np.float64)
    force = fn[:, None] * pairs.normal
    body = np.zeros((len(centres.lever), BODY))
    body[:, :2], body[:, LEVER], body[:, KNOWN] = centres.load, centres.lever, centres.balanced
    np.subtract.at(body[:, :2], pairs.i, force)
    np.add.at(body[:, :2], pairs.j[between], force[between])
    grouped = pairs.group >= 0
    return State(
        bears, fn, np.zeros(count), np.where(bears, 0.0, np.maximum(pairs.gap, 0.0)), body,
        np.bincount(pairs.group[grouped], fn[grouped], minlength=len(centres.group_load)).astype(np.float64),
        np.array([stiffness, 0.0, 0.0, float(bears.sum())]),
    )  # fmt: skip


def make_room(pairs: Pairs, centres: Centres) -> Room:
    """Room for a chain; only what follows from the pairs alone is there."""
    count, rows = len(pairs.i), centres.row
    grain = np.repeat(np.arange(len(centres.lever)), np.diff(centres.start))
    ahead = pairs.i[rows] == grain
    return Room(
        np.empty((count, 4)), np.empty((count, 2)),
        np.where(ahead, -1.0, 1.0)[:, None] * pairs.normal[rows],  # the height falls as j's error goes along the normal
        np.where(ahead, pairs.j[rows], pairs.i[rows]),
        np.empty((len(centres.lever), 5)), np.empty(len(centres.radius_deviation)),
    )  # fmt: skip
