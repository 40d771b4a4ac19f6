"""When a grain's reference is damaged for good, and may be taken anew.

A scratch, or paint that is lost, leaves a grain with a reference that it will never look like again. Errors add up with
every new reference, so one is taken only where several photographs on end agree with one another better than with the
old one, and the grain has moved meanwhile: a stain that stays where it is while the grain moves is no damage.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ...experiment.photographs import Image
from ...tracks import TrackStatus
from ..correlation.correlator import Correlator, Rows
from ..correlation.patches import Patches
from ..correlation.splines import Pyramid
from .poses import FramePoses

# Photographs in a row in which a part of a grain had to be disregarded before its reference is doubted.
DAMAGED_FRAMES = 3

# How far [px] the grain or its rim must have moved since: what covers a grain then shows beside where it was.
MOVED = 2.0

# How well the photographs must agree: ZNCC, and the distance [px] from the pose they were given.
AGREEING_ZNCC = 0.9
AGREEING_PLACE = 0.25


def find_damaged(
    correlator: Correlator, history: Sequence[FramePoses], first_frame: int, photograph: Callable[[int], Image]
) -> Rows:
    """The grains whose reference is to be cut anew out of the last photograph of the history.

    history: the frames before, most recent last, the first of them of number first_frame; photograph: by number.
    """
    run = _robust_run(history)
    patches = correlator.patches
    rows = np.flatnonzero(run >= DAMAGED_FRAMES)
    if len(rows) == 0:
        return rows
    last = len(history) - 1
    begin = last + 1 - run
    moved = np.array([_moved(history[begin[row]], history[last], int(row), float(patches.reach[row])) for row in rows])
    rows = rows[moved >= MOVED]
    if len(rows) == 0:
        return rows
    new = patches.renew(
        photograph(first_frame + last), rows, history[last].pose[rows], np.zeros(len(rows))
    )  # fmt: skip
    agree = np.array([new.source(row) is not patches.source(row) for row in rows])
    # Those just before it and those where the damage was first seen.
    for frame in {last - 1, *begin[rows].tolist()}:
        here = np.flatnonzero(agree & ((begin[rows] == frame) | (frame == last - 1)))
        if len(here):
            agree[here] &= _agrees(
                correlator, new, Pyramid(photograph(first_frame + frame)), rows[here], history[frame]
            )
    return rows[agree]


def _agrees(
    correlator: Correlator, new: Patches, photograph: Pyramid, rows: Rows, poses: FramePoses
) -> NDArray[np.bool_]:
    """Whether the new patches fit a photograph where the grains (m,) were found in it."""
    told = poses.pose[rows]
    fits = correlator.with_patches(new).fit(photograph, rows, told, np.full(len(rows), 4.0))
    off = np.linalg.norm(fits.pose[:, :2] - told[:, :2], axis=1)
    turned = np.abs(fits.pose[:, 2] - told[:, 2]) * new.reach[rows]
    return fits.converged & (fits.zncc > AGREEING_ZNCC) & (np.maximum(off, turned) < AGREEING_PLACE)


def _robust_run(history: Sequence[FramePoses]) -> Rows:
    """In how many frames up to the last one a grain was found robustly (n,), against one and the same reference."""
    run = np.zeros(len(history[-1].x), dtype=np.intp)
    open_ = np.ones(len(run), dtype=np.bool_)
    for poses in reversed(history):
        open_ &= (poses.status == TrackStatus.ROBUST) & (poses.reference == history[-1].reference)
        run += open_
    return run


def _moved(before: FramePoses, after: FramePoses, row: int, reach: float) -> float:
    step = after.pose[row] - before.pose[row]
    return float(np.hypot(step[0], step[1]) + reach * abs(step[2]))
