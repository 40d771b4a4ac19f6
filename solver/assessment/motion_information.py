"""Information in the motion that leads to a frame: how much sliding, gaps and balance reveal of its forces.

Agreement of the estimators is no information: where nothing slides, or where noise hides the sliding, all ensemble
members agree, and nothing contradicts them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from ..bodies.grains import Array
from ..bodies.motion import FrameMotion, Snapshot
from ..bodies.packing import Packing
from ..bodies.wall_shapes import behind_body
from ..bodies.walls import Walls
from ..contacts.contacts import Contacts
from ..contacts.kinematics import relative_motion
from ..detection.displacement import displacement_scale
from ..robust_scale import SD_OVER_MAD
from ..statistics.force_statistics import mean_normal_force

DETECTABLE = 3.0  # standard deviations of a measured sliding beyond which it is detected
STRONG = 0.5  # of the mean force: contacts that surely touch
LOOSE = 0.1  # of the mean force: at weaker contacts a rod may be free, and slide however far without a force
# Of the rms sliding of all bearing contacts over that of those which hold their rods: 1.0 to 1.9 on simulated packings
# in which no rod moves freely.
MOST_BY_LOOSE = 2.0
# The same over that without the contacts that slide most: 1.2 to 3.0 in shear, heaps and rings; a single rod that rolls
# freely, and bears a little at a wall or a neighbour, makes it infinite.
FEW, MOST_BY_FEW = 0.03, 3.0
FEWEST_STRONG = 10  # of them, whose gaps are compared


@dataclass(frozen=True, slots=True)
class MotionInformation:
    """Information in a frame's motion and gaps. NaN: not known."""

    noise: float  # [m] standard deviation of a position component
    motion: float  # [m] typical displacement between neighbours since the last photograph, noise subtracted
    sliding: float  # fraction of the bearing contacts that slide by more than noise
    slide_signal: float  # rms sliding of the bearing contacts over its noise, noise subtracted; free rods left out
    gap_error: float  # [m] standard deviation of the gaps of strong contacts, noise subtracted
    diameter: float  # [m] mean
    beyond: int  # grains beyond a wall, which touch nothing there
    soft: bool = False  # gaps are overlaps that forces make
    unexplained_gap: float = np.nan  # [m] gap_error without the overlaps that are proportional to the forces
    undetermined: float = np.nan  # fraction of the components of the forces that balance leaves open


NO_INFORMATION = MotionInformation(np.nan, np.nan, np.nan, np.nan, np.nan, np.nan, 0)


def measure_motion_information(
    packing: Packing,
    snapshot: Snapshot,
    motion: FrameMotion,
    contacts: Contacts,
    fn: Array,
    walls: Walls,
    *,
    soft: bool,
) -> MotionInformation:
    """Measure the information of one frame.

    Parameters
    ----------
    packing : Packing
    snapshot : Snapshot
        Positions of the frame.
    motion : FrameMotion
        Motion that leads to it.
    contacts : Contacts
    fn : ndarray, shape (c,)
        Normal forces of the reported field [N].
    walls : Walls
        As they moved.
    soft : bool
        Whether gaps are overlaps that forces make.
    """
    grains = packing.grains
    bearing = fn > 0.0
    noise = snapshot.sigma
    sliding = signal = np.nan
    if bearing.any():
        moving = motion.grains
        _, speed = relative_motion(contacts, grains.radius, moving.velocity, moving.spin, walls)
        slid = (np.abs(speed) * motion.interval)[bearing]
        slide_sd = noise * np.where(contacts.with_wall[bearing], 2.0, 8.0**0.5)
        sliding = float((slid > DETECTABLE * slide_sd).mean())
        signal = _slide_signal(slid, slide_sd, fn[bearing])
    strong = _strong_gaps(contacts, fn)
    gap_error = _beyond_noise(strong.gap, strong, noise)
    return MotionInformation(
        noise, motion_scale(motion, noise), sliding, signal, gap_error, 2.0 * float(grains.radius.mean()),
        _count_beyond(packing.walls_of(snapshot), snapshot, contacts, grains.free), soft,
        _beyond_noise(_without_overlap(strong), strong, noise) if soft else gap_error,
        undetermined_fraction(contacts, fn, snapshot.present & grains.free),
    )  # fmt: skip


