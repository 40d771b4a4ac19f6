"""Gaps in the lines of uncertain forces, which show in print, in grey and to colour-blind readers.

A line is divided into equal periods. In each a gap takes the fraction σ(f_n) / f_n, so that a sure force is an unbroken
line and a force about which little is known a row of dots.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..solver.bodies.grains import Array

SURE = 0.2  # σ / f_n below which a line is unbroken
WIDEST = 0.78  # of a period: the gap of an unknown force, and of every greater σ / f_n
PERIOD = 0.65  # length of a period over the mean radius of the grains


class Gaps(NamedTuple):
    """Gaps (g,) of lines: the line, its middle (g, 2), its length and the direction (g, 2) of the line."""

    row: NDArray[np.intp]
    middle: Array
    length: Array
    direction: Array


def relative_uncertainty(fn: Array, sd: Array) -> Array:
    """Return σ / f_n of every force (c,); NaN where no standard deviation is known or no force is borne."""
    borne = np.where(fn > 0.0, fn, np.nan)
    return np.asarray(sd / borne, np.float64)


def line_gaps(lines: Array, relative: Array, mean_radius: float) -> Gaps:
    """Return the gaps of the lines of forces.

    Parameters
    ----------
    lines : array (c, 2, 2)
        Ends of the lines, in any unit of length.
    relative : array (c,)
        σ / f_n; NaN: not known, drawn as the most uncertain.
    mean_radius : float
        Mean radius of the grains, in the same unit.
    """
    fraction = np.where(np.isfinite(relative), np.clip(relative, 0.0, WIDEST), WIDEST)
    along = lines[:, 1] - lines[:, 0]
    length = np.linalg.norm(along, axis=1)
    broken = np.flatnonzero((fraction >= SURE) & (length > 0.0))
    periods = np.maximum(np.rint(length[broken] / (PERIOD * mean_radius)), 1.0).astype(np.int64)
    row = np.repeat(broken, periods)
    within = np.arange(len(row)) - np.repeat(np.cumsum(periods) - periods, periods)
    count = np.repeat(periods, periods)
    place = (within + 0.5) / count
    middle = lines[row, 0] + place[:, None] * along[row]
    return Gaps(row, middle, fraction[row] * length[row] / count, along[row] / length[row, None])
