"""Detection of grains whose reference is damaged permanently and must be renewed.

A scratch, or lost paint, makes a grain differ from its reference permanently. Errors accumulate with every new
reference. A reference is therefore renewed only where several consecutive photographs agree with one another better
than with the old one, and the grain has moved in between: a stain that stays in place while the grain moves is no
damage.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ...experiment.pictures.image import Image
from ...tracks import TrackStatus
from ..correlation.correlator import Correlator, Rows
from ..correlation.patches import Patches
from ..correlation.splines import Pyramid
from .poses import FramePoses

# Number of consecutive robust fits after which a grain's reference is tested for damage.
DAMAGED_FRAMES = 3

# Distance [px] that the grain or its rim must have moved since: a covering object then covers another part of it.
MOVED = 2.0

# Least ZNCC and greatest distance [px] between the fit of a new patch and the pose found in a photograph.
AGREEMENT_ZNCC = 0.9
AGREEMENT_DISTANCE = 0.25


def find_damaged(
    correlator: Correlator, history: Sequence[FramePoses], first_frame: int, photograph: Callable[[int], Image]
) -> Rows:
    """Find the grains whose reference is to be cut from the last photograph of the history.

    Parameters
    ----------
    correlator : Correlator
        Holds the present references.
    history : sequence of FramePoses
        The frames before, most recent last.
    first_frame : int
        Number of the first of them.
    photograph : callable
        Returns the photograph of a number.

    Returns
    -------
    (m,) array
        Rows of the grains.
    """
    run = _robust_run(history)
    patches = correlator.patches
    rows = np.flatnonzero(run >= DAMAGED_FRAMES)
    if len(rows) == 0:
        return rows
    last = len(history) - 1
    begin = last + 1 - run
    moved = np.array([_moved(history[begin[row]], history[last], int(row), float(patches.radius[row])) for row in rows])
    rows = rows[moved >= MOVED]
    if len(rows) == 0:
        return rows
    new = patches.renew(photograph(first_frame + last), rows, history[last].pose[rows], np.zeros(len(rows)))
    agree = np.array([new.source(row) is not patches.source(row) for row in rows])
    # The last but one photograph, and those that showed the damage first.
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
    """Whether the new patches fit a photograph at the stored poses of the grains (m,)."""
    stored = poses.pose[rows]
    fits = correlator.with_patches(new).fit(photograph, rows, stored, np.full(len(rows), 4.0))
    shift = np.linalg.norm(fits.pose[:, :2] - stored[:, :2], axis=1)
    rim_shift = np.abs(fits.pose[:, 2] - stored[:, 2]) * new.radius[rows]
    return fits.converged & (fits.zncc > AGREEMENT_ZNCC) & (np.maximum(shift, rim_shift) < AGREEMENT_DISTANCE)


def _robust_run(history: Sequence[FramePoses]) -> Rows:
    """Number of consecutive robust fits (n,) of every grain up to the last frame, against the same reference."""
    run = np.zeros(len(history[-1].x), dtype=np.intp)
    unbroken = np.ones(len(run), dtype=np.bool_)
    for poses in reversed(history):
        unbroken &= (poses.status == TrackStatus.ROBUST) & (poses.reference == history[-1].reference)
        run += unbroken
    return run


def _moved(before: FramePoses, after: FramePoses, row: int, radius: float) -> float:
    step = after.pose[row] - before.pose[row]
    return float(np.hypot(step[0], step[1]) + radius * abs(step[2]))