def undetermined_fraction(contacts: Contacts, fn: Array, balanced: NDArray[np.bool_]) -> float:
    """Fraction of the components of the contact forces that the balance of grains leaves open.

    Parameters
    ----------
    contacts : Contacts
    fn : ndarray, shape (c,)
        Their normal forces [N].
    balanced : ndarray, shape (n,)
        Grains whose forces and moments are in balance: neither absent nor of the boundary.

    Returns
    -------
    float
        1 − 3 m/(2 c), c the contacts that hold grains and m the balanced grains that they touch: f_n and f_t of every
        contact against ΣF_x, ΣF_y and ΣM of every grain. NaN without such a contact.
    """
    holding = fn > LOOSE * mean_normal_force(fn)
    count = int(holding.sum())
    touched = np.zeros(len(balanced), np.bool_)
    touched[contacts.i[holding]] = True
    touched[contacts.j[holding & ~contacts.with_wall]] = True
    return 1.0 - 1.5 * int((touched & balanced).sum()) / count if count else np.nan


def _slide_signal(slid: Array, slide_sd: Array, fn: Array) -> float:
    """rms sliding of bearing contacts (m,) over its noise, limited by that of those that hold rods, and of most."""
    held = fn > LOOSE * fn.mean()
    most = np.argsort(slid / slide_sd)[: len(slid) - math.ceil(FEW * len(slid))]
    return min(
        _sliding_over_noise(slid, slide_sd),
        MOST_BY_LOOSE * _sliding_over_noise(slid[held], slide_sd[held]),
        MOST_BY_FEW * _sliding_over_noise(slid[most], slide_sd[most]),
    )


def _sliding_over_noise(slid: Array, slide_sd: Array) -> float:
    """rms of slidings (m,) [m] over their noise (m,) [m], noise subtracted; 0 of none."""
    if not len(slid):
        return 0.0
    return float(np.sqrt(max(np.mean(slid**2) / np.mean(slide_sd**2) - 1.0, 0.0)))


def motion_scale(motion: FrameMotion, noise: float) -> float:
    """Typical displacement between neighbours since the last photograph [m], noise [m] subtracted; NaN of one grain."""
    moving = motion.grains
    if moving.present.sum() < 2:
        return np.nan
    after = np.where(moving.present[:, None], moving.position, np.nan)
    return displacement_scale(after - motion.interval * moving.velocity, after, np.full(len(after), noise))


class _StrongGaps(NamedTuple):
    """Gaps of contacts that surely touch (m,) [m], their normal forces [N], and which are with a wall."""

    gap: Array
    fn: Array
    with_wall: NDArray[np.bool_]


def _strong_gaps(contacts: Contacts, fn: Array) -> _StrongGaps:
    strong = fn > STRONG * mean_normal_force(fn)
    return _StrongGaps(contacts.gap[strong], fn[strong], contacts.with_wall[strong])


def _without_overlap(strong: _StrongGaps) -> Array:
    """Gaps (m,) [m] without the overlap that grows with the normal force, by least squares."""
    if len(strong.gap) < FEWEST_STRONG:
        return strong.gap
    relative = strong.fn - strong.fn.mean()
    known = np.isfinite(strong.gap)
    slope = float(relative[known] @ strong.gap[known]) / max(float(relative[known] @ relative[known]), 1e-300)
    return strong.gap - min(slope, 0.0) * relative  # a greater force opens no gap


def _beyond_noise(gap: Array, strong: _StrongGaps, noise: float) -> float:
    """Robust standard deviation of the gaps of strong contacts [m], noise subtracted."""
    if len(gap) < FEWEST_STRONG:
        return np.nan
    variance = (SD_OVER_MAD * np.median(np.abs(gap - np.median(gap)))) ** 2
    expected = noise**2 * np.where(strong.with_wall, 1.0, 2.0).mean()
    return float(np.sqrt(max(variance - expected, 0.0)))


def _count_beyond(walls: Walls, snapshot: Snapshot, contacts: Contacts, free: NDArray[np.bool_]) -> int:
    """Number of free grains of the packing whose centre is beyond a wall beside which they are.

    Grains beyond a wall that no chain of pairs connects with those inside lie beside the apparatus.
    """
    offset = snapshot.position[:, None, :] - walls.endpoints[None, :, 0, :]
    out = np.einsum("nwk,wk->nw", offset, walls.outward)
    along = np.einsum("nwk,wk->nw", offset, walls.direction)
    beside: NDArray[np.bool_] = (along > 0.0) & (along < walls.length[None, :])
    past = beside & (out > 0.0) & (snapshot.present & free)[:, None]
    if not past.any():
        return 0
    beyond = (past & ~behind_body(walls.endpoints, walls.side, snapshot.position)).any(axis=1)
    n, pair = len(beyond), ~contacts.with_wall
    pairs = csr_array((np.ones(int(pair.sum())), (contacts.i[pair], contacts.j[pair])), shape=(n, n))
    part = connected_components(pairs, directed=False)[1]
    return int((beyond & np.isin(part, part[snapshot.present & ~beyond])).sum())
