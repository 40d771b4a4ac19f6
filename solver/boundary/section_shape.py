"""Whether rods are round, from the gaps of each one's neighbours in different directions.

A rod whose radius is stated wrongly errs by the same amount in the gaps of all its neighbours, one whose centre is
displaced by opposite amounts at opposite sides. A rod of elliptic section errs by the same amount at opposite sides and
by opposite ones at right angles.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array
from ..even_subset import even_subset
from .touching_pairs import find_near_pairs

MOST_FRAMES = 6  # that are read, evenly over the sequence
WIDTH = 2.0  # rms overlaps up to which a gap may be that of a touching pair
FEWEST_GAPS = 50  # of a photograph
BLOCKS = 20  # of rods, each left out in turn


class SectionShape(NamedTuple):
    """Sections r(φ) = R (1 + e cos 2(φ − α)) with directions α that vary from rod to rod."""

    ovality: float  # e, rms over the rods, with respect to the mean radius; zero where its square is negative
    fraction: float  # of the variance of the gaps: that by the ovality of one of both rods
    significance: float  # the fraction over its standard error


ROUND = SectionShape(0.0, 0.0, 0.0)


def measure_section_shape(position: Array, radius: Array, boundary: NDArray[np.bool_] | None = None) -> SectionShape:
    """Estimate how elliptic the sections of rods are.

    Parameters
    ----------
    position : (f, n, 2)
        Centres [m], NaN where a rod is missing.
    radius : (n,)
        Radii [m].
    boundary : (n,), optional
        Rods of the boundary, of which two need not touch; None: none.

    Returns
    -------
    SectionShape
        ROUND where too few rods have neighbours.

    Notes
    -----
    Let g be the gaps of candidate pairs, up to twice the rms overlap, less their regression on 1, l, l cos 2φ and
    l sin 2φ, the effects of a wrong scale and a stretched picture on branch vectors (l, φ). Of two gaps of the same rod
    in directions φ and φ' from it

        E[g g'] = σ_R² + σ_c² cos(φ − φ') + ½ ⟨(e R)²⟩ cos 2(φ − φ')

    with the variances σ_R² of radii and σ_c² of components of centres: least squares over all such products, as the
    variance components of Haseman & Elston (1972). The standard error is that of the jackknife over blocks of rods,
    which are the same in all photographs. No rotation is needed, as both gaps are of one photograph.
    """
    n = len(radius)
    normal, right, variance = np.zeros((BLOCKS, 3, 3)), np.zeros((BLOCKS, 3)), []
    for k in even_subset(len(position), MOST_FRAMES):
        gap, angle, rod = _gaps_of_rods(position[k], radius, boundary)
        if len(gap) < 2 * FEWEST_GAPS:
            continue
        variance.append(float(np.var(gap)))
        for lag in range(1, int(np.bincount(rod, minlength=n).max())):
            first = np.flatnonzero(rod[lag:] == rod[:-lag])
            between = angle[first + lag] - angle[first]
            row = np.stack([np.ones(len(first)), np.cos(between), np.cos(2.0 * between)], axis=1)
            block = rod[first] % BLOCKS
            np.add.at(normal, block, row[:, :, None] * row[:, None, :])
            np.add.at(right, block, row * (gap[first] * gap[first + lag])[:, None])
    if not variance or not np.linalg.cond(normal.sum(axis=0)) < 1.0 / np.finfo(float).eps:
        return ROUND
    found = float(np.linalg.solve(normal.sum(axis=0), right.sum(axis=0))[2])
    others = [
        np.linalg.solve(normal.sum(axis=0) - each, right.sum(axis=0) - its)[2]
        for each, its in zip(normal, right, strict=True)
    ]
    error = float(np.sqrt((BLOCKS - 1.0) * np.var(others)))
    ovality = float(np.sqrt(2.0 * max(found, 0.0))) / float(radius.mean())
    return SectionShape(ovality, found / float(np.mean(variance)), found / error if error > 0.0 else 0.0)


def _gaps_of_rods(
    position: Array, radius: Array, boundary: NDArray[np.bool_] | None
) -> tuple[Array, Array, NDArray[np.int64]]:
    """Gaps [m] of candidate pairs, each for both rods, directions [rad] from the rod, and the rods, in order."""
    pairs = find_near_pairs(position, radius, boundary)
    overlap = pairs.gap[pairs.gap < 0.0]
    near = pairs.gap < (WIDTH * float(np.sqrt(np.mean(overlap**2))) if len(overlap) else 0.0)
    i, j, gap = pairs.i[near], pairs.j[near], pairs.gap[near]
    if not len(gap):
        return np.empty(0), np.empty(0), np.empty(0, np.int64)
    angle = np.arctan2(pairs.normal[near, 1], pairs.normal[near, 0])
    length = gap + radius[i] + radius[j]
    effects = np.ones(len(gap)), length, length * np.cos(2.0 * angle), length * np.sin(2.0 * angle)
    shared = np.stack(effects, axis=1)
    shared /= np.abs(shared).max(axis=0)
    gap = gap - shared @ np.linalg.lstsq(shared, gap, rcond=None)[0]
    rod = np.concatenate([i, j]).astype(np.int64)
    order = np.argsort(rod, kind="stable")
    return np.tile(gap, 2)[order], np.concatenate([angle, angle + np.pi])[order], rod[order]
