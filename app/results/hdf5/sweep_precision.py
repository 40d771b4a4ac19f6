"""Forces of every sweep, rounded to more than the precision of pictures: less than a byte per contact and sweep.

Without rounding they take 4.7 bytes, nearly all of them for digits that no picture resolves: the widest line and the
brightest colour are divided into fewer steps than a mean force here. The forces that maps of residuals are computed
from, those of the logarithmically spaced sweeps, keep all their digits.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...solver.nlgs.sweep_record import SweepHistory
from ...solver.statistics.force_statistics import mean_normal_force

STEPS = 256  # of the mean f_n at the end of the frame, at least


def round_sweeps(history: SweepHistory) -> SweepHistory:
    """Round the forces of all but the logarithmically spaced sweeps to multiples of a step.

    The step is the power of two [N] at or below the mean f_n over STEPS, so the error is at most the mean over 512.

    Parameters
    ----------
    history : SweepHistory
        A frame; one that kept some sweeps only is returned as it is.
    """
    rounded = np.ones(len(history.recorded), np.bool_)
    rounded[history.spaced_rows] = False
    mean = mean_normal_force(history.fn[-1]) if rounded.any() else 0.0
    if not mean > 0.0:  # or NaN: no contact bears force
        return history
    step = np.float32(2.0 ** np.floor(np.log2(mean / STEPS)))

    def rounding(force: np.ndarray) -> np.ndarray:
        return np.where(rounded[:, None], np.round(force / step) * step, force)

    return replace(history, fn=rounding(history.fn), ft=rounding(history.ft))
